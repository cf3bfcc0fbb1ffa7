"""Poses in the nodes that a sweep has left: 8 × 8 places at one angle, first as a block of costs, then one by one.

The value of a pose adds what the field has, beam by beam and in their order, in floating point; its cost only says
which poses are worth that. Source: Hess et al. 2016, *Real-Time Loop Closure in 2D LIDAR SLAM*, section V, for the
search; costs and blocks are ours.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels._bounds import _FAR, _extremes, _is_level, _reaches, _whole
from mclcli.kernels._vectors import SIDE, add_blocks

_FURTHER = 6.0  # tempered nats by which blocks are followed beyond what is sought
_LOOK = 8  # beams between two looks at whether any pose of a block can still count


def _readonly(kind: nb.types.Type, dimensions: int) -> nb.types.Type:
    return nb.types.Array(kind, dimensions, "C", readonly=True)


_BYTES, _REAL, _REALS = _readonly(nb.uint8, 1), _readonly(nb.float64, 1), _readonly(nb.float64, 2)


def _spread_signature(code: nb.types.Type) -> object:
    return nb.void(_readonly(code, 2), _BYTES, nb.int64, nb.int64, nb.uint8[:, ::1])


@nb.njit([_spread_signature(nb.uint16), _spread_signature(nb.uint32)], **OPTIONS)
def spread(codes, cost, low, left, plane):  # type: ignore[no-untyped-def]
    """Fill ``plane`` (H, W): entry (r, c) has the cost of cell (low + r, left + c), off the map the last cost."""
    height, width = codes.shape
    last = nb.int64(cost.size - 1)
    if last < 0 or not (-_FAR < low < _FAR and -_FAR < left < _FAR):
        return
    begin = min(max(-left, 0), plane.shape[1])  # of the columns on the map
    end = max(min(width - left, plane.shape[1]), begin)
    for row in range(plane.shape[0]):
        y, line = row + low, plane[row]
        if 0 <= y < height:
            line[:begin], line[end:] = cost[last], cost[last]
            some = codes[y, begin + left :]
            for i in range(end - begin):
                line[begin + i] = cost[min(nb.int64(some[i]), last)]
        else:
            line[:] = cost[last]


@nb.njit(**OPTIONS)
def _cost_block(cells, starts, at, stride, stop, sums):  # type: ignore[no-untyped-def]
    """Costs of 8 × 8 poses into ``sums`` (64,); False, and no further, once all of them are above ``stop``."""
    for lane in range(SIDE * SIDE):
        sums[lane] = 0
    beams = starts.size
    for first in range(0, beams, _LOOK):
        if add_blocks(cells, starts, first, min(first + _LOOK, beams), at, stride, sums) > stop:
            return False
    return True


@nb.njit(**OPTIONS)
def _affordable(perfect, step, value):  # type: ignore[no-untyped-def]
    """The highest cost whose bound is not below ``value``, as ``CostTables.within``."""
    return _whole(np.floor((perfect - value) / step), -1.0, 65535.0)


@nb.njit(**OPTIONS)
def _mass_of_row(sums, counts, limit, weights):  # type: ignore[no-untyped-def]
    """What the poses of a row weigh that cost more than ``limit``."""
    mass = 0.0
    for x in range(counts.size):
        cost = sums[x]
        mass += weights[cost] if (cost > limit) & (cost < weights.size) & (counts[x] > 0) else 0.0
    return mass


@nb.njit(**OPTIONS)
def _bound(pool, shape, ends, row, column, table):  # type: ignore[no-untyped-def]
    """Bound of a node in floating point, added as its leaves are: what ties with it is known to the last bit."""
    start, height, width, margin = shape[0], shape[1], shape[2], shape[4]
    total = 0.0
    for i in range(ends.shape[0]):
        y, x = row + ends[i, 0] + margin, column + ends[i, 1] + margin
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        total += table[pool[start + y * width + x] if inside else 255]
    return total


@nb.njit(**OPTIONS)
def _value(codes, ends, row, column, log_p):  # type: ignore[no-untyped-def]
    """Value of a pose: the sum over beams, in their order, of what the cell has that each ends in."""
    height, width = codes.shape
    last = nb.int64(log_p.size - 1)
    total, off = 0.0, log_p[last]
    for i in range(ends.shape[0]):
        y, x = row + ends[i, 0], column + ends[i, 1]
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        total += log_p[min(nb.int64(codes[y, x]), last)] if inside else off
    return total


@nb.njit(**OPTIONS)
def _sightings(marks, law, row, column, yaw):  # type: ignore[no-untyped-def]
    """Log-likelihood of bearings; ``marks`` (M, 5) hold the landmark, the bearing and the camera on the base."""
    c, s = math.cos(yaw), math.sin(yaw)
    total = 0.0
    for m in range(marks.shape[0]):
        x = column + 0.5 + (c * marks[m, 3] - s * marks[m, 4])
        y = row + 0.5 + (s * marks[m, 3] + c * marks[m, 4])
        error = marks[m, 2] - (math.atan2(marks[m, 1] - y, marks[m, 0] - x) - yaw)
        error -= 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
        total += math.log(max(law[0] * math.exp(law[1] * error * error) + law[2], law[3]))
    return total


@nb.njit(**OPTIONS)
def _take(key, value, slack, alpha, keys, values, whole, real):  # type: ignore[no-untyped-def]
    """Look at a pose: is it the best, is it to be written? False if there is no room for it."""
    if alpha == 0.0:
        if value > real[0] or (value == real[0] and key < whole[0]):
            real[0], whole[0] = value, key
    elif value >= real[0] - slack:
        if not 0 <= whole[1] < min(keys.size, values.size):
            return False
        keys[whole[1]], values[whole[1]] = key, value
        whole[1] += 1
    else:
        real[1] += math.exp(alpha * (value - real[0]))
    return True


def _signature(code: nb.types.Type) -> object:
    real, whole = nb.float64, nb.int64
    plane = (_BYTES, whole, _readonly(nb.int32, 2), real, real, _BYTES, _readonly(whole, 1), _REAL)
    world = (_readonly(code, 2), _readonly(nb.int32, 3), _readonly(nb.int32, 2), _REAL, _REALS, _REAL, _REAL)
    task = (_readonly(nb.int32, 2), _readonly(nb.int32, 1), real, real, _REAL)
    return nb.void(*plane, *world, *task, whole[::1], real[::1], whole[::1], real[::1], nb.uint16[::1])


@nb.njit([_signature(nb.uint16), _signature(nb.uint32)], **OPTIONS)
def look(  # type: ignore[no-untyped-def]
    cells, stride, starts, perfect, step, pool, shape, table, codes, ends, counts, log_p, marks, law, angles,
    nodes, costs, slack, alpha, weights, keys, values, whole, real, sums,
):  # fmt: skip
    """Look at the allowed poses of ``nodes`` (N, 3), angle, row and column, in order of their ``costs`` (N,).

    ``whole`` (2,) holds the key of the best pose so far, and how many were written; ``real`` (2,) its value, and the
    mass of poses left out, Σ exp(alpha·(value − best)), at most. Without ``alpha`` the best pose is sought, and of
    equals that of the least key, (angle·H + row)·W + column. With it all poses within ``slack`` of the best are written
    to ``keys`` and ``values``, −1 of them if there is no room; those that cost too much weigh ``weights`` of their
    cost, or nothing beyond these. A cost c stands for the bound ``perfect − step·c``; bearings add at most ``law[4]``.
    ``pool``, ``shape`` (5,) and ``table`` (256,) give a node's bound to the bit: nodes that can but tie with a pose of
    a lesser key are left out. ``counts`` (H, W) are 1 where the base may be; ``sums`` (64,) is scratch.
    """
    height, width = codes.shape
    if log_p.size == 0 or counts.shape != codes.shape or table.size < 256:
        return
    if not (0 <= stride <= cells.size and _is_level(shape, pool.size)):
        return
    limit = _affordable(perfect, step, real[0] - slack - law[4])
    # Blocks that cost more than this throughout weigh as if they cost no more.
    stop = limit + _whole(np.floor(_FURTHER / (alpha * step)), 0.0, 65535.0) if alpha > 0.0 else limit
    most = weights[max(min(stop, weights.size - 1), 0)] if alpha > 0.0 and weights.size > 0 else 0.0
    mass, angle_count = 0.0, min(ends.shape[0], starts.shape[0], angles.size)
    few = nodes.shape[0] < angle_count or alpha == 0.0  # hardly any node is looked at then
    low, high = _extremes(starts[:0] if few else starts)
    for n in range(nodes.shape[0]):
        t, top, left = nodes[n, 0], SIDE * nb.int64(nodes[n, 1]), SIDE * nb.int64(nodes[n, 2])
        rows, columns = min(SIDE, height - top), min(SIDE, width - left)
        if not (0 <= t < angle_count and top >= 0 and rows > 0 and left >= 0 and columns > 0):
            continue
        if alpha == 0.0:
            if costs[n] > limit:
                break
            bound = _bound(pool, shape, ends[t], top, left, table) + law[4]
            if bound < real[0] or (bound == real[0] and (t * height + top) * width + left > whole[0]):
                continue
        if few:
            low, high = _extremes(starts[t : t + 1])
        if not _reaches(cells.size, top * stride + left, low, high, (SIDE - 1) * stride + SIDE):
            continue
        if not _cost_block(cells, starts[t], top * stride + left, stride, stop, sums):
            mass += rows * columns * most
            continue
        for y in range(rows):
            mass += _mass_of_row(sums[SIDE * y :], counts[top + y, left : left + columns], limit, weights)
            for x in range(columns):
                if sums[SIDE * y + x] > limit or counts[top + y, left + x] == 0:
                    continue
                row, column = top + y, left + x
                value = _value(codes, ends[t], row, column, log_p) + _sightings(marks, law, row, column, angles[t])
                if not _take((t * height + row) * width + column, value, slack, alpha, keys, values, whole, real):
                    whole[1] = -1
                    return
                if alpha == 0.0:
                    stop = limit = _affordable(perfect, step, real[0] - law[4])
    real[1] += mass
