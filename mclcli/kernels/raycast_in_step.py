"""Expected ranges, approximately: many rays walk over open squares in step. See ``mclcli.kernels.raycast``.

What bounds it: the arithmetic of a step, in vectors; the look-ups of different rays need not wait for each other. Most
rays arrive after three steps, the slowest take fifteen, so those that still walk close ranks.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels._bounds import _holds, _within
from mclcli.kernels.raycast import _first_on_map

_BEYOND = 1 / 256  # how far beyond an open square to look; see world/raycast.py
_FLAT = nb.types.Array(nb.uint8, 1, "C", readonly=True)
_ROWS = nb.types.Array(nb.float64, 2, "C", readonly=True)
_LANES = 128  # rays that walk in step; what is known of them stays in the first-level cache
_BELOW_1 = 1.0 - 2.0**-53
_X, _Y, _DX, _DY, _INVERSE_X, _INVERSE_Y, _SKIPPED, _LOOKED = range(0, 8 * _LANES, _LANES)
_SIDE, _COLUMN, _ROW, _CELL, _TURNS, _RESULT, _INDEX = range(8 * _LANES, 15 * _LANES, _LANES)


@nb.njit(**OPTIONS)
def _start(pose, rays, first, count, lanes, at, width, height):  # type: ignore[no-untyped-def]
    """Put rays of a pose into lanes from ``at`` on, in the frame of the padded map; how many begin off the map."""
    base_x, base_y, c, s = pose[0] + 1.0, pose[1] + 1.0, pose[2], pose[3]
    right, top, outside = width + 1.0, height + 1.0, 0
    start_x, start_y, along, across = rays[0, first:], rays[1, first:], rays[2, first:], rays[3, first:]
    to = lanes[at:]
    for i in range(count):
        x, y = base_x + (c * start_x[i] - s * start_y[i]), base_y + (s * start_x[i] + c * start_y[i])
        dx, dy = c * along[i] - s * across[i], s * along[i] + c * across[i]
        dx, dy = dx if abs(dx) > 1e-9 else 0.0, dy if abs(dy) > 1e-9 else 0.0
        to[_X + i], to[_Y + i], to[_DX + i], to[_DY + i], to[_SKIPPED + i] = x, y, dx, dy, 0.0
        outside += not ((x >= 1.0) & (x < right) & (y >= 1.0) & (y < top))
    return outside


@nb.njit(**OPTIONS)
def _enter(lanes, size, limit, width, height):  # type: ignore[no-untyped-def]
    """Move the begin of rays from off the map to where they enter it, those that never do to a corner of its border."""
    for i in range(size):
        x, y, dx, dy = lanes[_X + i], lanes[_Y + i], lanes[_DX + i], lanes[_DY + i]
        if not (1.0 <= x < width + 1.0 and 1.0 <= y < height + 1.0):
            skipped = _first_on_map(x, y, dx, dy, width, height)
            enters = skipped < limit
            lanes[_SKIPPED + i] = skipped if enters else 0.0
            lanes[_X + i] = _within(x + skipped * dx, 1.0, (width + 1.0) * _BELOW_1) if enters else 0.0
            lanes[_Y + i] = _within(y + skipped * dy, 1.0, (height + 1.0) * _BELOW_1) if enters else 0.0


@nb.njit(**OPTIONS)
def _begin(lanes, size, limit, width, height):  # type: ignore[no-untyped-def]
    """Cells where the rays begin, and their ranges if those are blocked or off the map."""
    for i in range(size):
        dx, dy, column, row = lanes[_DX + i], lanes[_DY + i], np.floor(lanes[_X + i]), np.floor(lanes[_Y + i])
        lanes[_INVERSE_X + i] = 1.0 / dx if dx != 0.0 else math.inf
        lanes[_INVERSE_Y + i] = 1.0 / dy if dy != 0.0 else math.inf
        cells = (width + 2.0) * (height + 2.0)
        table = (cells if dx >= 0.0 else 0.0) + (2.0 * cells if dy >= 0.0 else 0.0)
        lanes[_LOOKED + i], lanes[_COLUMN + i], lanes[_ROW + i], lanes[_INDEX + i] = 0.0, column, row, i
        on_map = (column >= 1.0) & (column <= width) & (row >= 1.0) & (row <= height)
        lanes[_CELL + i] = table + row * (width + 2.0) + column if on_map else 0.0
        lanes[_RESULT + i] = lanes[_SKIPPED + i] if on_map else limit


@nb.njit(**OPTIONS)
def _look_up(flat, lanes, size):  # type: ignore[no-untyped-def]
    """Sides of the open squares in the lanes' cells; how many are not 0."""
    alive = 0
    for i in range(size):
        side = flat[nb.int64(lanes[_CELL + i])]
        lanes[_SIDE + i] = nb.float64(side)
        alive += side > 0
    return alive


