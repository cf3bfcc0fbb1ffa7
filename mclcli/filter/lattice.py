"""Regular sets of poses over a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.world.occupancy import OccupancyGrid


def positions(grid: OccupancyGrid, step: float) -> FloatArray:
    """Points (P, 2) [m] of a square lattice in map, ``step`` [m] apart, in free cells; row by row from below."""
    corners = grid.to_map([[0, 0], [grid.width, 0], [grid.width, grid.height], [0, grid.height]])
    low, high = np.ceil(corners.min(axis=0) / step), np.floor(corners.max(axis=0) / step)
    xs, ys = np.arange(low[0], high[0] + 1) * step, np.arange(low[1], high[1] + 1) * step
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    points = points[grid.contains(points)]
    cells = np.floor(grid.to_cells(points)).astype(np.intp)
    return points[grid.free[cells[:, 1], cells[:, 0]]]


def headings(step: float) -> FloatArray:
    """Yaws (Q,) [rad] evenly over (−π, π], at most ``step`` apart, 0 among them."""
    count = max(1, int(np.ceil(se2.TAU / step - 1e-9)))
    return np.sort(se2.wrap(np.arange(count) * (se2.TAU / count)))


def poses(grid: OccupancyGrid, step: float, yaw_step: float) -> FloatArray:
    """Poses (P·Q, 3): every heading at every position, headings varying fastest."""
    points, yaws = positions(grid, step), headings(yaw_step)
    return np.column_stack([np.repeat(points, yaws.size, axis=0), np.tile(yaws, points.shape[0])])
