"""Messages of cameras in every version known, serialised by rosbags from texts that are written here once more."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mclcli.io.logs.base import Channel, RawMessage

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

LOG_TIME = 77 * 10**9
HEADER = "std_msgs/Header header\n"
TAGS, INFO = "apriltag_msgs/msg/AprilTagDetectionArray", "sensor_msgs/msg/CameraInfo"
BOXES, BOXES_3D = "vision_msgs/msg/Detection2DArray", "vision_msgs/msg/Detection3DArray"
ARUCO, MARKERS = "aruco_opencv_msgs/msg/ArucoDetection", "aruco_opencv_msgs/msg/MarkerDetection"


def _vision(box: str, hypothesis: str, tail_2d: str, tail_3d: str, more: str = "") -> dict[str, str]:
    """Texts of vision_msgs from what differs between its versions."""
    texts = {
        BOXES: HEADER + "Detection2D[] detections",
        BOXES_3D: HEADER + "Detection3D[] detections",
        "vision_msgs/msg/Detection2D": HEADER + "ObjectHypothesisWithPose[] results\nBoundingBox2D bbox\n" + tail_2d,
        "vision_msgs/msg/Detection3D": HEADER + "ObjectHypothesisWithPose[] results\nBoundingBox3D bbox\n" + tail_3d,
        "vision_msgs/msg/BoundingBox2D": f"{box} center\nfloat64 size_x\nfloat64 size_y",
        "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
        "vision_msgs/msg/ObjectHypothesisWithPose": hypothesis + "geometry_msgs/PoseWithCovariance pose",
    }
    if more:
        texts["vision_msgs/msg/ObjectHypothesis"] = "string class_id\nfloat64 score"
    if more == "4":
        texts["vision_msgs/msg/Pose2D"] = "Point2D position\nfloat64 theta"
        texts["vision_msgs/msg/Point2D"] = "float64 x\nfloat64 y"
    return texts


def _tags(points: str) -> dict[str, str]:
    start = "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
    return {
        TAGS: HEADER + "AprilTagDetection[] detections",
        "apriltag_msgs/msg/AprilTagDetection": start + points + "float64[9] homography",
        "apriltag_msgs/msg/Point": "float64 x\nfloat64 y",
    }


TRACKED = "bool is_tracking\nstring tracking_id"
COMMON = {
    ARUCO: HEADER + "MarkerPose[] markers\nBoardPose[] boards",
    MARKERS: HEADER + "MarkerPose[] markers",
    "aruco_opencv_msgs/msg/MarkerPose": "uint16 marker_id\ngeometry_msgs/Pose pose",
    "aruco_opencv_msgs/msg/BoardPose": "string board_name\ngeometry_msgs/Pose pose",
}
POINTS, ARRAYS = "Point centre\nPoint[4] corners\n", "float64[2] centre\nfloat64[8] corners\n"
VISION_TAILS = ("sensor_msgs/Image source_img\n", "sensor_msgs/PointCloud2 source_cloud\n")
VERSIONS: dict[str, tuple[str, dict[str, str]]] = {
    "vision 4": ("cdr", _vision("Pose2D", "ObjectHypothesis hypothesis\n", "string id", "string id", "4")),
    "vision 3": (
        "cdr",
        _vision("geometry_msgs/Pose2D", "ObjectHypothesis hypothesis\n", "string id", "string id", "3"),
    ),
    "vision 2": (
        "cdr",
        _vision("geometry_msgs/Pose2D", "string id\nfloat64 score\n", *(tail + TRACKED for tail in VISION_TAILS)),
    ),
    "vision 0": ("ros1", _vision("geometry_msgs/Pose2D", "int64 id\nfloat64 score\n", *VISION_TAILS)),
    "tags": ("cdr", COMMON | _tags(POINTS)),
    "tags, ROS 1": ("ros1", COMMON | _tags(POINTS)),
    "tags, arrays": ("cdr", _tags(ARRAYS)),
}


def _store(encoding: str, texts: dict[str, str]) -> Typestore:
    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    for kind, text in texts.items():
        store.register(get_types_from_msg(text, kind))
    return store


STORES = {name: _store(encoding, texts) for name, (encoding, texts) in VERSIONS.items()}
_ZEROS: dict[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}


def make(version: str, kind: str, values: Any) -> Any:
    """Message object of a type from nested dicts; what is not given is zero, empty or false."""
    store = STORES[version]
    fields = {}
    for name, (node, detail) in store.fielddefs[kind][1]:
        fields[name] = _value(version, int(node), detail, values.get(name, None))
    return store.types[kind](**fields)


def _value(version: str, node: int, detail: Any, given: Any) -> Any:
    if node == 2:  # a message
        return make(version, detail, given or {})
    if node == 1:  # a number or text
        return _ZEROS.get(detail[0], 0) if given is None else given
    (inner, what), count = detail
    if int(inner) == 2:
        return [make(version, what, item) for item in (given or [{}] * (count if node == 3 else 0))]
    dtype = "uint8" if what[0] in {"octet", "byte"} else what[0]
    return np.zeros(count if node == 3 else 0, dtype) if given is None else np.array(given, dtype)


def raw(
    version: str, kind: str, values: Any, *, topic: str = "/t", log_ns: int = LOG_TIME, **channel: Any
) -> RawMessage:
    """Message of a type in a version, serialised by rosbags, with its definition as logs have it."""
    store, encoding = STORES[version], VERSIONS[version][0]
    serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    text, digest = store.generate_msgdef(kind, ros_version=1 if encoding == "ros1" else 2)
    described = {"definition": text, "digest": digest if encoding == "ros1" else ""} | channel
    data = bytes(serialize(make(version, kind, values), kind))
    return RawMessage(Channel(topic, kind, encoding, **described), log_ns, data)


def header(frame: str = "/optical", sec: int = 5, nanosec: int = 7) -> dict[str, Any]:
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def tags(*found: tuple[int, float, float], version: str = "tags", **head: Any) -> dict[str, Any]:
    """AprilTagDetectionArray: id and centre of each tag."""
    arrays = version == "tags, arrays"
    centres = [(u, v) if arrays else {"x": u, "y": v} for _, u, v in found]
    rows = zip(found, centres, strict=True)
    return {
        "header": header(**head),
        "detections": [{"family": "36h11", "id": i, "hamming": 1, "centre": at} for (i, _, _), at in rows],
    }


def hypothesis(version: str, name: str, score: float, place: tuple[float, ...] = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """One of a detection's results."""
    at = {"pose": {"pose": {"position": dict(zip("xyz", place, strict=True))}}}
    if version in {"vision 3", "vision 4"}:
        return {"hypothesis": {"class_id": name, "score": score}} | at
    return {"id": int(name) if version == "vision 0" else name, "score": score} | at


def box_2d(version: str, u: float, v: float) -> dict[str, Any]:
    """Box of two dimensions around a pixel."""
    at = {"x": u, "y": v}
    return {"center": {"position": at} if version == "vision 4" else at, "size_x": 9.0, "size_y": 4.0}


def box_3d(*place: float) -> dict[str, Any]:
    """Box of three dimensions around a place."""
    return {"center": {"position": dict(zip("xyz", place, strict=True))}}


def info(version: str, **changes: Any) -> dict[str, Any]:
    """CameraInfo of a camera with a lens; the names of its matrices are capitals in ROS 1."""
    values: dict[str, Any] = {
        "header": header(),
        "height": 480,
        "width": 640,
        "distortion_model": "plumb_bob",
        "d": [-0.3, 0.1, 0.001, -0.0005, 0.0],
        "k": [600.0, 0, 320, 0, 610, 240, 0, 0, 1],
        "r": np.eye(3).ravel(),
        "p": [550.0, 0, 318, -30, 0, 550, 241, 0, 0, 0, 1, 0],
    } | changes
    capital = VERSIONS[version][0] == "ros1"
    return {name.upper() if capital and name in "dkrp" else name: value for name, value in values.items()}
