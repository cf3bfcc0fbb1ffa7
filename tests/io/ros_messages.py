"""Helpers for tests of message decoding: messages of every kind, serialised by rosbags."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mclcli.io.logs.base import Channel, RawMessage

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

LOG_TIME = 77 * 10**9
TEXTS = {
    "ros2_aruco_interfaces/msg/ArucoMarkers": "std_msgs/Header header\nint64[] marker_ids\ngeometry_msgs/Pose[] poses",
    "mcl_msgs/msg/LandmarkBearings": "std_msgs/Header header\nstring[] ids\nfloat64[] bearings",
}
TF = {
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "tf/msg/tfMessage": "geometry_msgs/TransformStamped[] transforms",
}


def _store(name: Stores, texts: dict[str, str]) -> Typestore:
    store = get_typestore(name)
    for kind, text in texts.items():
        store.register(get_types_from_msg(text, kind))
    return store


STORES = {"ros1": _store(Stores.ROS1_NOETIC, TEXTS | TF), "cdr": _store(Stores.ROS2_HUMBLE, TEXTS)}


def build(encoding: str, kind: str, values: Any) -> Any:
    """Message object of a type from nested dicts; lists where the type has a sequence."""
    store = STORES[encoding]
    fields: dict[str, Any] = {}
    for name, (_, detail) in store.fielddefs[kind][1]:
        value = values.get(name, 0)
        nested = detail if isinstance(detail, str) else detail[0][1] if isinstance(detail[0], tuple) else None
        if isinstance(nested, str) and isinstance(value, list):
            value = [build(encoding, nested, item) for item in value]
        elif isinstance(nested, str):
            value = build(encoding, nested, value)
        fields[name] = value
    return store.types[kind](**fields)


def raw(encoding: str, kind: str, values: Any, *, topic: str = "/t", **channel: Any) -> RawMessage:
    """Message of a type, serialised by rosbags."""
    store = STORES[encoding]
    serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    data = bytes(serialize(build(encoding, kind, values), kind))
    return RawMessage(Channel(topic, kind, encoding, **channel), LOG_TIME, data)


def header(frame: str = "/laser", sec: int = 5, nanosec: int = 7) -> dict[str, Any]:
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def pose(x: float = 1.0, y: float = 2.0, yaw: float = 0.5, norm: float = 1.0) -> dict[str, Any]:
    turn = {"x": 0.0, "y": 0.0, "z": norm * math.sin(yaw / 2), "w": norm * math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.3}, "orientation": turn}


def floats(values: Any, kind: Any = np.float64) -> Any:
    return np.array(values, dtype=kind)


SCAN = {
    "header": header(),
    "angle_min": -1.5,
    "angle_max": -1.2,
    "angle_increment": 0.1,
    "time_increment": 0.001,
    "scan_time": 0.2,
    "range_min": 0.05,
    "range_max": 12.0,
    "ranges": floats([1.25, math.nan, math.inf, -1.0], np.float32),
    "intensities": floats([], np.float32),
}
NO_COVARIANCE = floats(np.zeros(36))
TWIST = {"twist": {"linear": dict.fromkeys("xyz", 0.0), "angular": dict.fromkeys("xyz", 0.0)}}
ODOMETRY = {
    "header": header("odom"),
    "child_frame_id": "/base",
    "pose": {"pose": pose(), "covariance": NO_COVARIANCE},
    "twist": TWIST | {"covariance": NO_COVARIANCE},
}


def edge(**changes: Any) -> dict[str, Any]:
    own = pose(3.0, 4.0, 1.0, norm=changes.get("norm", 1.0))
    placed = {"translation": own["position"], "rotation": own["orientation"]}
    return {"header": changes.get("header", header("/odom")), "child_frame_id": "base", "transform": placed}


GRID = {
    "header": header("map"),
    "info": {
        "map_load_time": {"sec": 0, "nanosec": 0},
        "resolution": 0.05,
        "width": 3,
        "height": 2,
        "origin": pose(-1.0, -2.0, 0.25),
    },
    "data": floats([0, 100, -1, 0, 0, 50], np.int8),
}
MARKERS = {
    "header": header("base"),
    "marker_ids": floats([63, 7], np.int64),
    "poses": [pose(1.0, -2.0), pose(math.nan, 0.0)],
}
BEARINGS = {"header": header("camera"), "ids": ["a", "b"], "bearings": floats([0.5, -3.0])}
SAMPLES: dict[str, dict[str, Any]] = {
    "sensor_msgs/msg/LaserScan": SCAN,
    "nav_msgs/msg/Odometry": ODOMETRY,
    "tf2_msgs/msg/TFMessage": {"transforms": [edge(), edge()]},
    "geometry_msgs/msg/TransformStamped": edge(),
    "geometry_msgs/msg/PoseStamped": {"header": header("map"), "pose": pose()},
    "geometry_msgs/msg/PoseWithCovarianceStamped": {"header": header("map"), "pose": ODOMETRY["pose"]},
    "nav_msgs/msg/OccupancyGrid": GRID,
    "ros2_aruco_interfaces/msg/ArucoMarkers": MARKERS,
    "mcl_msgs/msg/LandmarkBearings": BEARINGS,
}
