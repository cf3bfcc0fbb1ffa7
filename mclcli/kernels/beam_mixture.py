"""The beam mixture of expected ranges: the loop of ``mclcli.sensors.beam_forms.textbook``, which see.

What bounds it: arithmetic in vectors, three exponentials among it. Poses follow one another without a gap, so that a
few beams fill whole vectors.
"""

from __future__ import annotations

import math

import numba as nb

from mclcli.kernels import OPTIONS
from mclcli.kernels._fused import _erfc, _exp, _exp_in_parts, _log

_ROWS = nb.types.Array(nb.float64, 2, "C", readonly=True)
_NUMBERS = nb.types.Array(nb.int64, 1, "C", readonly=True)
_SQRT2 = math.sqrt(2.0)
_SQRT_TAU = math.sqrt(2.0 * math.pi)
_EDGE = 6.0  # where the error function is 1 in double precision
_FACTORS = 16  # of 1e-12 to 1e18: their product neither vanishes nor overflows


@nb.njit(**OPTIONS)
def _shares(expected, r_max, deviation, shares):  # type: ignore[no-untyped-def]
    """Share of N(r; r*, σ²) between 0 and r_max, ``deviation`` being σ√2.

    Where r_max is far from 0, only the nearer one takes something away. Where both are near, what is left is not what
    is left of 1: there the library's function keeps its digits.
    """
    scale = 1.0 / deviation
    if r_max > 2.0 * _EDGE * deviation:
        for i in range(expected.size):
            r = min(expected[i], r_max)
            shares[i] = 1.0 - 0.5 * _erfc(min(r, r_max - r) * scale)
    elif r_max > 2.0 * deviation:
        for i in range(expected.size):
            r = min(expected[i], r_max)
            shares[i] = 1.0 - 0.5 * (_erfc(r * scale) + _erfc((r_max - r) * scale))
    else:
        for i in range(expected.size):
            r = min(expected[i], r_max)
            shares[i] = 0.5 * (math.erf((r_max - r) / deviation) + math.erf(r / deviation))


@nb.njit(**OPTIONS)
def _add_up(ranges, beams, shares, r_max, half_cell, sigma, rate, z_hit, z_short):  # type: ignore[no-untyped-def]
    """Replace expected ranges by the sum of the components."""
    seen, kept, early, bound, always = beams[0], beams[1], beams[2], beams[3], beams[4]
    scale = 1.0 / sigma
    amplitude, near_amplitude = z_hit * scale / _SQRT_TAU, (z_hit + z_short) * scale / _SQRT_TAU
    for i in range(ranges.size):
        expected = min(ranges[i], r_max)
        near = expected < half_cell
        z = (seen[i] - expected) * scale
        hit = (near_amplitude if near else amplitude) * kept[i] * _exp(-0.5 * (z * z))
        power, q = _exp_in_parts(-rate * expected)
        until = -(power * q + (power - 1.0)) if rate > 0.0 else expected
        until = 1.0 if near else until
        short = early[i] if (expected > bound[i]) & (not near) else 0.0
        p = (hit * until + short * shares[i]) / (shares[i] * until) + always[i]
        ranges[i] = math.nan if math.isnan(expected) else p


@nb.njit([nb.void(_ROWS, _NUMBERS, *(nb.float64,) * 7, nb.float64[::1], nb.float64[:, ::1])], **OPTIONS)
def textbook(  # type: ignore[no-untyped-def]
    beams, unseen, r_max, half_cell, sigma, rate, z_hit, z_short, z_max, ranges, scratch
):
    """Replace expected ``ranges`` (N·B,) [m], pose by pose, by p(r | r*).

    ``beams`` (5, k·B), k times the same: the reading, at most r_max; 1 or, for hits that cannot be, 0; the part of the
    short component that does not depend on r*; the r* from which on there is one, exclusive; what is added whatever r*
    is. ``unseen``: those of the k·B beams that are judged as censored. ``rate`` 0 stands for its limit. Scratch:
    (2, k·B).
    """
    size, shares, judged, deviation = max(1, scratch.shape[1]), scratch[0], scratch[1], _SQRT2 * sigma
    for start in range(0, ranges.size, size):
        some = ranges[start : start + size]
        _shares(some, r_max, deviation, shares)
        for k in range(unseen.size):
            if 0 <= unseen[k] < some.size:
                judged[k] = z_hit * 0.5 * math.erfc((r_max - some[unseen[k]]) / deviation) + z_max
        _add_up(some, beams, shares, r_max, half_cell, sigma, rate, z_hit, z_short)
        for k in range(unseen.size):
            if 0 <= unseen[k] < some.size:
                some[unseen[k]] = judged[k]


@nb.njit([nb.void(_ROWS, nb.float64, nb.float64[::1])], **OPTIONS)
def sum_log(likelihood, floor, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (N,) the sum over beams of log max(p, ``floor``), ``likelihood`` (N, B) below 1e18."""
    count = likelihood.shape[1]
    for n in range(likelihood.shape[0]):
        for first in range(0, count, _FACTORS):
            some = likelihood[n, first : first + _FACTORS]
            whole = some.size // 4 * 4
            a = b = c = d = 1.0
            for i in range(0, whole, 4):
                a, b = a * max(some[i], floor), b * max(some[i + 1], floor)
                c, d = c * max(some[i + 2], floor), d * max(some[i + 3], floor)
            for i in range(whole, some.size):
                a *= max(some[i], floor)
            out[n] += _log((a * b) * (c * d))
