"""The map of the building as a grid of cells, and where its cells lie."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, final

import numpy as np

from mclcli.quantity import FARTHEST, MOST_TURNED

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mclcli.arrays import BoolArray, FloatArray

FREE: Final = 0
OCCUPIED: Final = 100
UNKNOWN: Final = -1
MIN_RESOLUTION, MAX_RESOLUTION = 1e-6, 1e6
"""Metres per cell that are believed, the first one excluded: with ``FARTHEST``, no coordinate has more than 1e15
cells."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """Occupancy of H × W square cells.

    ``cells``: (H, W) int8, row 0 at the bottom (lowest y): 0 free, 100 occupied, −1 unknown, 1 to 99 in between.
    ``resolution``: side of a cell [m]. ``origin``: (3,) float64, pose (x [m], y [m], yaw [rad]) in map of the outer
    corner of cell (0, 0). ``frame_id``: what a log calls the map's frame, '' where nothing says so. Stored arrays are
    read-only and in C order; a writable ``cells`` is copied.

    Raises
    ------
    ValueError
        If the cells are not int8 in −1…100 with at least one cell, or the geometry is beyond its bounds.

    """

    cells: NDArray[np.int8]
    resolution: float
    origin: FloatArray
    frame_id: str = ""
    _digest: list[str] = field(default_factory=list, init=False, repr=False)  # once it is known

    def __post_init__(self) -> None:
        origin = np.array(self.origin, dtype=np.float64)
        if origin.shape != (3,) or not (np.abs(origin) <= [FARTHEST, FARTHEST, MOST_TURNED]).all():
            expected = f"x and y within {FARTHEST:g} m, yaw within {MOST_TURNED:g} rad"
            raise ValueError(f"origin: expected {expected}, got {origin.tolist()}")
        if not MIN_RESOLUTION < self.resolution <= MAX_RESOLUTION:
            expected = f"above {MIN_RESOLUTION:g} m, at most {MAX_RESOLUTION:g} m"
            raise ValueError(f"resolution: expected a length {expected}, got {self.resolution}")
        origin.flags.writeable = False
        object.__setattr__(self, "cells", _checked(self.cells))
        object.__setattr__(self, "resolution", float(self.resolution))
        object.__setattr__(self, "origin", origin)

    @property
    def height(self) -> int:
        """Rows H."""
        return int(self.cells.shape[0])

    @property
    def width(self) -> int:
        """Columns W."""
        return int(self.cells.shape[1])

    @property
    def occupied(self) -> BoolArray:
        """Which cells are occupied, (H, W)."""
        return np.equal(self.cells, OCCUPIED)

    @property
    def free(self) -> BoolArray:
        """Which cells are free, (H, W)."""
        return np.equal(self.cells, FREE)

    @property
    def unknown(self) -> BoolArray:
        """Which cells are unknown, (H, W)."""
        return np.equal(self.cells, UNKNOWN)

    def to_cells(self, points: ArrayLike) -> FloatArray:
        """Continuous (column, row), (..., 2), of points (..., 2) [m] in map; its floor is the containing cell."""
        offset = np.asarray(points, dtype=np.float64) - self.origin[:2]  # first, so that far origins cost no digits
        c, s = math.cos(self.origin[2]), math.sin(self.origin[2])
        dx, dy = offset[..., 0], offset[..., 1]
        return np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1) / self.resolution

    def to_map(self, column_row: ArrayLike) -> FloatArray:
        """Points (..., 2) [m] in map of continuous (column, row); a cell's centre is its indices + 0.5."""
        scaled = np.asarray(column_row, dtype=np.float64) * self.resolution
        c, s = math.cos(self.origin[2]), math.sin(self.origin[2])
        u, v = scaled[..., 0], scaled[..., 1]
        return np.stack([c * u - s * v, s * u + c * v], axis=-1) + self.origin[:2]

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether points (..., 2) [m] in map lie on a cell, shape (...); NaN and infinity do not."""
        with np.errstate(invalid="ignore"):  # 0 · ∞
            column_row = self.to_cells(points)
        inside: BoolArray = np.asarray((column_row >= 0.0) & (column_row < [self.width, self.height]))
        return np.asarray(inside.all(axis=-1))

    def digest(self) -> str:
        """SHA-256 over cells, shape, resolution and origin, hexadecimal."""
        if not self._digest:
            geometry = np.array([self.height, self.width, self.resolution, *self.origin], dtype="<f8")
            hashed = hashlib.sha256(geometry.tobytes())
            hashed.update(self.cells.data)
            self._digest.append(hashed.hexdigest())
        return self._digest[0]


def _checked(cells: NDArray[np.int8]) -> NDArray[np.int8]:
    if cells.dtype != np.int8 or cells.ndim != 2 or cells.size == 0:
        raise ValueError(f"cells: expected int8 of shape (H, W), got {cells.dtype} of shape {cells.shape}")
    if cells.min() < UNKNOWN or cells.max() > OCCUPIED:
        raise ValueError(f"cells: expected −1 to 100, got {cells.min()} to {cells.max()}")
    if cells.flags.writeable:
        cells = cells.copy(order="C")
        cells.flags.writeable = False
    return np.ascontiguousarray(cells)
