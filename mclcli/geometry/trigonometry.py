"""Cosine and sine from IEEE arithmetic alone: the same bits from NumPy and from compiled code, on every machine.

Libraries differ in the last bit, and one of them takes twice as long as the rest of scoring a particle. This is
fdlibm's method: reduce by multiples of π/2 in three parts of 33 bits, then a polynomial for each. Within 1 ulp.
Source: fdlibm 5.3, k_sin.c, k_cos.c and e_rem_pio2.c.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.native import backend

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


def cos_sin(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine (N,) of angles (N,) [rad] up to a million; beyond, they lose digits.

    Compiled code, which gives the same bits, does it where a larger job has brought it into this process.
    """
    if not backend.in_use():
        return by_numpy(angles)
    cos, sin = np.empty(angles.shape), np.empty(angles.shape)
    backend.load("trigonometry").cos_sin(np.ascontiguousarray(angles), cos, sin)
    return cos, sin


def by_numpy(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The formula of ``cos_sin``."""
    turns = np.floor(angles * 0.6366197723675814 + 0.5)  # quarter turns, 2/π
    r = ((angles - turns * 1.57079632673412561417) - turns * 6.07710050630396597660e-11) - (
        turns * 2.02226624879595063154e-21
    )
    s, c = _sine(r), _cosine(r)
    quarter = turns - 4.0 * np.floor(turns * 0.25)
    odd = (quarter == 1.0) | (quarter == 3.0)
    cos, sin = np.where(odd, s, c), np.where(odd, c, s)
    return np.where((quarter == 1.0) | (quarter == 2.0), -cos, cos), np.where(quarter >= 2.0, -sin, sin)


def _sine(r: FloatArray) -> FloatArray:
    """Sine of |r| ≤ π/4."""
    z = r * r
    s = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s)
    return np.asarray(r + r * z * (-1.66666666666666324348e-01 + z * s))


def _cosine(r: FloatArray) -> FloatArray:
    """Cosine of |r| ≤ π/4."""
    z = r * r
    c = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    c = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c))
    half = 0.5 * z
    w = 1.0 - half
    return np.asarray(w + (((1.0 - w) - half) + z * z * c))
