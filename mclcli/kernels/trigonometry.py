"""Cosine and sine of many angles, in vectors: the loop of ``mclcli.geometry.trigonometry``; and angles wrapped."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS

_TURN = 2.0 * math.pi
_ANGLES = nb.types.Array(nb.float64, 1, "C", readonly=True)
_TAN_PI_8 = math.sqrt(2.0) - 1.0


@nb.njit(**OPTIONS)
def _wrap(angle):  # type: ignore[no-untyped-def]
    """As ``mclcli.geometry.se2.wrap``."""
    if -math.pi < angle <= math.pi:
        return angle
    wrapped = -((math.pi - angle) % _TURN - math.pi)
    return math.pi if wrapped <= -math.pi else wrapped


@nb.njit(**OPTIONS)
def _cos_sin(angles, cos, sin):  # type: ignore[no-untyped-def]
    """Cosine and sine of ``angles`` (N,) [rad] into ``cos`` and ``sin``; equal to the bit to the NumPy version."""
    for i in range(angles.size):
        turns = np.floor(angles[i] * 0.6366197723675814 + 0.5)
        r = ((angles[i] - turns * 1.57079632673412561417) - turns * 6.07710050630396597660e-11) - (
            turns * 2.02226624879595063154e-21
        )
        z = r * r
        s = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
        s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s)
        s = r + r * z * (-1.66666666666666324348e-01 + z * s)
        c = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
        c = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c))
        half = 0.5 * z
        w = 1.0 - half
        c = w + (((1.0 - w) - half) + z * z * c)
        quarter = turns - 4.0 * np.floor(turns * 0.25)
        odd = (quarter == 1.0) | (quarter == 3.0)
        one, other = (s if odd else c), (c if odd else s)
        cos[i] = -one if (quarter == 1.0) | (quarter == 2.0) else one
        sin[i] = -other if quarter >= 2.0 else other


@nb.njit([nb.void(_ANGLES, nb.float64[::1], nb.float64[::1])], **OPTIONS)
def cos_sin(angles, cos, sin):  # type: ignore[no-untyped-def]
    """Fill ``cos`` and ``sin`` (N,) with the cosine and sine of ``angles`` (N,) [rad]."""
    _cos_sin(angles, cos, sin)


@nb.njit(**OPTIONS)
def _unsigned_angle(along, across):  # type: ignore[no-untyped-def]
    """Angle between 0 and π of the vector (along, ±across) [rad].

    In the octant beside the axis it is π/8 and the arc tangent of at most tan π/8, a polynomial whose error is 2e-17.
    """
    x, y = abs(along), abs(across)
    low, high = min(x, y), max(x, y)
    t = (low - _TAN_PI_8 * high) / (high + _TAN_PI_8 * low)
    z = t * t
    zz = z * z
    near = (-0.3333333333333215 + z * 0.19999999999368284) + zz * (-0.14285714209567044 + z * 0.11111107021102413)
    far = (-0.09090787705989976 + z * 0.07690112157649176) + zz * (-0.06641318145938455 + z * 0.05692890475881414)
    fourth = zz * zz
    p = near + fourth * (far + fourth * (-0.043587024628891795 + z * 0.02124248956926765))
    angle = 0.125 * math.pi + (t + t * z * p)
    angle = 0.5 * math.pi - angle if y > x else angle
    return math.pi - angle if along < 0.0 else angle
