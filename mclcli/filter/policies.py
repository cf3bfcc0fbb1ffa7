"""When to update and when to resample."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

_WAY = (0.1, 0.1)  # [m], [rad]


def has_moved(increment: FloatArray, min_d: float, min_a: float) -> bool:
    """Whether the base moved (Euclidean, [m]) or turned [rad] far enough since the last update for another one."""
    return math.hypot(increment[0], increment[1]) >= min_d or abs(float(increment[2])) >= min_a


def has_moved_on_an_axis(difference: FloatArray, min_d: float, min_a: float) -> bool:
    """nav2_amcl's gate: x, y [m] or yaw [rad] of the odometry's own frame differ by more than the thresholds."""
    yaw = math.remainder(difference[2], 2.0 * math.pi)
    return abs(difference[0]) > min_d or abs(difference[1]) > min_d or abs(yaw) > min_a


def add_way(way: tuple[float, float], increment: FloatArray) -> tuple[float, float]:
    """Metres moved and radians turned, with another increment (3,)."""
    return way[0] + math.hypot(increment[0], increment[1]), way[1] + abs(float(increment[2]))


def is_way(way: tuple[float, float]) -> bool:
    """Whether so much was moved [m] or turned [rad] that particles are no longer copies of each other."""
    return way[0] >= _WAY[0] or way[1] >= _WAY[1]


def is_depleted(ess: float, n: int, fraction: float) -> bool:
    """Whether the effective sample size fell below a fraction of the particles; of 1, whatever it is."""
    return ess < fraction * n or fraction == 1.0


def is_turn_of(step: int, interval: int) -> bool:
    """Whether a step, counted from 0, is the last of its ``interval`` steps."""
    return (step + 1) % interval == 0
