"""Rows of the table about what the filter does with its particles, 100,000 of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.measure import alternate, timed
from mclcli import rng
from mclcli.filter import clusters, estimate, kld, resampling, weights
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.native.backend import COMPILED

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.measure import Row

N = 100_000


def rows() -> list[Row]:
    """Motion; from weights to the next set; clusters and bins. The partner is one cosine and one sine a particle."""
    draws = np.random.default_rng(0)
    poses = np.column_stack([draws.normal(0, 0.3, (N, 2)), draws.normal(0, 0.1, N)])
    log_weights = draws.normal(0, 1, N)
    normalised = weights.normalise(log_weights)
    motion, increment = DifferentialMotion(DifferentialParameters(), COMPILED), np.array([0.1, 0.0, 0.05])
    wanted = kld.KldParameters(min_particles=N, max_particles=N + 1)

    def move() -> object:
        stream = rng.stream(0, rng.Purpose.MOTION, 5)
        return motion.sample(poses, increment, stream.standard_normal(poses.shape))

    def renew() -> object:
        shares = weights.normalise(log_weights)
        weights.effective_sample_size(shares)
        mean = estimate.weighted_mean(poses, shares, COMPILED)
        return mean, poses.take(resampling.systematic(shares, N, np.random.default_rng(1), COMPILED), axis=0)

    return [
        _row("motion, random numbers included", "≤ 60 ns", move),
        _row("normalise, ESS, resample, estimate", "≤ 40 ns", renew),
        _row("clusters and their moments", "≤ 100 ns", lambda: clusters.find(poses, normalised, backend=COMPILED)),
        _row(
            "bins and size of KLD", "≤ 100 ns", lambda: kld.kld_size(poses, wanted, np.random.default_rng(2), COMPILED)
        ),
    ]


def _row(what: str, target: str, task: Callable[[], object]) -> Row:
    angles = np.random.default_rng(3).uniform(-3, 3, N)
    pair = alternate(timed(task), timed(lambda: (np.cos(angles), np.sin(angles))), 25)
    return f"{what}, a particle", f"{pair.a / N * 1e9:.0f} ns", target, f"{pair.ratio:.1f} × np.cos and np.sin"
