"""Raw messages into records: what each type of message means to mcl.

A message is used as it stands or not at all: bytes too many or too few, an unknown version of a type, a rotation that
is none give ``Undecodable`` with the reason. No bytes raise.
"""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se3
from mclcli.io.messages.conversion import Context, Undecodable, frame_name, read_only
from mclcli.io.messages.parsing import NOT_PARSED, parser_for, to_plain
from mclcli.io.messages.sightings import vision_messages
from mclcli.quantity import FARTHEST
from mclcli.records import LaserScan, Odometry, StampedPose, Transform

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.io.logs.base import RawMessage, Tally
    from mclcli.io.messages.conversion import Parsed
    from mclcli.io.messages.sightings import Vision
    from mclcli.world.occupancy import OccupancyGrid

    Record = LaserScan | Odometry | StampedPose | Vision | OccupancyGrid | Transform | tuple[Transform, ...]

__all__ = ["DECODABLE", "Undecodable", "decode", "planar_covariance", "to_plain"]

NOT_RIGID = "transform left out: not rigid"
NO_TURN = "the quaternion of the map's origin is 0, 0, 0, 0: taken for no turn"
ANGLE_MAX = "angle_max does not fit the number of readings; the readings count"
_PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and rotation about z of a 6 × 6 covariance
_LARGEST = 1e12  # variance above which a covariance says nothing
_LONG = 4 << 20  # [bytes] no message has more that we decode; its fields become objects many times as large
_LONGEST = {"nav_msgs/msg/OccupancyGrid": 65 << 20}  # 64 million cells


def decode(message: RawMessage, tally: Tally | None = None) -> Record | Undecodable:
    """Record of a message, one of the types in ``DECODABLE``, or why there is none.

    What is undecodable, and what is changed in or left out of a message, is counted in ``tally`` and warned of once a
    topic and reason.
    """
    try:
        result = _decode(message, tally)
    except Exception:  # noqa: BLE001 - a log may hold any bytes, and none of them may end a run
        result = Undecodable(NOT_PARSED)
    if isinstance(result, Undecodable) and tally is not None:
        topic = message.channel.topic
        if tally.reject(topic, result.reason) == 1 and tally.announce:
            logging.getLogger("mclcli").warning("%s: messages cannot be decoded: %s", topic, result.reason)
    return result


def _decode(message: RawMessage, tally: Tally | None) -> Record | Undecodable:
    channel = message.channel
    convert = _CONVERTERS.get(channel.type)
    if convert is None:
        return Undecodable(f"its type {channel.type[:100]!r} is of no use here")
    limit = _LONGEST.get(channel.type, _LONG)
    if len(message.data) > limit:
        return Undecodable(f"it is longer than {limit >> 20} MiB")
    parse = parser_for(channel)
    if isinstance(parse, Undecodable):
        return parse
    value = parse(message.data)
    return value if isinstance(value, Undecodable) else convert(value, Context(message, tally))


def _laser_scan(value: Parsed, context: Context) -> LaserScan:
    with np.errstate(invalid="ignore"):  # signalling NaN are NaN as well
        ranges = value.ranges.astype(np.float64)
    last = float(value.angle_min) + (ranges.size - 1) * float(value.angle_increment)
    if ranges.size > 1 and not abs(value.angle_max - last) <= 1.01 * abs(value.angle_increment):
        context.note(ANGLE_MAX)
    return LaserScan(
        stamp_ns=context.stamp(value.header),
        frame_id=frame_name(value.header.frame_id),
        angle_min=float(value.angle_min),
        angle_increment=float(value.angle_increment),
        range_min=float(value.range_min),
        range_max=float(value.range_max),
        ranges=read_only(ranges),
        angle_max=float(value.angle_max),
        time_increment=float(value.time_increment),
        scan_time=float(value.scan_time),
    )


def _odometry(value: Parsed, context: Context) -> Odometry | Undecodable:
    pose = _planar(value.pose.pose)
    if isinstance(pose, Undecodable):
        return pose
    frame, child = frame_name(value.header.frame_id), frame_name(value.child_frame_id)
    linear, angular = value.twist.twist.linear, value.twist.twist.angular
    twist = (float(linear.x), float(linear.y), float(angular.z))
    return Odometry(context.stamp(value.header), frame, child, pose, twist)


def _transforms(value: Parsed, context: Context) -> tuple[Transform, ...]:
    static = context.raw.channel.topic.endswith("tf_static")
    result = []
    for item in value.transforms:
        matrix = _matrix(item.transform.translation, item.transform.rotation)
        if matrix is None:
            context.note(NOT_RIGID)
        else:
            result.append(_transform(item, matrix, context, static=static))
    return tuple(result)


def _transform(item: Parsed, matrix: FloatArray, context: Context, *, static: bool) -> Transform:
    # A static transform holds at all times: its stamp says nothing, and is often 0.
    stamp = context.raw.log_time_ns if static and not _stamped(item.header) else context.stamp(item.header)
    return Transform(stamp, frame_name(item.header.frame_id), frame_name(item.child_frame_id), matrix, static)


def _transform_stamped(value: Parsed, context: Context) -> Transform | Undecodable:
    """One transform on a topic of its own, as motion capture states poses; no part of the tree of frames."""
    wrong = _wrong_with(value.transform.translation, value.transform.rotation)
    if wrong is not None:
        return wrong
    matrix = _matrix(value.transform.translation, value.transform.rotation)
    assert matrix is not None  # noqa: S101 - nothing is wrong with it
    return _transform(value, matrix, context, static=False)


