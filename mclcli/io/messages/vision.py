"""Messages of cameras into records: calibrations, and landmarks seen as rays or as pixels.

A sighting that says nothing (no id, a point that is not finite) is left out and noted; the rest of its message counts.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.io.messages.conversion import Context, Undecodable, frame_name, read_only
from mclcli.io.messages.sightings import VisionMessage
from mclcli.records import CameraModel, LandmarkSightings, PixelSightings

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.arrays import FloatArray
    from mclcli.io.messages.conversion import Parsed

    Found = Iterable[tuple[str, tuple[float, ...]]]

NOT_FINITE = "sighting left out: no direction"
NAMELESS = "sighting left out: no hypothesis of what it is"
ELSEWHERE = "sighting left out: of another frame than its message"


def _camera_info(value: Parsed, context: Context) -> CameraModel:
    # ROS 1 wrote the matrices' names as capitals.
    d, k, r, p = (getattr(value, n.upper() if context.raw.channel.encoding == "ros1" else n) for n in "dkrp")
    return CameraModel(
        stamp_ns=context.stamp(value.header),
        frame_id=frame_name(value.header.frame_id),
        distortion_model=value.distortion_model,
        distortion=_matrix(d, -1),
        k=_matrix(k, 3, 3),
        r=_matrix(r, 3, 3),
        p=_matrix(p, 3, 4),
        binning=(max(int(value.binning_x), 1), max(int(value.binning_y), 1)),
        offset=(int(value.roi.x_offset), int(value.roi.y_offset)),
    )


def _matrix(values: Parsed, *shape: int) -> FloatArray:
    return read_only(np.array(values, dtype=np.float64).reshape(shape))


def _aruco_markers(value: Parsed, context: Context) -> LandmarkSightings | Undecodable:
    if len(value.marker_ids) != len(value.poses):
        return Undecodable("it has not as many ids as poses")
    poses = zip(value.marker_ids, value.poses, strict=True)
    return _rays(value.header, ((str(int(number)), _point(pose.position)) for number, pose in poses), context)


def _aruco_detection(value: Parsed, context: Context) -> LandmarkSightings:
    """Markers alone: a board is made of markers that are listed as well."""
    found = ((str(int(marker.marker_id)), _point(marker.pose.position)) for marker in value.markers)
    return _rays(value.header, found, context)


def _landmark_bearings(value: Parsed, context: Context) -> LandmarkSightings | Undecodable:
    if len(value.ids) != len(value.bearings):
        return Undecodable("it has not as many ids as bearings")
    with np.errstate(invalid="ignore"):  # directions that are not finite are left out
        bearings = np.array(value.bearings, dtype=np.float64)
        rays = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=-1)
    return _rays(value.header, zip(value.ids, rays.tolist(), strict=True), context)


def _apriltags(value: Parsed, context: Context) -> PixelSightings:
    found = ((str(int(tag.id)), _pixel(tag.centre)) for tag in value.detections)
    return _pixels(value.header, found, context)


def _detections_2d(value: Parsed, context: Context) -> PixelSightings:
    named = _named(value, context)
    # vision_msgs 4 has a position of its own in the centre; before, it was a geometry_msgs/Pose2D.
    found = ((name, _pixel(getattr(item.bbox.center, "position", item.bbox.center))) for name, item, _ in named)
    return _pixels(value.header, found, context)


def _detections_3d(value: Parsed, context: Context) -> LandmarkSightings:
    """Middle of the box; of a box left at the camera itself, the place of the hypothesis."""
    found = ((name, _middle(item, hypothesis)) for name, item, hypothesis in _named(value, context))
    return _rays(value.header, found, context)


def _middle(item: Parsed, hypothesis: Parsed) -> tuple[float, ...]:
    centre = _point(item.bbox.center.position)
    return centre if any(centre) else _point(hypothesis.pose.pose.position)


def _named(value: Parsed, context: Context) -> list[tuple[str, Parsed, Parsed]]:
    """Detections with the id of their likeliest hypothesis, and that hypothesis."""
    result = []
    for item in value.detections:
        if frame_name(item.header.frame_id) not in {"", frame_name(value.header.frame_id)}:
            context.note(ELSEWHERE)
        elif not item.results:
            context.note(NAMELESS)
        else:
            best = max(item.results, key=_score)
            result.append((_identity(best), item, best))
    return result


def _hypothesis(result: Parsed) -> Parsed:
    """Id and score: in a message of their own since vision_msgs 3, in the result itself before."""
    return getattr(result, "hypothesis", result)


def _score(result: Parsed) -> float:
    score = float(_hypothesis(result).score)
    return -math.inf if math.isnan(score) else score


def _identity(result: Parsed) -> str:
    hypothesis = _hypothesis(result)
    return str(result.id if hypothesis is result else hypothesis.class_id).strip()


def _point(point: Parsed) -> tuple[float, ...]:
    return float(point.x), float(point.y), float(point.z)


def _pixel(point: Parsed) -> tuple[float, ...]:
    """A point with x and y, or, in apriltag_msgs of old, an array of both."""
    x, y = point if isinstance(point, np.ndarray) else (point.x, point.y)
    return float(x), float(y)


def _rays(header: Parsed, found: Found, context: Context) -> LandmarkSightings:
    ids, rays = _finite(found, 3, context)
    return LandmarkSightings(context.stamp(header), frame_name(header.frame_id), ids, rays)


def _pixels(header: Parsed, found: Found, context: Context) -> PixelSightings:
    ids, pixels = _finite(found, 2, context)
    return PixelSightings(context.stamp(header), frame_name(header.frame_id), ids, pixels)


def _finite(found: Found, size: int, context: Context) -> tuple[tuple[str, ...], FloatArray]:
    """Ids and points (M, size), without those that say nothing."""
    pairs = list(found)
    points = np.array([point for _, point in pairs], dtype=np.float64).reshape(-1, size)
    good = np.isfinite(points).all(axis=1) & ((points != 0.0).any(axis=1) | (size == 2))  # a corner is a pixel as well
    for _ in range(int((~good).sum())):
        context.note(NOT_FINITE)
    ids = tuple(pairs[row][0] for row in np.flatnonzero(good))
    return ids, read_only(points[good])


CAMERA_INFO = VisionMessage("calibration", _camera_info)
ARUCO_MARKERS = VisionMessage("rays", _aruco_markers)
ARUCO_DETECTION = VisionMessage("rays", _aruco_detection)
LANDMARK_BEARINGS = VisionMessage("rays", _landmark_bearings)
APRILTAGS = VisionMessage("pixels", _apriltags)
DETECTIONS_2D = VisionMessage("pixels", _detections_2d)
DETECTIONS_3D = VisionMessage("rays", _detections_3d)
