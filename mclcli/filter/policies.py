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


def is_depleted(ess: float, n: int, fraction: float) -> bool:
    """Whether the effective sample size fell below a fraction of the particles."""
    return ess < fraction * n
