"""The beam mixture, one reading at a time, from its definition."""

from __future__ import annotations

import math


def cumulative(x: float) -> float:
    """Φ(x), the standard normal distribution."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def interval(low: float, high: float) -> float:
    """Φ(high) − Φ(low) for low ≤ 0 ≤ high, each side by itself."""
    return 0.5 * (math.erf(high / math.sqrt(2.0)) + math.erf(-low / math.sqrt(2.0)))


def mixture(
    r: float,
    r_star: float,
    *,
    r_max: float,
    half_cell: float,
    z_hit: float,
    z_short: float,
    z_max: float,
    z_rand: float,
    sigma: float,
    rate: float,
    censored: bool = False,
) -> float:
    """p(r | r*): a density for r < r_max, a probability beside densities at r_max (all of it where ``censored``)."""
    if censored and r >= r_max:
        return z_max + z_hit * (1.0 - cumulative((r_max - r_star) / sigma))
    expected, reading = min(r_star, r_max), min(r, r_max)
    if expected < half_cell:
        z_hit, z_short = z_hit + z_short, 0.0
    e = (reading - expected) / sigma
    share = interval(-expected / sigma, (r_max - expected) / sigma)
    p = z_hit * math.exp(-0.5 * e * e) / (sigma * math.sqrt(math.tau)) / share + z_rand / r_max
    if z_short > 0.0 and (reading < expected or reading == expected == r_max):
        decay = rate * expected
        limit = decay < 1e-290  # λ → 0, before λr* runs out of digits
        p += z_short * (1.0 / expected if limit else rate * math.exp(-rate * reading) / -math.expm1(-decay))
    return p + (z_max if r >= r_max else 0.0)
