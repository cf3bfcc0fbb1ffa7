"""Ways through a building that keep off its walls."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray
    from samples.sim.building import Building

_FACTOR = 2  # grid cells per cell of the clearance grid, in each direction
_REACH = 8  # cells up to which clearance is measured
_SMOOTHING = 7  # points averaged along a path


@final
@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """What a step costs: ``cost`` (h, w) per metre, inf where no robot fits; ``cell`` [m] the side of its cells."""

    cost: FloatArray
    cell: float


def terrain(building: Building, clearance: float = 0.3) -> Terrain:
    """Terrain of a building: closed within ``clearance`` [m] of what is not free, dearer near it."""
    cell = _FACTOR * building.resolution
    height, width = (side // _FACTOR for side in building.grid.shape)
    tiles = building.grid[: height * _FACTOR, : width * _FACTOR].reshape(height, _FACTOR, width, _FACTOR)
    distance = cell * _distance(np.any(tiles != 0, axis=(1, 3)))
    cost = 1.0 + 6.0 * np.maximum(0.0, 0.8 - distance)
    return Terrain(np.where(distance > clearance, cost, np.inf), cell)


def plan(ground: Terrain, start: tuple[float, float], goal: tuple[float, float]) -> FloatArray:
    """Path (K, 2) [m] of about one point per terrain cell from near ``start`` to near ``goal``, smoothed.

    Raises
    ------
    ValueError
        If there is no way.

    """
    cells = _search(ground, _nearest_open(ground, start), _nearest_open(ground, goal))
    points = (np.array(cells, dtype=np.float64) + 0.5) * ground.cell
    half = _SMOOTHING // 2
    padded = np.pad(points, ((half, half), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, k], np.full(_SMOOTHING, 1 / _SMOOTHING), "valid") for k in (0, 1)], axis=-1)


def _distance(blocked: BoolArray) -> FloatArray:
    """Distance in cells between cell centres to the nearest blocked cell, at most ``_REACH``."""
    height, width = blocked.shape
    padded = np.pad(blocked, _REACH, constant_values=True)
    result = np.full(blocked.shape, float(_REACH))
    for dy in range(-_REACH, _REACH + 1):
        for dx in range(-_REACH, _REACH + 1):
            window = padded[_REACH + dy : _REACH + dy + height, _REACH + dx : _REACH + dx + width]
            np.minimum(result, np.hypot(dx, dy), out=result, where=window)
    return result


def _nearest_open(ground: Terrain, point: tuple[float, float]) -> tuple[int, int]:
    """Cell (column, row) open to the robot nearest to a point."""
    rows, columns = np.nonzero(np.isfinite(ground.cost))
    squared = (columns + 0.5 - point[0] / ground.cell) ** 2 + (rows + 0.5 - point[1] / ground.cell) ** 2
    best = int(np.argmin(squared))
    return int(columns[best]), int(rows[best])


def _search(ground: Terrain, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]]:
    """A* over the eight neighbours (Hart, Nilsson and Raphael 1968); ties go to the cell first in reading order."""
    cost = ground.cost.tolist()
    moves = [(dx, dy, float(np.hypot(dx, dy))) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
    best = {start: 0.0}
    parent: dict[tuple[int, int], tuple[int, int]] = {}
    queue = [(0.0, start)]
    done: set[tuple[int, int]] = set()
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            return _trace(parent, goal)
        if here in done:
            continue
        done.add(here)
        for dx, dy, length in moves:
            there = (here[0] + dx, here[1] + dy)
            total = best[here] + length * cost[there[1]][there[0]]  # the rim is never open: no index leaves the grid
            if total < best.get(there, np.inf):
                best[there], parent[there] = total, here
                heapq.heappush(queue, (total + _octile(there, goal), there))
    raise ValueError(f"no way from cell {start} to cell {goal}")


def _octile(a: tuple[int, int], b: tuple[int, int]) -> float:
    across, up = abs(a[0] - b[0]), abs(a[1] - b[1])
    return max(across, up) + (math.sqrt(2.0) - 1.0) * min(across, up)


def _trace(parent: dict[tuple[int, int], tuple[int, int]], goal: tuple[int, int]) -> list[tuple[int, int]]:
    path = [goal]
    while path[-1] in parent:
        path.append(parent[path[-1]])
    return path[::-1]
