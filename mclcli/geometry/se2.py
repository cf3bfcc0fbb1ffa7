"""Poses in the plane, SE(2).

A pose is ``(x, y, yaw)`` [m, m, rad]; arrays of poses have shape (..., 3), float64. ``a_from_b`` takes coordinates
in frame b to frame a, so ``compose(map_from_base, base_from_laser)`` is ``map_from_laser``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mclcli.arrays import FloatArray

TAU = 2.0 * np.pi


def wrap(angle: ArrayLike) -> FloatArray:
    """Angle [rad] wrapped to (−π, π]; angles already there come back unchanged to the bit."""
    angle = np.asarray(angle, dtype=np.float64)
    there = (angle > -np.pi) & (angle <= np.pi)
    if there.all():
        return angle.copy()
    wrapped = -(np.remainder(np.pi - angle, TAU) - np.pi)
    wrapped = np.where(wrapped <= -np.pi, np.pi, wrapped)  # the remainder just below a full turn rounds up to it
    return np.where(there, angle, wrapped)


def compose(a_from_b: ArrayLike, b_from_c: ArrayLike) -> FloatArray:
    """Chain two poses: ``a_from_c`` (..., 3), yaw wrapped; the arguments broadcast."""
    a = np.asarray(a_from_b, dtype=np.float64)
    b = np.asarray(b_from_c, dtype=np.float64)
    if a.ndim == b.ndim == 1:
        return np.array(_compose_one(a.tolist(), b.tolist()))
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + c * b[..., 0] - s * b[..., 1]
    y = a[..., 1] + s * b[..., 0] + c * b[..., 1]
    return np.stack(np.broadcast_arrays(x, y, wrap(a[..., 2] + b[..., 2])), axis=-1)


def inverse(a_from_b: ArrayLike) -> FloatArray:
    """Invert a pose: ``b_from_a`` (..., 3)."""
    a = np.asarray(a_from_b, dtype=np.float64)
    if a.ndim == 1:
        return np.array(_inverse_one(a.tolist()))
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = -c * a[..., 0] - s * a[..., 1]
    y = s * a[..., 0] - c * a[..., 1]
    return np.stack([x, y, wrap(-a[..., 2])], axis=-1)


def between(w_from_a: ArrayLike, w_from_b: ArrayLike) -> FloatArray:
    """Pose of b seen from a: ``a_from_b`` (..., 3), both given in the same frame w."""
    a = np.asarray(w_from_a, dtype=np.float64)
    b = np.asarray(w_from_b, dtype=np.float64)
    if a.ndim == b.ndim == 1:
        return np.array(_compose_one(_inverse_one(a.tolist()), b.tolist()))
    return compose(inverse(a), b)


# One pose at a time, in plain numbers: an array's bookkeeping would cost twenty times as much as the arithmetic.


def wrap_one(angle: float) -> float:
    """``wrap`` of a single angle [rad], to the same bits."""
    if -math.pi < angle <= math.pi:
        return angle
    return float(wrap(angle))


def _compose_one(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    c, s = _cos_sin_one(a[2])
    return a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap_one(a[2] + b[2])


def _inverse_one(a: Sequence[float]) -> tuple[float, float, float]:
    c, s = _cos_sin_one(a[2])
    return -c * a[0] - s * a[1], s * a[0] - c * a[1], wrap_one(-a[2])


def _cos_sin_one(angle: float) -> tuple[float, float]:
    return (math.cos(angle), math.sin(angle)) if math.isfinite(angle) else (math.nan, math.nan)


def _chord_one(half: float) -> float:
    """sin(ω/2)/(ω/2): chord over arc."""
    return math.sin(half) / half if half else 1.0


def _exp_one(v: Sequence[float]) -> tuple[float, float, float]:
    half = 0.5 * v[2]
    chord = _chord_one(half)
    c, s = chord * math.cos(half), chord * math.sin(half)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], wrap_one(v[2])


def _log_one(p: Sequence[float]) -> tuple[float, float, float]:
    yaw = wrap_one(p[2])
    half = 0.5 * yaw
    chord = _chord_one(half)
    c, s = math.cos(half) / chord, math.sin(half) / chord
    return c * p[0] + s * p[1], -s * p[0] + c * p[1], yaw


def _interpolate_one(a: Sequence[float], b: Sequence[float], fraction: float) -> tuple[float, float, float]:
    twist = _log_one(_compose_one(_inverse_one(a), b))
    return _compose_one(a, _exp_one([fraction * v for v in twist]))


def exp(twist: ArrayLike) -> FloatArray:
    """Pose reached by a constant twist (vx, vy, ω) held for one unit of time, shape (..., 3).

    Source: Lynch and Park 2017, *Modern Robotics*, eq. 3.85 restricted to the plane.
    """
    v = np.asarray(twist, dtype=np.float64)
    if v.ndim == 1:
        return np.array(_exp_one(v.tolist()))
    half = 0.5 * v[..., 2]
    chord = np.sinc(half / np.pi)  # sin(ω/2)/(ω/2): chord over arc
    c, s = chord * np.cos(half), chord * np.sin(half)
    return np.stack([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1], wrap(v[..., 2])], axis=-1)


def log(pose: ArrayLike) -> FloatArray:
    """Twist (vx, vy, ω) whose ``exp`` is the pose; |ω| ≤ π, shape (..., 3)."""
    p = np.asarray(pose, dtype=np.float64)
    if p.ndim == 1:
        return np.array(_log_one(p.tolist()))
    yaw = wrap(p[..., 2])
    half = 0.5 * yaw
    chord = np.sinc(half / np.pi)
    c, s = np.cos(half) / chord, np.sin(half) / chord
    return np.stack([c * p[..., 0] + s * p[..., 1], -s * p[..., 0] + c * p[..., 1], yaw], axis=-1)


def interpolate(w_from_a: ArrayLike, w_from_b: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Pose at ``fraction`` of the way from a to b along the constant twist that joins them, shape (..., 3)."""
    a = np.asarray(w_from_a, dtype=np.float64)
    b = np.asarray(w_from_b, dtype=np.float64)
    share = np.asarray(fraction, dtype=np.float64)
    if a.ndim == b.ndim == 1 and not share.ndim:
        return np.array(_interpolate_one(a.tolist(), b.tolist(), float(share)))
    share = share[..., np.newaxis] if share.ndim else share
    return compose(a, exp(share * log(between(a, b))))
