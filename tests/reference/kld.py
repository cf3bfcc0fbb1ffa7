"""KLD sampling one particle at a time, and a normal quantile by bisection."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    Bin = tuple[int, int, int]


def quantile(probability: float) -> float:
    """z with Φ(z) = probability, by halving an interval."""
    low, high = -40.0, 40.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        if 0.5 * math.erfc(-middle / math.sqrt(2.0)) < probability:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def required(k: int, err: float, z: float) -> float:
    """Fox 2003, eq. 7, before it is rounded up."""
    if k <= 1:
        return 0.0
    b = 2.0 / (9.0 * (k - 1))
    return (k - 1) / (2.0 * err) * max(0.0, 1.0 - b + math.sqrt(b) * z) ** 3


def bin_of(pose: Sequence[float]) -> Bin:
    """Bin of 0.5 m × 0.5 m × 10°, yaw counted from −180°."""
    size = math.pi / 18
    yaw = math.atan2(math.sin(pose[2]), math.cos(pose[2]))
    return (math.floor(pose[0] / 0.5), math.floor(pose[1] / 0.5), math.floor(yaw / size) % 36)


def enough(poses: Iterable[Sequence[float]], limit: Callable[[int], int]) -> int:
    """Particles visited, in the order given, until there are as many as the bins seen call for."""
    seen: set[Bin] = set()
    count = 0
    for pose in poses:
        seen.add(bin_of(pose))
        count += 1
        if count >= limit(len(seen)):
            break
    return count
