"""Rigid transforms in space, SE(3), as 4 × 4 float64 matrices: ``a_from_b @ b_from_c`` is ``a_from_c``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike

    from mclcli.arrays import FloatArray


def from_quaternion(translation: Iterable[float], quaternion: Iterable[float]) -> FloatArray:
    """Transform (4, 4) from a translation (3,) [m] and a unit quaternion (x, y, z, w).

    Raises
    ------
    ValueError
        If the translation is not finite or the quaternion's norm is more than 1e-2 away from 1.

    """
    (tx, ty, tz), (x, y, z, w) = _rigid(translation, quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), tx],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), ty],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), tz],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def planar_from_quaternion(translation: Iterable[float], quaternion: Iterable[float]) -> FloatArray:
    """``to_planar`` of ``from_quaternion``, to the same bits and with the same errors, without the matrix between."""
    (tx, ty, _), (x, y, z, w) = _rigid(translation, quaternion)
    return np.array([tx, ty, math.atan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z))])


def _rigid(
    translation: Iterable[float], quaternion: Iterable[float]
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """A translation, and a quaternion of length 1."""
    tx, ty, tz = map(float, translation)
    x, y, z, w = map(float, quaternion)
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not (math.isfinite(tx) and math.isfinite(ty) and math.isfinite(tz) and abs(norm - 1.0) <= 1e-2):
        raise ValueError(f"not a rigid transform: translation {[tx, ty, tz]}, quaternion norm {norm:g}")
    return (tx, ty, tz), (x / norm, y / norm, z / norm, w / norm)


def from_rpy(translation: ArrayLike, roll: float, pitch: float, yaw: float) -> FloatArray:
    """Transform (4, 4) with rotation Rz(yaw)·Ry(pitch)·Rx(roll) [rad] (REP-103, fixed axes)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    matrix[:3, 3] = np.asarray(translation, dtype=np.float64)
    return matrix


def to_rpy(transform: FloatArray) -> tuple[float, float, float, float, float, float]:
    """(x, y, z, roll, pitch, yaw) of a transform; the inverse of ``from_rpy``."""
    r = transform[:3, :3]
    pitch = float(np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0])))
    if np.hypot(r[0, 0], r[1, 0]) > 1e-9:
        roll, yaw = float(np.arctan2(r[2, 1], r[2, 2])), float(np.arctan2(r[1, 0], r[0, 0]))
    else:  # looking straight up or down: only yaw − roll is determined
        roll, yaw = 0.0, float(np.arctan2(-r[0, 1], r[1, 1]))
    x, y, z = (float(v) for v in transform[:3, 3])
    return x, y, z, roll, pitch, yaw


def from_planar(pose: Sequence[float] | FloatArray) -> FloatArray:
    """Transform (4, 4) of a planar pose (x, y, yaw)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([[c, -s, 0.0, pose[0]], [s, c, 0.0, pose[1]], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def to_planar(transform: FloatArray) -> FloatArray:
    """Planar pose (x, y, yaw) of a transform: its position and heading projected on the ground, shape (3,)."""
    (xx, _, _, x), (yx, _, _, y) = transform[:2].tolist()
    return np.array([x, y, math.atan2(yx, xx)])


def inverse(transform: FloatArray) -> FloatArray:
    """Invert a rigid transform (4, 4)."""
    result = np.eye(4)
    result[:3, :3] = transform[:3, :3].T
    result[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return result


def interpolate(w_from_a: FloatArray, w_from_b: FloatArray, fraction: float) -> FloatArray:
    """Transform at ``fraction`` from a to b: straight-line translation, constant-rate rotation about one axis.

    Source: Rodrigues' formula, with axis and angle of the relative rotation.
    """
    result = np.array(w_from_a)
    result[:3, 3] += fraction * (w_from_b[:3, 3] - w_from_a[:3, 3])
    relative = w_from_a[:3, :3].T @ w_from_b[:3, :3]
    axis = np.array([relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]])
    sine = 0.5 * float(np.sqrt(axis @ axis))
    if sine > 1e-12:
        angle = fraction * float(np.arctan2(sine, 0.5 * (np.trace(relative) - 1.0)))
        k = axis / (2.0 * sine)
        skew = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
        turn = np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)
        result[:3, :3] = w_from_a[:3, :3] @ turn
    return result
