"""What the base logs hold: a robot on a circle in a rectangular room, every message known to the byte."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from tests.io.logs import seeded
from tests.io.ros_messages import STORES, TWIST, build

START_NS = 1_700_000_000 * 10**9
SECONDS = 12
HALF = (4.0, 3.0)  # m, half the room
BEAMS = 90
TYPES = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/note": "std_msgs/msg/String",
}
MAP_YAML = (
    "image: room.pgm\nresolution: 0.1\norigin: [-5.0, -4.0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
)
INIT = "1.5,0,90deg"


class Known(NamedTuple):
    """One message of a base log."""

    topic: str
    log_ns: int
    data: bytes


@cache
def messages(encoding: str) -> tuple[Known, ...]:
    """All messages, ``cdr`` or ``ros1``, in order of log time."""
    found = [_static(encoding)]
    for number in range(SECONDS * 10):
        at = START_NS + number * 10**8
        pose = pose_at(number / 10)
        found += [_odometry(encoding, at, pose), _transform(encoding, at + 10**6, pose)]
        if number % 2:
            found.append(_scan(encoding, at + 2 * 10**6, pose))
        if number % 10 == 5:
            text = seeded(number).randbytes(40).hex()
            found.append(_known(encoding, "/note", at + 3 * 10**6, {"data": f"note {number}: {text}"}))
    return tuple(sorted(found, key=lambda known: known.log_ns))


def room() -> bytes:
    """Map of the room as PGM: walls 0.1 m thick."""
    cells = np.full((80, 100), 254, np.uint8)
    cells[9, 9:91] = cells[70, 9:91] = 0
    cells[9:71, 9] = cells[9:71, 90] = 0
    return b"P5\n100 80\n255\n" + cells.tobytes()


def definition(encoding: str, kind: str) -> tuple[str, str]:
    """Definition of a type, and its digest."""
    text, digest = STORES[encoding].generate_msgdef(kind, ros_version=1 if encoding == "ros1" else 2)
    return text, digest


def pose_at(seconds: float) -> tuple[float, float, float]:
    """Pose of the base in the map, and in the odometry's frame, so many seconds after the start."""
    angle = 0.2 * seconds
    return 1.5 * math.cos(angle), 1.5 * math.sin(angle), angle + math.pi / 2


def _known(encoding: str, topic: str, at: int, values: Any) -> Known:
    store, kind = STORES[encoding], TYPES[topic]
    serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    return Known(topic, at, bytes(serialize(build(encoding, kind, values), kind)))


def _header(at: int, frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": at // 10**9, "nanosec": at % 10**9}, "frame_id": frame, "seq": 0}


def _placed(pose: tuple[float, float, float]) -> dict[str, Any]:
    x, y, yaw = pose
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn}


def _edge(at: int, parent: str, child: str, pose: tuple[float, float, float]) -> dict[str, Any]:
    placed = _placed(pose)
    transform = {"translation": placed["position"], "rotation": placed["orientation"]}
    return {"header": _header(at, parent), "child_frame_id": child, "transform": transform}


def _static(encoding: str) -> Known:
    return _known(
        encoding, "/tf_static", START_NS, {"transforms": [_edge(START_NS, "base_link", "laser", (0.1, 0, 0))]}
    )


def _transform(encoding: str, at: int, pose: tuple[float, float, float]) -> Known:
    return _known(encoding, "/tf", at, {"transforms": [_edge(at - 10**6, "odom", "base_link", pose)]})


def _odometry(encoding: str, at: int, pose: tuple[float, float, float]) -> Known:
    nothing = np.zeros(36)
    values = {
        "header": _header(at, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": _placed(pose), "covariance": nothing},
        "twist": TWIST | {"covariance": nothing},
    }
    return _known(encoding, "/odom", at, values)


def _scan(encoding: str, at: int, pose: tuple[float, float, float]) -> Known:
    x, y, yaw = pose
    x, y = x + 0.1 * math.cos(yaw), y + 0.1 * math.sin(yaw)
    angles = np.arange(BEAMS) * (2 * math.pi / BEAMS) - math.pi
    cos, sin = np.cos(angles + yaw), np.sin(angles + yaw)
    ranges = np.minimum((np.sign(cos) * HALF[0] - x) / cos, (np.sign(sin) * HALF[1] - y) / sin)
    values = {
        "header": _header(at - 2 * 10**6, "laser"),
        "angle_min": -math.pi,
        "angle_max": float(angles[-1]),
        "angle_increment": 2 * math.pi / BEAMS,
        "time_increment": 0.0,
        "scan_time": 0.2,
        "range_min": 0.05,
        "range_max": 12.0,
        "ranges": ranges.astype(np.float32),
        "intensities": np.array([], np.float32),
    }
    return _known(encoding, "/scan", at, values)
