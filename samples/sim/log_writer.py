"""Recordings as ROS 2 MCAP files: the topics, frames and clocks of a usual mobile robot.

/scan LaserScan · /odom Odometry · /tf odom → base · /tf_static base → sensors · /landmarks LandmarkBearings
/ground_truth PoseStamped · /initialpose PoseWithCovarianceStamped, once at the start
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, final

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from samples.sim.recording import START_NS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from samples.sim.recording import Recording
    from samples.sim.sensors import Mount

LANDMARK_BEARINGS = "std_msgs/Header header\nstring[] ids\nfloat64[] bearings\n"
CHUNK_BYTES = 128 * 1024
BASE_HEIGHT = 0.08  # m from base_footprint to base_link
_STATIC_LAG, _ODOM_LAG, _SCAN_LAG, _IMAGE_LAG = 0, 1_000_000, 6_000_000, 45_000_000  # ns from stamp to log

_TYPES = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/ground_truth": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/landmarks": "mcl_msgs/msg/LandmarkBearings",
}
_store = get_typestore(Stores.ROS2_HUMBLE)
_store.register(get_types_from_msg(LANDMARK_BEARINGS, _TYPES["/landmarks"]))


@final
class _Entry(NamedTuple):
    """One message: sorted by the time it is logged at."""

    log_ns: int
    topic: str
    stamp_ns: int
    message: Any


def write_log(recording: Recording, path: Path) -> None:
    """Write a recording to ``path`` as MCAP, profile ros2, zstd, in chunks of about 128 KiB.

    Messages stand in the order of their log times, which lag behind their stamps as those of real drivers do.
    """
    entries = sorted(_entries(recording), key=lambda entry: entry.log_ns)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=CHUNK_BYTES)
        writer.start(profile="ros2", library="mcl samples")
        channels = {topic: _channel(writer, topic) for topic in _TYPES if topic in {e.topic for e in entries}}
        for sequence, (log_ns, topic, stamp_ns, message) in enumerate(entries):
            data = bytes(_store.serialize_cdr(message, _TYPES[topic]))
            writer.add_message(channels[topic], log_ns, data, stamp_ns, sequence)
        writer.finish()  # type: ignore[no-untyped-call]


def _channel(writer: Writer, topic: str) -> int:
    text, _ = _store.generate_msgdef(_TYPES[topic], ros_version=2)
    schema = writer.register_schema(_TYPES[topic], "ros2msg", text.encode())
    latched = topic == "/tf_static"
    return writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": _qos(latched=latched)})


def _qos(*, latched: bool) -> str:
    """Quality of service as rosbag2 stores it: keep-last 10, reliable; transient local where latched."""
    forever = "\n    sec: 9223372036\n    nsec: 854775807"
    return (
        f"- history: 1\n  depth: 10\n  reliability: 1\n  durability: {1 if latched else 2}"
        f"\n  deadline:{forever}\n  lifespan:{forever}\n  liveliness: 1"
        f"\n  liveliness_lease_duration:{forever}\n  avoid_ros_namespace_conventions: false"
    )


def _entries(recording: Recording) -> Iterator[_Entry]:
    yield _entry("/tf_static", 0, _STATIC_LAG, _new(_TYPES["/tf_static"], transforms=_mounts(recording)))
    yield _entry("/initialpose", 0, _STATIC_LAG, _initial(recording))
    yield from _odometry(recording)
    yield from _truth(recording)
    yield from _scans(recording)
    for seen in recording.sightings:
        header = _header(seen.stamp_ns, "camera_link")
        message = _new(_TYPES["/landmarks"], header=header, ids=list(seen.ids), bearings=seen.bearings)
        yield _entry("/landmarks", seen.stamp_ns, _IMAGE_LAG, message)


def _odometry(recording: Recording) -> Iterator[_Entry]:
    base = recording.scenario.chain[0]
    for stamp, pose, twist in zip(recording.odom.stamps_ns, recording.odom.poses, recording.twists, strict=True):
        header, (x, y, yaw) = _header(int(stamp), "odom"), (float(v) for v in pose)
        rotation = _quaternion(yaw)
        message = _new(
            _TYPES["/odom"],
            header=header,
            child_frame_id=base,
            pose=_new("geometry_msgs/msg/PoseWithCovariance", pose=_pose(x, y, yaw), covariance=np.zeros(36)),
            twist=_new("geometry_msgs/msg/TwistWithCovariance", twist=_twist(twist), covariance=np.zeros(36)),
        )
        yield _entry("/odom", int(stamp), _ODOM_LAG, message)
        edge = _transform(header, base, (x, y, 0.0), rotation)
        yield _entry("/tf", int(stamp), _ODOM_LAG, _new(_TYPES["/tf"], transforms=[edge]))


def _truth(recording: Recording) -> Iterator[_Entry]:
    for stamp, pose in zip(recording.truth.stamps_ns, recording.truth.poses, strict=True):
        x, y, yaw = (float(v) for v in pose)
        message = _new(_TYPES["/ground_truth"], header=_header(int(stamp), "map"), pose=_pose(x, y, yaw))
        yield _entry("/ground_truth", int(stamp), _ODOM_LAG, message)


def _scans(recording: Recording) -> Iterator[_Entry]:
    lidar = recording.scenario.lidar
    lag = _SCAN_LAG + round(lidar.sweep * 1e9)
    for stamp, ranges in zip(recording.scan_stamps_ns, recording.ranges, strict=True):
        message = _new(
            _TYPES["/scan"],
            header=_header(int(stamp), "laser"),
            angle_min=lidar.angle_min,
            angle_max=lidar.angle_min + (lidar.beams - 1) * lidar.angle_increment,
            angle_increment=lidar.angle_increment,
            time_increment=lidar.sweep / lidar.beams,
            scan_time=1.0 / lidar.rate,
            range_min=lidar.range_min,
            range_max=lidar.range_max,
            ranges=ranges,
            intensities=np.empty(0, dtype=np.float32),
        )
        yield _entry("/scan", int(stamp), lag, message)


def _initial(recording: Recording) -> Any:  # noqa: ANN401 - classes of messages are made when the program runs
    """Pose with the spread that RViz gives to a click: 0.5 m and 15°."""
    x, y, yaw = (float(v) for v in recording.initial)
    covariance = np.zeros(36)
    covariance[[0, 7, 35]] = 0.25, 0.25, math.radians(15) ** 2
    pose = _new("geometry_msgs/msg/PoseWithCovariance", pose=_pose(x, y, yaw), covariance=covariance)
    return _new(_TYPES["/initialpose"], header=_header(0, "map"), pose=pose)


def _mounts(recording: Recording) -> list[Any]:
    """Static transforms: along the chain of base frames, then to the sensors."""
    scenario, header = recording.scenario, _header(0, recording.scenario.chain[-1])
    edges = [
        _transform(_header(0, parent), child, (0.0, 0.0, BASE_HEIGHT), _quaternion(0.0))
        for parent, child in zip(scenario.chain[:-1], scenario.chain[1:], strict=True)
    ]
    edges.append(_mounted(header, "laser", scenario.lidar.mount))
    if scenario.camera:
        edges.append(_mounted(header, "camera_link", scenario.camera.mount))
    return edges


def _mounted(header: Any, child: str, mount: Mount) -> Any:  # noqa: ANN401
    return _transform(header, child, (mount.x, mount.y, mount.z), _quaternion(mount.yaw, upside_down=mount.upside_down))


def _transform(header: Any, child: str, position: tuple[float, float, float], rotation: Any) -> Any:  # noqa: ANN401
    translation = _vector(*position)
    transform = _new("geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
    return _new("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=transform)


def _quaternion(yaw: float, *, upside_down: bool = False) -> Any:  # noqa: ANN401
    """Rz(yaw), or Rz(yaw)·Rx(π): (0, 0, s, c)·(1, 0, 0, 0) = (c, s, 0, 0)."""
    c, s = math.cos(yaw / 2), math.sin(yaw / 2)
    x, y, z, w = (c, s, 0.0, 0.0) if upside_down else (0.0, 0.0, s, c)
    return _new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def _pose(x: float, y: float, yaw: float) -> Any:  # noqa: ANN401
    position = _new("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
    return _new("geometry_msgs/msg/Pose", position=position, orientation=_quaternion(yaw))


def _twist(twist: Any) -> Any:  # noqa: ANN401
    vx, vy, w = (float(v) for v in twist)
    return _new("geometry_msgs/msg/Twist", linear=_vector(vx, vy, 0.0), angular=_vector(0.0, 0.0, w))


def _vector(x: float, y: float, z: float) -> Any:  # noqa: ANN401
    return _new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _header(stamp_ns: int, frame_id: str) -> Any:  # noqa: ANN401
    sec, nanosec = divmod(START_NS + stamp_ns, 1_000_000_000)
    return _new(
        "std_msgs/msg/Header", stamp=_new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec), frame_id=frame_id
    )


def _entry(topic: str, stamp_ns: int, lag_ns: int, message: Any) -> _Entry:  # noqa: ANN401
    return _Entry(START_NS + stamp_ns + lag_ns, topic, START_NS + stamp_ns, message)


def _new(type_name: str, **fields: Any) -> Any:  # noqa: ANN401
    return _store.types[type_name](**fields)
