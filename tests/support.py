"""Small things that many tests build: grids, beams, records, and the choice between NumPy and compiled code."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.native.backend import COMPILED, NUMPY
from mclcli.records import LandmarkSightings, LaserScan, Odometry, Transform
from mclcli.world.occupancy import FREE, OCCUPIED, OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mclcli.arrays import FloatArray

SECOND = 1_000_000_000
BACKENDS = (NUMPY, COMPILED)
each_backend = pytest.mark.parametrize("backend", BACKENDS, ids=lambda backend: backend.name)


def grid_of(occupied: ArrayLike, resolution: float = 1.0, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> OccupancyGrid:
    """Map with these cells occupied (H, W) and the others free."""
    cells = np.where(np.asarray(occupied, dtype=bool), OCCUPIED, FREE).astype(np.int8)
    return OccupancyGrid(cells, resolution, np.array(origin, dtype=np.float64))


def scan_of(ranges: ArrayLike, **changes: Any) -> LaserScan:
    """Scan straight ahead from −40° to 40°, of range 0 to 8 m, unless changed."""
    values = np.asarray(ranges, dtype=np.float64)
    fields: dict[str, Any] = {
        "stamp_ns": 0,
        "frame_id": "laser",
        "angle_min": math.radians(-40.0),
        "angle_increment": math.radians(80.0) / max(values.size - 1, 1),
        "range_min": 0.0,
        "range_max": 8.0,
        "ranges": values,
    }
    return LaserScan(**(fields | changes))


def odometry(stamp_ns: int, *pose: float, child: str = "base_link") -> Odometry:
    """Odometry message with this pose x, y, yaw."""
    return Odometry(stamp_ns, "odom", child, np.array(pose, dtype=np.float64))


def sightings(stamp_ns: int, ids: Sequence[str], rays: ArrayLike, frame: str = "camera") -> LandmarkSightings:
    """Landmarks seen along these rays (M, 3)."""
    return LandmarkSightings(stamp_ns, frame, tuple(ids), np.asarray(rays, dtype=np.float64).reshape(-1, 3))


def level(*bearings: float) -> FloatArray:
    """Unit rays (M, 3) with these bearings [rad] in a level frame."""
    return np.array([[math.cos(b), math.sin(b), 0.0] for b in bearings])


def transform(stamp_ns: int, parent: str, child: str, matrix: FloatArray, *, static: bool = False) -> Transform:
    """One edge of the tree of frames."""
    return Transform(stamp_ns, parent, child, matrix, static)
