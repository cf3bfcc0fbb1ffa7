"""The filter's arithmetic, one number at a time: log-sum-exp, resampling, estimate, differential drive, SE(2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    Pose = tuple[float, float, float]


def wrap(angle: float) -> float:
    """Angle brought into (−π, π] by whole turns."""
    while angle > math.pi:
        angle -= math.tau
    while angle <= -math.pi:
        angle += math.tau
    return angle


def compose(a: Sequence[float], b: Sequence[float]) -> Pose:
    """Pose b, given in frame a, in the frame that a is given in."""
    c, s = math.cos(a[2]), math.sin(a[2])
    return (a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap(a[2] + b[2]))


def log_sum_exp(values: Sequence[float]) -> float:
    """log Σ e^v, the largest taken out first."""
    peak = max(values)
    if peak == -math.inf:
        return peak
    return peak + math.log(math.fsum(math.exp(v - peak) for v in values))


def normalise(values: Sequence[float]) -> list[float]:
    """e^v / Σ e^v."""
    total = log_sum_exp(values)
    return [math.exp(v - total) for v in values]


def systematic(weights: Sequence[float], n: int, offset: float) -> list[int]:
    """Walk along the weights with n pointers (k + offset)/n."""
    ancestors = []
    index, reached = 0, weights[0]
    for k in range(n):
        while (k + offset) / n >= reached:
            index += 1
            reached += weights[index]
        ancestors.append(index)
    return ancestors


def mean_and_covariance(poses: Sequence[Sequence[float]], weights: Sequence[float]) -> tuple[Pose, list[list[float]]]:
    """Weighted mean with circular yaw, and Σ w r rᵀ."""
    x = math.fsum(w * p[0] for p, w in zip(poses, weights, strict=True))
    y = math.fsum(w * p[1] for p, w in zip(poses, weights, strict=True))
    sine = math.fsum(w * math.sin(p[2]) for p, w in zip(poses, weights, strict=True))
    cosine = math.fsum(w * math.cos(p[2]) for p, w in zip(poses, weights, strict=True))
    yaw = math.atan2(sine, cosine)
    covariance = [[0.0] * 3 for _ in range(3)]
    for p, w in zip(poses, weights, strict=True):
        r = (p[0] - x, p[1] - y, wrap(p[2] - yaw))
        for i in range(3):
            for j in range(3):
                covariance[i][j] += w * r[i] * r[j]
    return (x, y, yaw), covariance


def differential(
    pose: Sequence[float], increment: Sequence[float], alphas: Sequence[float], normals: Sequence[float]
) -> Pose:
    """Table 5.6 of Thrun et al. 2005 with reverse driving folded and no first turn below 1 cm."""
    dx, dy, dyaw = increment
    distance = math.hypot(dx, dy)
    rot1 = math.atan2(dy, dx) if distance > 0.0 else 0.0
    if dx < 0.0:  # backwards: turn the other way and drive a negative distance
        rot1, distance = math.atan2(-dy, -dx), -distance
    rot2 = wrap(dyaw - rot1)
    seen1, seen2 = (rot1, rot2) if abs(distance) >= 0.01 else (0.0, wrap(rot1 + rot2))
    a1, a2, a3, a4 = alphas
    turn = rot1 + normals[0] * math.sqrt(a1 * seen1**2 + a2 * distance**2)
    move = distance + normals[1] * math.sqrt(a3 * distance**2 + a4 * (seen1**2 + seen2**2))
    turn_after = rot2 + normals[2] * math.sqrt(a1 * seen2**2 + a2 * distance**2)
    heading = pose[2] + turn
    return (
        pose[0] + move * math.cos(heading),
        pose[1] + move * math.sin(heading),
        wrap(heading + turn_after),
    )
