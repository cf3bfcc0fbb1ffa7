"""Evaluation of tracks as the equations say it, pose by pose. Poses are (x, y, yaw), stamps seconds."""

from __future__ import annotations

import math

Pose = tuple[float, float, float]


def wrap(angle: float) -> float:
    while angle > math.pi:
        angle -= 2 * math.pi
    while angle <= -math.pi:
        angle += 2 * math.pi
    return angle


def between(a: Pose, b: Pose) -> Pose:
    """b seen from a."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    c, s = math.cos(a[2]), math.sin(a[2])
    return c * dx + s * dy, -s * dx + c * dy, wrap(b[2] - a[2])


def statistics(values: list[float]) -> dict[str, float]:
    ordered, n = sorted(abs(v) for v in values), len(values)
    mean = sum(ordered) / n
    return {
        "rmse": math.sqrt(sum(v * v for v in ordered) / n),
        "mean": mean,
        "median": 0.5 * (ordered[(n - 1) // 2] + ordered[n // 2]),
        "std": math.sqrt(sum((v - mean) ** 2 for v in ordered) / n),
        "min": ordered[0],
        "max": ordered[-1],
    }


def way(poses: list[Pose], stride: float = 0.1) -> list[float]:
    kept, total, result = poses[0], 0.0, []
    for pose in poses:
        step = math.dist(kept[:2], pose[:2])
        if step >= stride:
            kept, total = pose, total + step
        result.append(total)
    return result


def relative(estimated: list[Pose], expected: list[Pose], along: list[float]) -> list[tuple[float, float]]:
    """Drift per unit of ``along`` from each pose to the first one at least a unit further on."""
    result = []
    for i in range(len(along)):
        for j in range(i, len(along)):
            if along[j] >= along[i] + 1.0 - 1e-9:
                error = between(between(expected[i], expected[j]), between(estimated[i], estimated[j]))
                span = along[j] - along[i]
                result.append((math.hypot(error[0], error[1]) / span, error[2] / span))
                break
    return result


def nearest(track: list[int], reference: list[int], limit: int) -> list[tuple[int, int]]:
    """Pairs of indices: every stamp of the shorter list with the nearest of the longer, the earlier one of two."""
    swap = len(track) > len(reference)
    short, long = (reference, track) if swap else (track, reference)
    pairs = []
    for i, stamp in enumerate(short):
        j = min(range(len(long)), key=lambda k: (abs(long[k] - stamp), k))
        if abs(long[j] - stamp) <= limit:
            pairs.append((j, i) if swap else (i, j))
    return pairs


def losses(seconds: list[float], translation: list[float], yaw: list[float]) -> list[tuple[int, int | None]]:
    """First and one-past-last index of each loss by the default rules; None where it lasts to the end."""

    def lasting(flags: list[bool], start: int) -> bool:
        """Whether a stretch that begins here holds for 2 s and 3 poses."""
        if not flags[start] or (start > 0 and flags[start - 1]):
            return False
        stop = start
        while stop < len(flags) and flags[stop]:
            stop += 1
        return stop - start >= 3 and seconds[stop - 1] - seconds[start] >= 2.0 - 1e-12

    tens, thirties = math.radians(10), math.radians(30)
    both = list(zip(translation, yaw, strict=True))
    beyond = [t > 1.0 or abs(y) > thirties for t, y in both]
    inside = [t < 0.5 and abs(y) < tens for t, y in both]
    found: list[tuple[int, int | None]] = []
    lost_since = 0 if beyond[0] else None
    for i in range(len(seconds)):
        if lost_since is None and lasting(beyond, i):
            lost_since = i
        elif lost_since is not None and lasting(inside, i):
            found.append((lost_since, i))
            lost_since = None
    return found if lost_since is None else [*found, (lost_since, None)]


def nees(error: Pose, covariance: list[list[float]]) -> float:
    """eᵀP⁻¹e by Cramer's rule."""

    def det(m: list[list[float]]) -> float:
        (a, b, c), (d, e, f), (g, h, i) = m
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)

    whole, total = det(covariance), 0.0
    for k in range(3):
        replaced = [[error[r] if c == k else covariance[r][c] for c in range(3)] for r in range(3)]
        total += error[k] * det(replaced) / whole
    return total


def misfit(estimated: list[Pose], expected: list[Pose], motion: Pose) -> float:
    """Sum of squared distances after moving the estimates."""
    c, s = math.cos(motion[2]), math.sin(motion[2])
    total = 0.0
    for (x, y, _), (u, v, _) in zip(estimated, expected, strict=True):
        total += (motion[0] + c * x - s * y - u) ** 2 + (motion[1] + s * x + c * y - v) ** 2
    return total
