"""Messages of cameras and other sensors that see landmarks, by type: a file of each or of several, and a line here.

The file is named as text and imported when messages are first decoded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, final

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mclcli.io.messages.conversion import Context, Undecodable
    from mclcli.records import CameraModel, LandmarkSightings, PixelSightings

    Vision = LandmarkSightings | PixelSightings | CameraModel

Seen = Literal["rays", "pixels", "calibration"]

VISION: dict[str, str] = {
    "ros2_aruco_interfaces/msg/ArucoMarkers": "mclcli.io.messages.vision:ARUCO_MARKERS",
    "aruco_opencv_msgs/msg/ArucoDetection": "mclcli.io.messages.vision:ARUCO_DETECTION",
    "aruco_opencv_msgs/msg/MarkerDetection": "mclcli.io.messages.vision:ARUCO_DETECTION",
    "vision_msgs/msg/Detection3DArray": "mclcli.io.messages.vision:DETECTIONS_3D",
    "mcl_msgs/msg/LandmarkBearings": "mclcli.io.messages.vision:LANDMARK_BEARINGS",
    "apriltag_msgs/msg/AprilTagDetectionArray": "mclcli.io.messages.vision:APRILTAGS",
    "vision_msgs/msg/Detection2DArray": "mclcli.io.messages.vision:DETECTIONS_2D",
    "sensor_msgs/msg/CameraInfo": "mclcli.io.messages.vision:CAMERA_INFO",
}
"""Where the ``VisionMessage`` of each type stands, as ``module:name``; types as ROS 2 writes them."""


@final
@dataclass(frozen=True, slots=True)
class VisionMessage:
    """A type of message: what is ``seen`` in it, and what makes a record of a parsed one.

    ``convert`` gives ``Undecodable`` for messages that contradict themselves. ``texts`` are definitions that neither
    rosbags nor ``definition_texts`` has, by type.
    """

    seen: Seen
    convert: Callable[[Any, Context], Vision | Undecodable]
    texts: Mapping[str, str] = field(default_factory=dict)


def vision_messages() -> dict[str, VisionMessage]:
    """All of them, by type."""
    found: dict[str, VisionMessage] = {}
    for kind, place in VISION.items():
        module, _, attribute = place.partition(":")
        found[kind] = getattr(import_module(module), attribute)
    return found


def types_with(seen: Seen) -> tuple[str, ...]:
    """Types in which this is seen."""
    return tuple(kind for kind, message in vision_messages().items() if message.seen == seen)
