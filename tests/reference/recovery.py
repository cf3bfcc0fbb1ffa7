"""Augmented MCL's averages, line by line as in table 8.3 of Thrun, Burgard, Fox 2005; first values as they come."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def averages(fits: Sequence[float], alpha_slow: float, alpha_fast: float) -> tuple[float, float]:
    """w_slow and w_fast after these fits."""
    w_slow = w_fast = fits[0]
    for v in fits[1:]:
        w_slow += alpha_slow * (v - w_slow)
        w_fast += alpha_fast * (v - w_fast)
    return w_slow, w_fast


def share(w_slow: float, w_fast: float) -> float:
    """Probability of drawing a particle anew."""
    return max(0.0, 1.0 - w_fast / w_slow)
