"""Weights in log domain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


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
