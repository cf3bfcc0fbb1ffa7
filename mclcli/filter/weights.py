"""From log-likelihoods to weights, in log domain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.sensors import Measurement


def score(measurements: Sequence[Measurement], poses: FloatArray) -> FloatArray:
    """Untempered log-likelihoods (S, N) of poses (N, 3), a row per measurement."""
    return np.array([m.log_likelihood(poses) for m in measurements]).reshape(-1, poses.shape[0])


def evidences(log_weights: FloatArray, log_likelihoods: FloatArray) -> tuple[float, list[float]]:
    """log Σ W e^{Σℓ} of all sensors together, and log Σ W e^ℓ of each, for log W (N,) and log-likelihoods (S, N)."""
    each = [log_sum_exp(log_weights + row) for row in log_likelihoods]
    return each[0] if len(each) == 1 else log_sum_exp(log_weights + log_likelihoods.sum(axis=0)), each


def temper(alphas: Sequence[float], log_likelihoods: FloatArray) -> FloatArray:
    """Σ_sensors α_s · log p_s (N,): the temperature applies to what is new, never to a carried weight."""
    total = np.zeros(log_likelihoods.shape[1])
    for alpha, log_likelihood in zip(alphas, log_likelihoods, strict=True):
        total += alpha * log_likelihood
    return total


def log_sum_exp(values: FloatArray) -> float:
    """log Σ e^v without overflow; −inf for all −inf. NaN and +inf pass through."""
    peak = float(values.max())
    if not math.isfinite(peak):
        return peak
    return peak + float(np.log(np.exp(values - peak).sum()))


def softmax(log_weights: FloatArray) -> tuple[FloatArray, float]:
    """Weights (N,) proportional to e^log_weights, summing to 1 ± 1e-12, and log Σ e^log_weights; to be ``usable``."""
    peak = float(log_weights.max())
    weights: FloatArray = np.exp(log_weights - peak)
    total = weights.sum()
    weights /= total
    return weights, peak + float(np.log(total))


def normalise(log_weights: FloatArray) -> FloatArray:
    """Weights of ``softmax`` alone."""
    return softmax(log_weights)[0]


def usable(log_weights: FloatArray) -> bool:
    """Whether weights can be normalised: no NaN, no +inf, not all −inf."""
    return math.isfinite(log_weights.max())  # the maximum of an array with a NaN is NaN


def effective_sample_size(weights: FloatArray) -> float:
    """1 / ΣW², between 1 and N. Source: Kong, Liu, Wong 1994."""
    return 1.0 / float((weights * weights).sum())


def uniform_log_weights(n: int) -> FloatArray:
    """log(1/n), n times."""
    return np.full(n, -np.log(n))
