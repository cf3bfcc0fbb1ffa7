"""When to update and when to resample."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def has_moved(increment: NDArray[np.float64], min_d: float, min_a: float) -> bool:
    """Whether the base moved (Euclidean, [m]) or turned [rad] far enough since the last update for another one."""
    return math.hypot(increment[0], increment[1]) >= min_d or abs(float(increment[2])) >= min_a


def has_moved_on_an_axis(difference: NDArray[np.float64], min_d: float, min_a: float) -> bool:
    """nav2_amcl's gate: x, y [m] or yaw [rad] of the odometry's own frame differ by more than the thresholds."""
    yaw = math.remainder(difference[2], 2.0 * math.pi)
    return abs(difference[0]) > min_d or abs(difference[1]) > min_d or abs(yaw) > min_a


def is_depleted(ess: float, n: int, fraction: float) -> bool:
    """Whether the effective sample size fell below a fraction of the particles."""
    return ess < fraction * n
