"""A resampler that takes the likeliest particle every time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray


def likeliest(weights: FloatArray, n: int, rng: np.random.Generator, backend: Backend = NUMPY) -> IntArray:
    """Ancestors (n,) int64: the heaviest, n times."""
    del rng, backend
    return np.full(n, np.argmax(weights), np.int64)