def _pose_stamped(value: Parsed, context: Context) -> StampedPose | Undecodable:
    return _pose(value.header, value.pose, None, context)


def _pose_with_covariance(value: Parsed, context: Context) -> StampedPose | Undecodable:
    covariance = planar_covariance(np.array(value.pose.covariance, dtype=np.float64))
    return _pose(value.header, value.pose.pose, covariance, context)


def _pose(header: Parsed, pose: Parsed, covariance: FloatArray | None, context: Context) -> StampedPose | Undecodable:
    planar, matrix = _planar(pose), _matrix(pose.position, pose.orientation)
    if isinstance(planar, Undecodable):
        return planar
    return StampedPose(context.stamp(header), frame_name(header.frame_id), planar, covariance, matrix)


def _occupancy_grid(value: Parsed, context: Context) -> OccupancyGrid | Undecodable:
    from mclcli.world.occupancy import OccupancyGrid

    info = value.info
    origin = _planar(info.origin)
    if origin is UNFILLED:  # some SLAM nodes leave it so, and map servers' clients take it for no turn
        context.note(NO_TURN)
        info.origin.orientation.w = 1.0
        origin = _planar(info.origin)
    if isinstance(origin, Undecodable):
        return origin
    if info.width * info.height != len(value.data):
        return Undecodable("its cells are not width × height")
    cells = read_only(np.array(value.data, dtype=np.int8).reshape(info.height, info.width))
    try:
        return OccupancyGrid(cells, float(info.resolution), origin, frame_name(value.header.frame_id))
    except ValueError as error:
        return Undecodable(str(error)[:200])


def planar_covariance(covariance: FloatArray) -> FloatArray | None:
    """Covariance (3, 3) of (x, y, yaw) from the 36 numbers of a ROS message, None if unusable.

    Unusable: all zero, not finite, above 1e12, not symmetric or not positive semidefinite (beyond rounding).
    """
    planar = covariance.reshape(6, 6)[_PLANAR]
    largest = float(np.abs(planar).max()) if np.isfinite(planar).all() else math.inf
    if not 0.0 < largest <= _LARGEST or np.abs(planar - planar.T).max() > 1e-6 * largest:
        return None
    symmetric = 0.5 * (planar + planar.T)
    return read_only(symmetric) if np.linalg.eigvalsh(symmetric)[0] >= -1e-9 * largest else None


def _matrix(position: Parsed, rotation: Parsed) -> FloatArray | None:
    """Transform (4, 4), None if the rotation is none or the translation is not finite, or beyond all bounds."""
    translation, quaternion = (position.x, position.y, position.z), (rotation.x, rotation.y, rotation.z, rotation.w)
    return read_only(se3.from_quaternion(translation, quaternion)) if _is_rigid(translation, quaternion) else None


def _planar(pose: Parsed) -> FloatArray | Undecodable:
    """The same projected on the ground, (3,), or what is wrong with it."""
    position, rotation = pose.position, pose.orientation
    translation, quaternion = (position.x, position.y, position.z), (rotation.x, rotation.y, rotation.z, rotation.w)
    wrong = _wrong_with(position, rotation)
    return read_only(se3.planar_from_quaternion(translation, quaternion)) if wrong is None else wrong


def _wrong_with(position: Parsed, rotation: Parsed) -> Undecodable | None:
    """What is wrong with a pose or transform, None if nothing is."""
    translation, quaternion = (position.x, position.y, position.z), (rotation.x, rotation.y, rotation.z, rotation.w)
    if _is_rigid(translation, quaternion):
        return None
    if not math.hypot(*translation) <= FARTHEST:
        return _NOWHERE
    return _NO_ROTATION if any(quaternion) else UNFILLED


def _is_rigid(translation: Sequence[float], quaternion: Sequence[float]) -> bool:
    # Both told before they are used: squares of wild numbers overflow. NaN fails either.
    return abs(math.hypot(*quaternion) - 1.0) <= 1e-2 and math.hypot(*translation) <= FARTHEST


def _stamped(header: Parsed) -> bool:
    return bool(header.stamp.sec or header.stamp.nanosec)


UNFILLED = Undecodable("its quaternion is 0, 0, 0, 0: the orientation was never filled in")
_NO_ROTATION = Undecodable("its quaternion is not of length 1")
_NOWHERE = Undecodable("its position is not finite, or beyond 1e9 m")
_CONVERTERS: dict[str, Callable[[Parsed, Context], Record | Undecodable]] = {
    "sensor_msgs/msg/LaserScan": _laser_scan,
    "nav_msgs/msg/Odometry": _odometry,
    "tf2_msgs/msg/TFMessage": _transforms,
    "tf/msg/tfMessage": _transforms,
    "geometry_msgs/msg/TransformStamped": _transform_stamped,
    "geometry_msgs/msg/PoseStamped": _pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_with_covariance,
    "nav_msgs/msg/OccupancyGrid": _occupancy_grid,
    **{kind: message.convert for kind, message in vision_messages().items()},
}
DECODABLE = frozenset(_CONVERTERS)
"""Types, as ROS 2 writes them, that ``decode`` turns into records."""
