"""Sums and moments in NumPy's own order of summing, which the NumPy beside the callers has by itself.

NumPy cuts a sum of more than 128 terms in two, at a multiple of eight, and each half again; up to 128 terms it adds
into eight sums side by side. Source: NumPy, numpy/_core/src/umath/loops_utils.h.src, pairwise_sum.
"""

from __future__ import annotations

import math

import numba as nb

from mclcli.kernels import OPTIONS
from mclcli.kernels.trigonometry import _cos_sin, _wrap

_ROW = nb.types.Array(nb.float64, 1, "C", readonly=True)
_POSES = nb.types.Array(nb.float64, 2, "C", readonly=True)
_TABLE = nb.float64[:, ::1]
_FOLDED = 128


@nb.njit(**OPTIONS)
def _fold(terms, size):  # type: ignore[no-untyped-def]
    """Sum of at most 128 terms in NumPy's order: eight sums side by side, then those by twos."""
    if size < 8:
        total = -0.0
        for i in range(size):
            total += terms[i]
        return total
    a, b, c, d, e, f, g, h = terms[0], terms[1], terms[2], terms[3], terms[4], terms[5], terms[6], terms[7]
    whole = size - size % 8
    for i in range(8, whole, 8):
        a, b, c, d = a + terms[i], b + terms[i + 1], c + terms[i + 2], d + terms[i + 3]
        e, f, g, h = e + terms[i + 4], f + terms[i + 5], g + terms[i + 6], h + terms[i + 7]
    total = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for i in range(whole, size):
        total += terms[i]
    return total


@nb.njit(**OPTIONS)
def _piece(start, size):  # type: ignore[no-untyped-def]
    """How many of ``size`` terms NumPy folds from ``start`` on, at what depth of halving, and the turns to there.

    A turn is a bit, the last one the lowest, set where it is to the second half.
    """
    depth = turns = 0
    while size > _FOLDED:
        half = size // 2
        half -= half % 8
        second = start >= half
        start, size = (start - half, size - half) if second else (start, half)
        depth, turns = depth + 1, 2 * turns + second
    return size, depth, turns


@nb.njit(**OPTIONS)
def _add_up(sums, depth, turns, waiting):  # type: ignore[no-untyped-def]
    """Add a piece's ``sums`` (S,) to those of the first halves that waited for it, and let the result wait."""
    while turns & 1:
        for k in range(sums.size):
            sums[k] = waiting[depth, k] + sums[k]
        depth, turns = depth - 1, turns >> 1
    for k in range(sums.size):
        waiting[depth, k] = sums[k]


@nb.njit(**OPTIONS)
def _mean_terms(poses, weights, start, size, terms):  # type: ignore[no-untyped-def]
    """Fill the first four rows of ``terms`` with w times x, y, cos yaw and sin yaw."""
    x, y, cos, sin, yaw = terms[0], terms[1], terms[2, :size], terms[3, :size], terms[4, :size]
    for i in range(size):
        x[i] = weights[start + i] * poses[start + i, 0]
        y[i] = weights[start + i] * poses[start + i, 1]
        yaw[i] = poses[start + i, 2]
    _cos_sin(yaw, cos, sin)
    for i in range(size):
        cos[i] *= weights[start + i]
        sin[i] *= weights[start + i]


@nb.njit(**OPTIONS)
def _covariance_terms(poses, weights, mean, start, size, terms):  # type: ignore[no-untyped-def]
    """Fill the six rows of ``terms`` with the lower triangle, row by row, of w r rᵀ."""
    for i in range(size):
        n = start + i
        x, y, t = poses[n, 0] - mean[0], poses[n, 1] - mean[1], _wrap(poses[n, 2] - mean[2])
        wx, wy, wt = weights[n] * x, weights[n] * y, weights[n] * t
        terms[0, i], terms[1, i], terms[2, i] = wx * x, wy * x, wy * y
        terms[3, i], terms[4, i], terms[5, i] = wt * x, wt * y, wt * t


@nb.njit([nb.void(_POSES, _ROW, nb.float64[::1], _TABLE, _TABLE, _TABLE)], **OPTIONS)
def mean_and_covariance(poses, weights, mean, covariance, terms, waiting):  # type: ignore[no-untyped-def]
    """Fill ``mean`` (3,), with circular yaw, and ``covariance`` (3, 3), every sum in the order of ``np.sum``.

    Scratch: ``terms`` (6, 128), ``waiting`` (65, 6): a row more than there can be halvings.
    """
    sums, total = waiting[64], waiting[0]
    for k in range(6):
        total[k] = 0.0
    for stage in range(2):
        start = 0
        while start < poses.shape[0]:
            size, depth, turns = _piece(start, poses.shape[0])
            if stage == 0:
                _mean_terms(poses, weights, start, size, terms)
            else:
                _covariance_terms(poses, weights, mean, start, size, terms)
            for k in range(6):
                sums[k] = 0.0 + _fold(terms[k], size)  # as NumPy does, who knows no negative zero
            _add_up(sums, depth, turns, waiting)
            start += size
        if stage == 0:
            mean[0], mean[1], mean[2] = total[0], total[1], math.atan2(total[3], total[2])
    covariance[0, 0], covariance[1, 1], covariance[2, 2] = total[0], total[2], total[5]
    covariance[0, 1] = covariance[1, 0] = total[1]
    covariance[0, 2] = covariance[2, 0] = total[3]
    covariance[1, 2] = covariance[2, 1] = total[4]


@nb.njit([nb.void(_POSES, nb.float64, nb.float64, nb.float64, nb.int64[::1])], **OPTIONS)
def count_near(poses, x, y, radius, count):  # type: ignore[no-untyped-def]
    """Count into ``count[0]`` the poses within ``radius`` of ``x`` and of ``y``."""
    near = 0
    for n in range(poses.shape[0]):
        near += (abs(poses[n, 0] - x) <= radius) & (abs(poses[n, 1] - y) <= radius)
    count[0] = near


@nb.njit([nb.void(_ROW, nb.float64[::1], nb.float64[::1], _TABLE)], **OPTIONS)
def lagged_sums(values, out, terms, waiting):  # type: ignore[no-untyped-def]
    """Fill ``out`` (L,) with Σ_i v_i v_{i+lag} of ``values`` (K,), zero beyond the last, in the order of ``np.sum``.

    Scratch: ``terms`` (128,), ``waiting`` (65, 1).
    """
    sums = waiting[64]
    for lag in range(out.size):
        start = 0
        while start < values.size:
            size, depth, turns = _piece(start, values.size)
            there = min(size, max(0, values.size - lag - start))
            for i in range(there):
                terms[i] = values[start + lag + i] * values[start + i]
            for i in range(there, size):
                terms[i] = 0.0
            sums[0] = 0.0 + _fold(terms, size)
            _add_up(sums, depth, turns, waiting)
            start += size
        out[lag] = waiting[0, 0]
