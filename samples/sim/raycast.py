"""Exact ranges: beams against the cells of a grid, and against people standing about."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray

_BLOCK = 32768  # rays at a time: their working arrays stay in the processor's cache


def cast(
    occupied: BoolArray,
    resolution: float,
    origins: FloatArray,
    angles: FloatArray,
    max_range: float | FloatArray,
) -> FloatArray:
    """Distance [m] from each origin to the border of the first occupied cell; inf beyond ``max_range`` or the grid.

    Parameters
    ----------
    occupied
        (H, W) bool, row 0 at the bottom, cell (0, 0) with its corner at the floor frame's origin.
    resolution
        Side of a cell [m].
    origins, angles
        (M, 2) [m] and (M,) [rad] in the floor frame.
    max_range
        One for all rays or one for each, (M,) [m].

    Raises
    ------
    ValueError
        If an origin is off the grid.

    """
    limits = np.broadcast_to(np.asarray(max_range, dtype=np.float64), angles.shape)
    height, width = occupied.shape
    cells = np.floor(origins / resolution).astype(np.int64)
    if np.any(cells < 0) or np.any(cells >= [width, height]):
        raise ValueError("a ray starts off the grid")
    bordered = np.pad(occupied.astype(np.uint8), 1, constant_values=2)
    blocks = [slice(i, i + _BLOCK) for i in range(0, len(angles), _BLOCK)]
    parts = [_march(bordered, origins[b] / resolution, angles[b], limits[b] / resolution) for b in blocks]
    return resolution * np.concatenate(parts) if parts else np.empty(0)


def _march(cells: NDArray[np.uint8], start: FloatArray, angles: FloatArray, limits: FloatArray) -> FloatArray:
    """Walk all rays from cell border to cell border (Amanatides and Woo 1987), lengths in cells.

    ``cells`` has a border of 2 around it; a ray ends on any cell that is not 0.
    """
    width = cells.shape[1]
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    corner = np.floor(start)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_cell = np.abs(1.0 / direction)  # length between two borders of the same kind
        ahead = np.where(direction > 0, corner + 1.0 - start, start - corner)
        border = np.where(direction == 0, np.inf, ahead * per_cell)
    index = (corner[:, 1].astype(np.int64) + 1) * width + corner[:, 0].astype(np.int64) + 1
    step_x = np.where(direction[:, 0] > 0, 1, -1)
    step_y = np.where(direction[:, 1] > 0, width, -width)
    (next_x, next_y), (delta_x, delta_y) = border.T.copy(), per_cell.T.copy()
    result = np.full(len(angles), np.inf)
    result[cells.ravel()[index] == 1] = 0.0
    alive = np.flatnonzero(result > 0)
    arrays = [a[alive] for a in (index, step_x, step_y, next_x, next_y, delta_x, delta_y, limits)]
    while alive.size:
        index, step_x, step_y, next_x, next_y, delta_x, delta_y, limit = arrays
        sideways = next_x < next_y
        length = np.where(sideways, next_x, next_y)
        index += np.where(sideways, step_x, step_y)
        next_x += np.where(sideways, delta_x, 0.0)
        next_y += np.where(sideways, 0.0, delta_y)
        found = cells.ravel()[index]
        hit = (found == 1) & (length <= limit)
        result[alive[hit]] = length[hit]
        going = (found == 0) & (length <= limit)
        if not going.all():
            alive, arrays = alive[going], [a[going] for a in arrays]
    return result


def cast_circles(origins: FloatArray, angles: FloatArray, centres: FloatArray, radius: float) -> FloatArray:
    """Distance [m] to the nearest of the circles, inf where a ray meets none.

    ``origins`` (M, 2), ``angles`` (M,), ``centres`` (M, P, 2): every ray has its own positions of the P people. A ray
    that starts inside a circle does not see it.
    """
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    offset = centres - origins[:, np.newaxis, :]
    along = np.einsum("mpk,mk->mp", offset, direction)
    across_squared = np.einsum("mpk,mpk->mp", offset, offset) - along**2
    depth = np.sqrt(np.maximum(radius**2 - across_squared, 0.0))
    distance = np.where((across_squared < radius**2) & (along > depth), along - depth, np.inf)
    nearest: FloatArray = np.min(distance, axis=1, initial=np.inf)
    return nearest
