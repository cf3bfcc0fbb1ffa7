"""Which of several robots is meant, where a start pose is given: the one whose first scan fits the map there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from mclcli.geometry import se3
from mclcli.records import LaserScan

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.io.recording.robots import Robot
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.world.occupancy import OccupancyGrid

_NEAR_M = 0.3
_FITS, _CLEARLY = 0.6, 1.5


def robot_at(pose: FloatArray, robots: Sequence[Robot], survey: LogSurvey, grid: OccupancyGrid) -> Robot | None:
    """The robot whose first scan fits at a pose (3,) of the base, None if none does, or none clearly better.

    A scan fits by the share of its returns that end within 0.3 m of an occupied cell.
    """
    distances = ndimage.distance_transform_edt(~grid.occupied) * grid.resolution
    shares = [
        max((_share(survey, robot, name, pose, grid, distances) for name in robot.scans), default=0.0)
        for robot in robots
    ]
    order = np.argsort(shares)[::-1]
    best, second = shares[order[0]], shares[order[1]] if len(order) > 1 else 0.0
    return robots[order[0]] if best >= _FITS and best >= _CLEARLY * second else None


def _share(
    survey: LogSurvey, robot: Robot, name: str, pose: FloatArray, grid: OccupancyGrid, distances: FloatArray
) -> float:
    scan = survey.topics[name].sample
    mount = robot.frames.nominal(robot.base, scan.frame_id) if isinstance(scan, LaserScan) else None
    if mount is None or not isinstance(scan, LaserScan):
        return 0.0
    farthest = min(scan.range_max, float(np.hypot(grid.width, grid.height)) * grid.resolution)
    kept = np.isfinite(scan.ranges) & (scan.ranges > max(scan.range_min, 0.0)) & (scan.ranges < farthest)
    ranges, angles = scan.ranges[kept], scan.angle_min + np.flatnonzero(kept) * scan.angle_increment
    ends = np.stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(angles.size), np.ones(angles.size)])
    points = (se3.from_planar(pose) @ mount @ ends)[:2].T
    inside = grid.contains(points)
    at = np.floor(grid.to_cells(points[inside])).astype(np.int64)
    near = np.count_nonzero(distances[at[:, 1], at[:, 0]] <= _NEAR_M)
    return near / angles.size if angles.size else 0.0
