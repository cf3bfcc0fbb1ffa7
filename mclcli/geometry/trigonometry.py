"""Cosine, sine and angle from IEEE arithmetic alone: the same bits from NumPy and from compiled code, on every machine.

Libraries differ in the last bit, and one of them takes twice as long as the rest of scoring a particle. This is
fdlibm's method: reduce by multiples of π/2 in three parts of 33 bits, then a polynomial for each. Within 1 ulp.
Source: fdlibm 5.3, k_sin.c, k_cos.c and e_rem_pio2.c.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

_TAN_PI_8 = math.sqrt(2.0) - 1.0


def cos_sin(angles: FloatArray, backend: Backend = NUMPY) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine (N,) of angles (N,) [rad] up to a million; beyond, they lose digits."""
    kernels = backend.kernels("trigonometry")
    if kernels is not None:
        cos, sin = np.empty(angles.shape), np.empty(angles.shape)
        kernels.cos_sin(np.ascontiguousarray(angles), cos, sin)
        return cos, sin
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


def unsigned_angle(along: FloatArray, across: FloatArray) -> FloatArray:
    """Angle from 0 to π [rad] of vectors (along, ±across), any shape; within 6e-16.

    In the octant beside the axis it is π/8 and the arc tangent of at most tan π/8, a polynomial whose error is 2e-17.
    """
    x, y = np.abs(along), np.abs(across)
    low, high = np.minimum(x, y), np.maximum(x, y)
    t = (low - _TAN_PI_8 * high) / (high + _TAN_PI_8 * low)
    z = t * t
    zz = z * z
    near = (-0.3333333333333215 + z * 0.19999999999368284) + zz * (-0.14285714209567044 + z * 0.11111107021102413)
    far = (-0.09090787705989976 + z * 0.07690112157649176) + zz * (-0.06641318145938455 + z * 0.05692890475881414)
    fourth = zz * zz
    p = near + fourth * (far + fourth * (-0.043587024628891795 + z * 0.02124248956926765))
    angle = 0.125 * math.pi + (t + t * z * p)
    angle = np.where(y > x, 0.5 * math.pi - angle, angle)
    return np.where(along < 0.0, math.pi - angle, angle)
