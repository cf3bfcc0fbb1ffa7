"""Distances to the nearest wall, interpolated between the centres of cells, with their slopes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray
    from mclcli.world.distance_field import DistanceField


class Looked(NamedTuple):
    """Distances [m] and their slopes along x and y of the map, all of one shape; off the map the clamp, and 0."""

    distance: FloatArray
    slope_x: FloatArray
    slope_y: FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A distance field as a surface of hyperbolic patches; single precision holds 0.1 µm of 2 m.

    ``cells`` are the field's with one more around it, which repeats those at its border.
    """

    cells: NDArray[np.float32]
    field: DistanceField

    @staticmethod
    def of(field: DistanceField) -> Surface:
        """Surface of a field without unknown cells."""
        return Surface(np.pad(field.levels.astype(np.float32)[field.codes], 1, mode="edge"), field)

    def look(self, x: FloatArray, y: FloatArray) -> Looked:
        """What is at points x, y [m] of the map, arrays of one shape."""
        origin_x, origin_y, yaw = self.field.origin.tolist()
        c, s = math.cos(yaw), math.sin(yaw)
        height, width = self.field.codes.shape
        scale = 1.0 / self.field.resolution
        dx, dy = x - origin_x, y - origin_y
        column, row = (c * dx + s * dy) * scale, (c * dy - s * dx) * scale
        inside = (column >= 0.0) & (column < width) & (row >= 0.0) & (row < height)
        column, row = np.where(inside, column + 0.5, 0.5), np.where(inside, row + 0.5, 0.5)
        left, below = column.astype(np.int64), row.astype(np.int64)
        u, v = column - left, row - below
        flat, at = self.cells.ravel(), below * (width + 2) + left
        first, beside = flat.take(at).astype(np.float64), flat.take(at + 1).astype(np.float64)
        at += width + 2
        above, across = flat.take(at).astype(np.float64), flat.take(at + 1).astype(np.float64)
        lower, upper = first + u * (beside - first), above + u * (across - above)
        by_column = np.where(inside, (beside - first) + v * ((across - above) - (beside - first)), 0.0) * scale
        by_row = np.where(inside, upper - lower, 0.0) * scale
        found = np.where(inside, lower + v * (upper - lower), self.field.max_dist)
        return Looked(found, c * by_column - s * by_row, s * by_column + c * by_row)