@nb.njit(**OPTIONS)
def _step(lanes, size, limit, width, height):  # type: ignore[no-untyped-def]
    """Each lane on to a little beyond its open square, to cell 0 if it has arrived; how many go past a corner."""
    corners, pitch = 0, width + 2.0
    cells = pitch * (height + 2.0)
    for i in range(size):
        x, y, dx, dy, side = lanes[_X + i], lanes[_Y + i], lanes[_DX + i], lanes[_DY + i], lanes[_SIDE + i]
        right, up, looked = dx >= 0.0, dy >= 0.0, lanes[_LOOKED + i]
        beyond_x = lanes[_COLUMN + i] + (side if right else -side)
        beyond_y = lanes[_ROW + i] + (side if up else -side)
        to_x = (beyond_x - (x if right else x - 1.0)) * lanes[_INVERSE_X + i]
        to_y = (beyond_y - (y if up else y - 1.0)) * lanes[_INVERSE_Y + i]
        r = max(min(to_x, to_y), looked)
        walks, in_all = side > 0.0, lanes[_SKIPPED + i] + r
        goes_on = walks & (in_all < limit)
        looked = r + _BEYOND if goes_on else looked
        column, row = np.floor(x + looked * dx), np.floor(y + looked * dy)
        on_map = (column >= 1.0) & (column <= width) & (row >= 1.0) & (row <= height)
        turns = goes_on & on_map & (column == beyond_x) & (row == beyond_y)
        result = in_all if on_map & (in_all < limit) else limit
        table = (cells if right else 0.0) + (2.0 * cells if up else 0.0)
        lanes[_LOOKED + i], lanes[_COLUMN + i], lanes[_ROW + i] = looked, column, row
        lanes[_CELL + i] = table + row * pitch + column if goes_on & on_map else 0.0
        lanes[_RESULT + i] = result if walks else lanes[_RESULT + i]
        lanes[_TURNS + i] = 1.0 if turns else 0.0
        corners += turns
    return corners


@nb.njit(**OPTIONS)
def _stop_at_corners(flat, lanes, size, pitch):  # type: ignore[no-untyped-def]
    """Stop the lanes that have passed a corner between two blocked cells; how many."""
    stopped = 0
    for i in range(size):
        if lanes[_TURNS + i] > 0.0 and lanes[_SIDE + i] > 0.0:
            right, up = 1 if lanes[_DX + i] >= 0.0 else -1, 1 if lanes[_DY + i] >= 0.0 else -1
            cell = nb.int64(lanes[_CELL + i])
            if flat[cell - up * pitch] == 0 and flat[cell - right] == 0:
                lanes[_SIDE + i] = 0.0
                stopped += 1
    return stopped


