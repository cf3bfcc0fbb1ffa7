"""Poses against measurements: untempered log-likelihoods per sensor, and what they weigh together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.filter import weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.sensors import Measurement


def score(measurements: Sequence[Measurement], poses: FloatArray) -> FloatArray:
    """Untempered log-likelihoods (S, N) of poses (N, 3), a row per measurement."""
    return np.array([m.log_likelihood(poses) for m in measurements]).reshape(-1, poses.shape[0])


def evidences(log_weights: FloatArray, log_likelihoods: FloatArray) -> tuple[float, list[float]]:
    """log Σ W e^{Σℓ} of all sensors together, and log Σ W e^ℓ of each, for log W (N,) and log-likelihoods (S, N)."""
    each = [weights.log_sum_exp(log_weights + row) for row in log_likelihoods]
    return each[0] if len(each) == 1 else weights.log_sum_exp(log_weights + log_likelihoods.sum(axis=0)), each


def temper(alphas: Sequence[float], log_likelihoods: FloatArray) -> FloatArray:
    """Σ_sensors α_s · log p_s (N,): the temperature applies to what is new, never to a carried weight."""
    total = np.zeros(log_likelihoods.shape[1])
    for alpha, log_likelihood in zip(alphas, log_likelihoods, strict=True):
        total += alpha * log_likelihood
    return total
