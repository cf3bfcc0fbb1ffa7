"""The beam mixture of expected ranges: the loop of ``mclcli.sensors.beam_forms.textbook``, which see.

What bounds it: two exponentials, in vectors. Error functions are called only where a wall is within some standard
deviations of the sensor or of r_max.
"""

from __future__ import annotations

import math

import numba as nb

from mclcli.kernels import OPTIONS
from mclcli.kernels._exponential import _exp_in_parts

_ROWS = nb.types.Array(nb.float64, 2, "C", readonly=True)
_NUMBERS = nb.types.Array(nb.int64, 1, "C", readonly=True)
_SQRT2 = math.sqrt(2.0)
_SQRT_TAU = math.sqrt(2.0 * math.pi)
_EDGE = 6.0 * math.sqrt(2.0)  # standard deviations beyond which the error function is 1 in double precision


@nb.njit(**OPTIONS)
def _add_up(ranges, beams, r_max, half_cell, sigma, rate, z_hit, z_short, hits, others):  # type: ignore[no-untyped-def]
    """The hit component of one pose, not yet truncated to [0, r_max], and the sum of the others, each (B,)."""
    seen, kept, early, bound, always = beams[0], beams[1], beams[2], beams[3], beams[4]
    amplitude, near_amplitude = z_hit / (sigma * _SQRT_TAU), (z_hit + z_short) / (sigma * _SQRT_TAU)
    for b in range(ranges.size):
        expected = min(ranges[b], r_max)
        near = expected < half_cell
        z = (seen[b] - expected) / sigma
        power, q = _exp_in_parts(-0.5 * (z * z))
        hits[b] = (near_amplitude if near else amplitude) * kept[b] * (power + power * q)
        power, q = _exp_in_parts(-rate * expected)
        until = -(power * q + (power - 1.0)) if rate > 0.0 else expected
        short = early[b] / (1.0 if near else until)
        others[b] = always[b] + (short if (expected > bound[b]) & (not near) else 0.0)


@nb.njit([nb.void(_ROWS, _NUMBERS, *(nb.float64,) * 7, nb.float64[:, ::1], nb.float64[:, ::1])], **OPTIONS)
def textbook(  # type: ignore[no-untyped-def]
    beams, unseen, r_max, half_cell, sigma, rate, z_hit, z_short, z_max, ranges, scratch
):
    """Replace expected ``ranges`` (N, B) [m] by p(r | r*).

    ``beams`` (5, B): the reading, at most r_max; 1 or, for hits that cannot be, 0; the part of the short component that
    does not depend on r*; the r* from which on there is one, exclusive; what is added whatever r* is. ``unseen``:
    beams that are judged as censored. ``rate`` 0 stands for its limit. Scratch: (2, B).
    """
    hits, others = scratch[0], scratch[1]
    low, high, deviation = _EDGE * sigma, r_max - _EDGE * sigma, _SQRT2 * sigma
    share_at_max = 0.5 * math.erf(r_max / deviation)
    for n in range(ranges.shape[0]):
        row = ranges[n]
        _add_up(row, beams, r_max, half_cell, sigma, rate, z_hit, z_short, hits, others)
        for b in range(row.size):
            if row[b] >= r_max:
                hits[b] /= share_at_max
            elif row[b] < low or row[b] > high:
                to_max = math.erf((r_max - row[b]) / deviation) if row[b] > high else 1.0
                hits[b] /= 0.5 * (to_max + (math.erf(row[b] / deviation) if row[b] < low else 1.0))
        for k in range(unseen.size):
            b = unseen[k]
            hits[b] = z_hit * 0.5 * math.erfc((r_max - row[b]) / deviation)
            others[b] = z_max
        for b in range(row.size):
            row[b] = hits[b] + others[b] if row[b] == row[b] else math.nan