@nb.njit(**OPTIONS)
def _close_ranks(lanes, size, results):  # type: ignore[no-untyped-def]
    """Write down the results so far and move the lanes that still walk together; how many, rounded up to 8."""
    kept = 0
    for i in range(size):
        results[nb.int64(lanes[_INDEX + i])] = lanes[_RESULT + i]
        lanes[_X + kept], lanes[_Y + kept], lanes[_DX + kept] = lanes[_X + i], lanes[_Y + i], lanes[_DX + i]
        lanes[_DY + kept], lanes[_SKIPPED + kept] = lanes[_DY + i], lanes[_SKIPPED + i]
        lanes[_INVERSE_X + kept], lanes[_INVERSE_Y + kept] = lanes[_INVERSE_X + i], lanes[_INVERSE_Y + i]
        lanes[_LOOKED + kept], lanes[_SIDE + kept] = lanes[_LOOKED + i], lanes[_SIDE + i]
        lanes[_COLUMN + kept], lanes[_ROW + kept] = lanes[_COLUMN + i], lanes[_ROW + i]
        lanes[_RESULT + kept], lanes[_INDEX + kept] = lanes[_RESULT + i], lanes[_INDEX + i]
        kept += lanes[_SIDE + kept] > 0.0
    full = min((kept + 7) // 8 * 8, size)
    lanes[_SIDE + kept : _SIDE + full] = 0.0
    for i in range(kept, full):
        lanes[_INDEX + i] = _LANES
    return full


@nb.njit(**OPTIONS)
def _walk(flat, lanes, size, limit, width, height, results):  # type: ignore[no-untyped-def]
    """Cast the rays in the lanes; ``results`` has room for one more, which nobody reads."""
    wide, high = nb.float64(width), nb.float64(height)
    _begin(lanes, size, limit, wide, high)
    alive = _look_up(flat, lanes, size)
    while alive > 0:
        if 2 * alive <= size and size > 8:
            size = _close_ranks(lanes, size, results)
        corners = _step(lanes, size, limit, wide, high)
        alive = _look_up(flat, lanes, size)
        if corners > 0:
            alive -= _stop_at_corners(flat, lanes, size, width + 2)
    for i in range(size):
        results[nb.int64(lanes[_INDEX + i])] = lanes[_RESULT + i]


_SCRATCH = nb.float64[::1]


@nb.njit([nb.void(_FLAT, nb.int64, nb.int64, _ROWS, _ROWS, nb.float64, _SCRATCH, _SCRATCH, _SCRATCH)], **OPTIONS)
def approximate(flat, height, width, poses, rays, limit, out, lanes, results):  # type: ignore[no-untyped-def]
    """From open square to open square, looking only a little beyond each: shorter cuts through a corner are missed.

    Where that is past a corner between two blocked cells, it stops, so walls that hold together by corners hold.
    Many rays walk in step: a look-up of one need not wait for another's, and the arithmetic is done in vectors. When
    half of them have arrived, the others close ranks. ``flat`` holds the open squares (4, H + 2, W + 2) of a map of
    ``height`` H and ``width`` W, one after another; ``rays`` is (4, B), ``out`` (N·B,). Scratch: ``lanes`` (15·128,),
    ``results`` (129,).
    """
    count = rays.shape[1]
    if not (0 < height < flat.size and 0 < width < flat.size and _holds(flat.size // 4, height + 2, width + 2)):
        return
    if flat[0] != 0:
        return  # where nothing is on the map, rays would not arrive
    for begin in range(0, poses.shape[0] * count, _LANES):
        size, outside, at = min(_LANES, poses.shape[0] * count - begin), 0, 0
        while at < size:
            n, first = (begin + at) // count, (begin + at) % count
            some = min(size - at, count - first)
            outside += _start(poses[n], rays, first, some, lanes, at, width, height)
            at += some
        if outside > 0:
            _enter(lanes, size, limit, width, height)
        _walk(flat, lanes, size, limit, width, height, results)
        for i in range(size):
            out[begin + i] = results[i]
        if outside > 0:
            for i in range(size):
                pose = poses[(begin + i) // count]
                if not (math.isfinite(pose[0] + pose[2]) and math.isfinite(pose[1])):
                    out[begin + i] = math.nan
