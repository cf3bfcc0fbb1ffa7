"""Distance from every cell of a map to the nearest occupied cell.

Distances are stored as small codes into a table of levels: an exact field on a grid has few distinct values (the roots
of integers), so a likelihood needs evaluating once a level instead of once a cell, and the field stays small and exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import UsageError
from mclcli.native import backend
from mclcli.world.squared_distance import squared_distances

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.world import FieldMethod
    from mclcli.world.occupancy import OccupancyGrid

    Codes = NDArray[np.uint16] | NDArray[np.uint32]


@final
@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Distances over a grid, clamped at ``max_dist`` [m].

    ``codes`` (H, W) uint16 or uint32, row 0 at the bottom; ``levels`` (L,) float64 [m]: ``levels[codes]`` are the
    distances between cell centres, and the last level is ``max_dist``. ``resolution`` [m] and ``origin`` (3,)
    (x, y, yaw) place it in the map as in ``OccupancyGrid``.
    """

    codes: Codes
    levels: FloatArray
    resolution: float
    origin: FloatArray

    @property
    def max_dist(self) -> float:
        """The clamp, which also holds off the map [m]."""
        return float(self.levels[-1])

    def metres(self) -> FloatArray:
        """Distances (H, W) float64 [m]."""
        return self.levels[self.codes]


def compute(
    grid: OccupancyGrid,
    method: FieldMethod,
    max_dist: float,
    *,
    boundary_only: bool = False,
    mark_unknown: bool = False,
) -> DistanceField:
    """Distance field of a map; a map without an occupied cell is at ``max_dist`` everywhere.

    ``boundary_only`` takes distances to occupied cells with a free one among their 4 neighbours. ``mark_unknown``
    makes the distance NaN in unknown cells, and in the occupied cells that ``boundary_only`` leaves out.

    Raises
    ------
    UsageError
        If ``max_dist`` is not a positive finite number.

    """
    if not (math.isfinite(max_dist) and max_dist > 0.0):
        raise UsageError(f"laser_likelihood_max_dist = {max_dist} m: must be finite and greater than 0")
    occupied = grid.occupied & _beside_free(grid) if boundary_only else grid.occupied
    if not occupied.any():
        field = _field(grid, np.zeros(occupied.shape, np.uint16), np.array([max_dist]))
    elif method == "exact":
        field = _exact(grid, occupied, max_dist)
    else:
        field = from_metres(grid, _brushfire(occupied, max_dist / grid.resolution) * grid.resolution, max_dist)
    return _marked(grid, field, grid.unknown | (grid.occupied & ~occupied)) if mark_unknown else field


def _beside_free(grid: OccupancyGrid) -> BoolArray:
    """Cells with a free one among their 4 neighbours."""
    free = np.pad(grid.free, 1)
    return free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]


def _marked(grid: OccupancyGrid, field: DistanceField, cells: BoolArray) -> DistanceField:
    """Field with NaN in some cells: a level of its own, before the last."""
    last = field.levels.size - 1
    codes = field.codes.astype(np.uint32)
    codes[field.codes == last] = last + 1
    codes[cells] = last
    return _field(grid, codes, np.concatenate([field.levels[:last], [np.nan], field.levels[last:]]))


def from_metres(grid: OccupancyGrid, metres: NDArray[np.floating], max_dist: float) -> DistanceField:
    """Field from distances (H, W) [m] computed elsewhere, clamped at ``max_dist``.

    Distances closer than 1 µm are one level: path lengths summed in another order differ by rounding alone.
    """
    below: BoolArray = metres < max_dist
    values = metres[below].astype(np.float64)
    rank, first = _ranked(np.rint(values * 1e6))
    levels = np.append(values[first], max_dist)
    codes = np.full(metres.shape, levels.size - 1, np.uint32)
    codes[below] = rank
    return _field(grid, codes, levels)


def _ranked(whole: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rank (N,) of each whole number ≥ 0 among the distinct ones, and where each of those stands first."""
    if whole.size == 0 or whole.max() > 16 * whole.size:
        _, first, rank = np.unique(whole, return_index=True, return_inverse=True)
        return rank, first
    place = np.full(int(whole.max()) + 1, -1)  # counting takes the place of sorting
    numbers = whole.astype(np.intp)
    place[numbers[::-1]] = np.arange(numbers.size - 1, -1, -1)
    there = place >= 0
    return (np.cumsum(there) - 1)[numbers], place[there]


def _exact(grid: OccupancyGrid, occupied: BoolArray, max_dist: float) -> DistanceField:
    """Euclidean distances; codes are squared distances in cells where those fit a table."""
    reach = max_dist / grid.resolution
    if reach * reach >= np.iinfo(np.uint16).max - 1:
        limit = min(math.ceil(min(reach, 2.0**15) ** 2), sum(side * side for side in occupied.shape))
        return from_metres(grid, np.sqrt(squared_distances(occupied, limit)) * grid.resolution, max_dist)
    squares = np.sqrt(np.arange(math.ceil(reach * reach) + 1)) * grid.resolution
    levels = np.append(squares[squares < max_dist], max_dist)
    return _field(grid, squared_distances(occupied, levels.size - 1).astype(np.uint16, copy=False), levels)


def _brushfire(occupied: BoolArray, reach: float) -> FloatArray:
    """Shortest 8-neighbour path lengths [cells], steps 1 and √2; right at least up to ``reach``."""
    distance = np.where(occupied, 0.0, np.inf)
    rounds = min(math.ceil(reach), sum(occupied.shape))
    if backend.worth_compiling(8.0 * rounds * distance.size):
        backend.load("brushfire").two_pass_chamfer(distance)
        return distance
    for _ in range(rounds):
        relaxed = _relax(distance)
        if np.array_equal(relaxed, distance):
            break
        distance = relaxed
    return distance


def _relax(distance: FloatArray) -> FloatArray:
    """One step outwards to all eight neighbours."""
    height, width = distance.shape
    padded = np.pad(distance, 1, constant_values=np.inf)
    relaxed = distance
    for row in (0, 1, 2):
        for column in (0, 1, 2):
            neighbour = padded[row : row + height, column : column + width]
            relaxed = np.minimum(relaxed, neighbour + math.hypot(row - 1, column - 1))
    return relaxed


def _field(grid: OccupancyGrid, codes: Codes, levels: FloatArray) -> DistanceField:
    if levels.size <= np.iinfo(np.uint16).max:
        codes = codes.astype(np.uint16, copy=False)
    codes.flags.writeable = False
    levels.flags.writeable = False
    return DistanceField(codes, levels, grid.resolution, grid.origin)
