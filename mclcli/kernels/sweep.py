"""Bounds of whole rows of nodes at once: which blocks of 8 × 8 places, for every angle, may hold a pose that counts.

A bound is a cost in whole steps below a perfect fit; sums of whole numbers are the same in any order, so that 32 nodes
side by side are one addition of vectors a beam. For that a plane of costs is dealt out by columns: of eight columns the
first of all, then the second of all, … Nodes lie eight entries apart, and so side by side in it.

A plane is what one level costs: ``starts`` (G, B) int32 say where every beam of a group of angles finds the cost of
node (0, 0); node (r, c) lies 8·r·``width`` + c further on.
"""

from __future__ import annotations

import numba as nb

from mclcli.kernels import OPTIONS
from mclcli.kernels._bounds import _FAR, _extremes, _is_level, _reaches
from mclcli.kernels._vectors import LANES, add_rows

_LOOK = 8  # beams between two looks at whether any node of a row can still count
_SIDE = 4  # rows, columns and angles of fine nodes in a coarse one


def _readonly(kind: nb.types.Type, dimensions: int) -> nb.types.Type:
    return nb.types.Array(kind, dimensions, "C", readonly=True)


_BYTES, _SHAPE, _STARTS = _readonly(nb.uint8, 1), _readonly(nb.int64, 1), _readonly(nb.int32, 2)
_COUNTS, _WEIGHTS = _readonly(nb.int32, 2), _readonly(nb.float64, 1)
_SUMS = nb.uint16[::1]


@nb.njit([nb.void(_BYTES, _SHAPE, _BYTES, nb.int64, nb.int64, nb.uint8[:, :, ::1])], **OPTIONS)
def deal(pool, shape, cost, low, left, plane):  # type: ignore[no-untyped-def]
    """Fill ``plane`` (8, H, W): entry (k, r, c) has the cost of window (low + r, left + 8·c + k) of a level.

    ``shape`` (5,) says where the level lies in ``pool`` (see ``mclcli.world.pyramid``); ``cost`` (256,) is by bin.
    """
    start, height, width, margin = shape[0], shape[1], shape[2], shape[4]
    if cost.size < 256 or not (-_FAR < low < _FAR and -_FAR < left < _FAR and _is_level(shape, pool.size)):
        return
    for row in range(plane.shape[1]):
        y = row + low + margin
        inside = (y >= 0) & (y < height)
        for k in range(8):
            for column in range(plane.shape[2]):
                x = left + 8 * column + k + margin
                plane[k, row, column] = cost[pool[start + y * width + x] if inside & (x >= 0) & (x < width) else 255]


@nb.njit(**OPTIONS)
def _bound_row(cells, starts, at, stop, extremes, sums):  # type: ignore[no-untyped-def]
    """Costs of 32 nodes into ``sums``; False, and no further, once all of them are above ``stop``."""
    if not _reaches(cells.size, at, extremes[0], extremes[1], LANES):
        return False
    for lane in range(LANES):
        sums[lane] = 0
    beams = starts.size
    for first in range(0, beams, _LOOK):
        if add_rows(cells, starts, first, min(first + _LOOK, beams), at, 0, sums) > stop:
            return False
    return True


@nb.njit(**OPTIONS)
def _take_row(sums, counts, row, column, angle, limit, weights, out, costs, state, mass):  # type: ignore[no-untyped-def]
    """Write the nodes of a row whose cost is within ``limit``; add what the others weigh to ``mass``."""
    for lane in range(min(LANES, counts.shape[1] - column)):
        cost, many = sums[lane], counts[row, column + lane]
        if many == 0:
            continue
        if cost <= limit:
            n = state[3]
            out[n, 0], out[n, 1], out[n, 2], costs[n] = angle, row, column + lane, cost
            state[3] = n + 1
        elif cost < weights.size:
            mass[0] += many * weights[cost]


@nb.njit(**OPTIONS)
def _any_place(counts, row, column):  # type: ignore[no-untyped-def]
    """Whether any of 32 nodes holds an allowed place."""
    total = 0
    for lane in range(min(LANES, counts.shape[1] - column)):
        total += counts[row, column + lane]
    return total > 0


@nb.njit(**OPTIONS)
def _alive(sums, counts, row, column, first, stop):  # type: ignore[no-untyped-def]
    """Whether any of the eight coarse nodes above 32 fine ones counts; they are lanes from ``first`` on."""
    for lane in range(first, min(first + LANES // _SIDE, counts.shape[1] - column)):
        if sums[lane] <= stop and counts[row, column + lane] > 0:
            return True
    return False


@nb.njit(
    [
        nb.void(
            *(_BYTES, nb.int64, _STARTS, _COUNTS) * 2, nb.int64, nb.int64, _WEIGHTS,
            nb.int32[:, ::1], nb.int32[::1], nb.int64[::1], nb.float64[::1], _SUMS, _SUMS,
        )
    ],
    **OPTIONS,
)  # fmt: skip
def sweep(  # type: ignore[no-untyped-def]
    coarse, coarse_width, coarse_starts, coarse_counts, fine, fine_width, fine_starts, fine_counts,
    limit, stop, weights, out, costs, state, mass, above, sums,
):  # fmt: skip
    """Write fine nodes that cost at most ``limit`` to ``out`` (N, 3), angle, row and column, and ``costs`` (N,).

    Nodes that cost more than ``stop`` are not looked at further; those between add places × ``weights`` of their cost
    to ``mass`` (1,). ``coarse_counts`` and ``fine_counts`` are the places allowed in every node. ``state`` (4,) says
    where to begin: row and column of coarse nodes, and group of angles; its last entry counts what was written. Where
    ``out`` is full it says where to go on; at the end the row is past the last. ``above`` and ``sums`` (32,) are
    scratch.
    """
    room = min(out.shape[0], costs.size) - _SIDE * _SIDE * 4 * LANES
    coarse_extremes, fine_extremes = _extremes(coarse_starts), _extremes(fine_starts)
    if min(state[0], state[1], state[2], state[3]) < 0 or state[1] > coarse_counts.shape[1]:
        return
    if not (0 <= coarse_width <= coarse.size and 0 <= fine_width <= fine.size):
        return
    while state[0] < coarse_counts.shape[0]:
        row, column = state[0], state[1]
        if not _any_place(coarse_counts, row, column):
            state[2] = coarse_starts.shape[0]
        while state[2] < coarse_starts.shape[0]:
            if state[3] > room:
                return
            group = state[2]
            state[2] += 1
            at = 8 * row * coarse_width + column
            if not _bound_row(coarse, coarse_starts[group], at, stop, coarse_extremes, above):
                continue
            for quarter in range(4):
                first = _SIDE * column + quarter * LANES
                if not _alive(above, coarse_counts, row, column, quarter * LANES // _SIDE, stop):
                    continue
                for y in range(_SIDE * row, min(_SIDE * row + _SIDE, fine_counts.shape[0])):
                    if not _any_place(fine_counts, y, first):
                        continue
                    for angle in range(_SIDE * group, min(_SIDE * group + _SIDE, fine_starts.shape[0])):
                        at = 8 * y * fine_width + first
                        if _bound_row(fine, fine_starts[angle], at, stop, fine_extremes, sums):
                            _take_row(sums, fine_counts, y, first, angle, limit, weights, out, costs, state, mass)
        state[2] = 0
        state[1] = column + LANES
        if state[1] >= coarse_counts.shape[1]:
            state[0], state[1] = row + 1, 0
