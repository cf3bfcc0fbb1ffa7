"""Poses against measurements: untempered log-likelihoods per sensor, and what they weigh together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mclcli.sensors import Measurement


def score(measurements: Sequence[Measurement], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Untempered log-likelihoods (S, N) of poses (N, 3), a row per measurement."""
    return np.array([m.log_likelihood(poses) for m in measurements]).reshape(-1, poses.shape[0])


def temper(alphas: Sequence[float], log_likelihoods: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ_sensors α_s · log p_s (N,): the temperature applies to what is new, never to a carried weight."""
    total = np.zeros(log_likelihoods.shape[1])
    for alpha, log_likelihood in zip(alphas, log_likelihoods, strict=True):
        total += alpha * log_likelihood
    return total
