"""Loops over particles: moving, choosing ancestors, bins and moments.

Each has its formula in NumPy beside its caller. What adds up does so in the particles' order, whatever calls it.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels.trigonometry import _cos_sin, _wrap

_ROW = nb.types.Array(nb.float64, 1, "C", readonly=True)
_POSES = nb.types.Array(nb.float64, 2, "C", readonly=True)
_BINS = nb.types.Array(nb.int64, 2, "C", readonly=True)
_NUMBERS = nb.types.Array(nb.int64, 1, "C", readonly=True)
_BLOCK = 512
_FAR = 2.0**62  # bins
_NOWHERE = -(2**63)


@nb.njit([nb.void(_ROW, _ROW, nb.int64[::1])], **OPTIONS)
def ancestors(cumulative, pointers, out):  # type: ignore[no-untyped-def]
    """Index of the first entry of ``cumulative`` (N,) greater than each of the ascending ``pointers`` (n,), by merging.

    Where none is greater, that of the last one.
    """
    i, last = 0, cumulative.size - 1
    greatest = cumulative[last] if last >= 0 else -np.inf
    for n in range(pointers.size):
        if pointers[n] < greatest:  # which ends the search
            while cumulative[i] <= pointers[n]:
                i += 1
        elif pointers[n] >= greatest:
            i = max(last, 0)
        out[n] = i


@nb.njit([nb.void(_POSES, _POSES, _ROW, _ROW, nb.float64[:, ::1], nb.float64[:, ::1])], **OPTIONS)
def turn_move_turn(poses, normals, motion, std, out, scratch):  # type: ignore[no-untyped-def]
    """Move ``poses`` (N, 3) by a turn, a move and a turn, ``motion`` (3,) + ``std`` (3,) · ``normals`` (N, 3).

    Scratch: (3, 512).
    """
    for start in range(0, poses.shape[0], _BLOCK):
        size = min(_BLOCK, poses.shape[0] - start)
        heading, cos, sin = scratch[0, :size], scratch[1, :size], scratch[2, :size]
        for i in range(size):
            heading[i] = poses[start + i, 2] + (motion[0] + normals[start + i, 0] * std[0])
        _cos_sin(heading, cos, sin)
        for i in range(size):
            n = start + i
            move, turn = motion[1] + normals[n, 1] * std[1], motion[2] + normals[n, 2] * std[2]
            out[n, 0] = poses[n, 0] + move * cos[i]
            out[n, 1] = poses[n, 1] + move * sin[i]
            out[n, 2] = _wrap(heading[i] + turn)


@nb.njit(**OPTIONS)
def _bin(coordinate, side):  # type: ignore[no-untyped-def]
    """Number of the bin; the least there is for what has none."""
    number = np.floor(coordinate / side)
    return np.int64(number) if abs(number) < _FAR else np.int64(_NOWHERE)


@nb.njit([nb.void(_POSES, nb.float64, nb.float64, nb.int64, nb.int64[:, ::1])], **OPTIONS)
def bins(poses, side, turn, yaw_bins, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (N, 3) with the bins of poses; with ``yaw_bins`` > 0 those of wrapped yaw, π taken for −π."""
    for n in range(poses.shape[0]):
        out[n, 0] = _bin(poses[n, 0], side)
        out[n, 1] = _bin(poses[n, 1], side)
        if yaw_bins > 0:
            yaw = _bin(_wrap(poses[n, 2]), turn)
            out[n, 2] = -(yaw_bins // 2) if 2 * yaw == yaw_bins else yaw
        else:
            out[n, 2] = _bin(poses[n, 2], turn)


@nb.njit([nb.void(_BINS, nb.int64[::1])], **OPTIONS)
def widths(bins, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (3,) with the greatest less the least of each column of ``bins`` (N, 3), N ≥ 1."""
    for k in range(3):
        least = greatest = bins[0, k]
        for n in range(1, bins.shape[0]):
            least, greatest = min(least, bins[n, k]), max(greatest, bins[n, k])
        out[k] = greatest - least


@nb.njit(**OPTIONS)
def _slot(x, y, yaw, size):  # type: ignore[no-untyped-def]
    """Where to look for a bin in a table of 2^k places: odd multipliers spread neighbours (Knuth, TAOCP 6.4)."""
    mixed = nb.uint64(x) * nb.uint64(0x9E3779B97F4A7C15) ^ nb.uint64(y) * nb.uint64(0xC2B2AE3D27D4EB4F)
    mixed = (mixed ^ nb.uint64(yaw) * nb.uint64(0x165667B19E3779F9)) * nb.uint64(0x9E3779B97F4A7C15)
    return nb.int64(mixed >> nb.uint64(32)) & (size - 1)


@nb.njit(**OPTIONS)
def _find(bins, first, table, x, y, yaw):  # type: ignore[no-untyped-def]
    """Place in the table that holds a bin's number, or is free for it."""
    slot = _slot(x, y, yaw, table.size)
    while table[slot] >= 0:
        n = first[table[slot]]
        if bins[n, 0] == x and bins[n, 1] == y and bins[n, 2] == yaw:
            break
        slot = (slot + 1) & (table.size - 1)
    return slot


@nb.njit(**OPTIONS)
def _is_power_of_two(size):  # type: ignore[no-untyped-def]
    return size > 0 and size & (size - 1) == 0


@nb.njit(**OPTIONS)
def _can_be_looked_into(bins, first, table):  # type: ignore[no-untyped-def]
    """Whether every number in the table is a bin's, every bin has a row, and there is a free place to end at."""
    least, greatest = nb.int64(0), nb.int64(-1)
    for slot in range(table.size):
        least, greatest = min(least, table[slot]), max(greatest, table[slot])
    if not (_is_power_of_two(table.size) and least < 0 and greatest < first.size):
        return False
    least, greatest = nb.int64(0), nb.int64(-1)
    for k in range(first.size):
        least, greatest = min(least, first[k]), max(greatest, first[k])
    return least >= 0 and greatest < bins.shape[0]


@nb.njit([nb.void(_BINS, nb.int64[::1], nb.int64[::1], nb.int64[::1], nb.int64[::1])], **OPTIONS)
def number_bins(bins, number, first, count, table):  # type: ignore[no-untyped-def]
    """Number the distinct rows of ``bins`` (N, 3) as they first appear.

    Fills ``number`` (N,), ``first`` (N,) up to ``count[0]``: the row where each appears first; and ``table``
    (2^k ≥ 2·N,), which ``_find`` looks into.
    """
    found, table[:] = 0, -1
    count[0] = 0
    if not _is_power_of_two(table.size) or table.size <= bins.shape[0] or first.size < bins.shape[0]:
        return
    for n in range(bins.shape[0]):
        slot = _find(bins, first, table, bins[n, 0], bins[n, 1], bins[n, 2])
        if table[slot] < 0:
            table[slot] = found
            first[found] = n
            found += 1
        number[n] = table[slot]
    count[0] = found


@nb.njit(**OPTIONS)
def _root(root, node):  # type: ignore[no-untyped-def]
    """Least member of a node's component, with the way there halved (Tarjan and van Leeuwen 1984)."""
    while root[node] != node:
        root[node] = root[root[node]]
        node = root[node]
    return node


@nb.njit([nb.void(_BINS, nb.int64[::1], nb.int64[::1], nb.int64, nb.int64[::1])], **OPTIONS)
def join_neighbours(bins, first, table, yaw_bins, root):  # type: ignore[no-untyped-def]
    """Fill ``root`` (C,) with the least number of a bin connected to each of the C bins that ``number_bins`` found.

    Bins are connected if they touch at a face, an edge or a corner; with ``yaw_bins`` > 0 also across the half turn,
    from yaw ``yaw_bins``/2 − 1 to −``yaw_bins``/2.
    """
    for bin_ in range(root.size):
        root[bin_] = bin_
    if root.size > first.size or not _can_be_looked_into(bins, first, table):
        return
    for bin_ in range(root.size):
        n = first[bin_]
        for k in range(14, 27):  # the half of them that comes after the bin itself; it is the others' other half
            x, y, yaw = bins[n, 0] + k // 9 - 1, bins[n, 1] + k // 3 % 3 - 1, bins[n, 2] + k % 3 - 1
            if yaw_bins > 0 and not -yaw_bins <= 2 * yaw < yaw_bins:
                yaw += yaw_bins if yaw < 0 else -yaw_bins
            other = table[_find(bins, first, table, x, y, yaw)]
            if 0 <= other < root.size:
                one, other = _root(root, bin_), _root(root, other)
                root[max(one, other)] = min(one, other)
    for bin_ in range(root.size):
        root[bin_] = _root(root, bin_)


@nb.njit([nb.void(_POSES, _NUMBERS, _ROW, nb.float64[:, ::1], nb.float64[:, ::1])], **OPTIONS)
def mean_sums_by_label(poses, labels, share, sums, scratch):  # type: ignore[no-untyped-def]
    """Add to ``sums`` (C, 4) each label's Σ share of x, y, cos yaw, sin yaw. Scratch: (3, 512)."""
    for start in range(0, poses.shape[0], _BLOCK):
        size = min(_BLOCK, poses.shape[0] - start)
        yaw, cos, sin = scratch[0, :size], scratch[1, :size], scratch[2, :size]
        for i in range(size):
            yaw[i] = poses[start + i, 2]
        _cos_sin(yaw, cos, sin)
        for i in range(size):
            n = start + i
            if not 0 <= labels[n] < sums.shape[0]:
                continue
            w, to = share[n], sums[labels[n]]
            to[0] += w * poses[n, 0]
            to[1] += w * poses[n, 1]
            to[2] += w * cos[i]
            to[3] += w * sin[i]


@nb.njit([nb.void(_POSES, _NUMBERS, _ROW, _POSES, nb.float64[:, :, ::1])], **OPTIONS)
def covariance_sums_by_label(poses, labels, share, means, sums):  # type: ignore[no-untyped-def]
    """Add to the lower triangles of ``sums`` (C, 3, 3) each label's Σ share r rᵀ of r from ``means`` (C, 3)."""
    count = min(sums.shape[0], means.shape[0])
    for n in range(poses.shape[0]):
        if not 0 <= labels[n] < count:
            continue
        to, mean = sums[labels[n]], means[labels[n]]
        x, y, t = poses[n, 0] - mean[0], poses[n, 1] - mean[1], _wrap(poses[n, 2] - mean[2])
        wx, wy, wt = share[n] * x, share[n] * y, share[n] * t
        to[0, 0] += wx * x
        to[1, 0] += wy * x
        to[1, 1] += wy * y
        to[2, 0] += wt * x
        to[2, 1] += wt * y
        to[2, 2] += wt * t
