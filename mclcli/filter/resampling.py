"""Resampling schemes, one signature: (weights (N,), n, rng, backend) → ancestors (n,) int64, indices.

All are unbiased: particle i is drawn n·W_i times on average. Weights are ≥ 0 and sum to 1.
Source: Douc, Cappé, Moulines 2005.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray


_BELOW_ONE = np.nextafter(1.0, 0.0)  # (n − 1 + u) / n rounds up to 1 for the u nearest to 1


class Resampler(Protocol):
    """Draws ancestors in proportion to their weights."""

    def __call__(self, weights: FloatArray, n: int, rng: np.random.Generator, backend: Backend = NUMPY) -> IntArray:
        """Ancestors (n,) int64, ascending."""
        ...


def systematic(weights: FloatArray, n: int, rng: np.random.Generator, backend: Backend = NUMPY) -> IntArray:
    """One random offset, n equally spaced pointers: every particle is drawn ⌊nW⌋ or ⌈nW⌉ times."""
    return _ancestors(weights, (np.arange(n) + rng.random()) / n, backend)


def stratified(weights: FloatArray, n: int, rng: np.random.Generator, backend: Backend = NUMPY) -> IntArray:
    """One pointer drawn from each of n equal strata."""
    return _ancestors(weights, (np.arange(n) + rng.random(n)) / n, backend)


def multinomial(weights: FloatArray, n: int, rng: np.random.Generator, backend: Backend = NUMPY) -> IntArray:
    """n independent draws, as ordered uniforms from normalised exponential spacings, O(n)."""
    spacings = np.cumsum(rng.standard_exponential(n + 1))
    return _ancestors(weights, spacings[:-1] / spacings[-1], backend)


def residual(weights: FloatArray, n: int, rng: np.random.Generator, backend: Backend = NUMPY) -> IntArray:
    """⌊nW⌋ copies of every particle for certain, the rest drawn independently by what remains of nW.

    Source: Liu and Chen 1998, section 3.2.
    """
    expected = n * (weights / np.sum(weights))
    copies = np.floor(expected).astype(np.int64)
    missing = n - int(copies.sum())
    if missing:
        drawn = multinomial(expected - copies, missing, rng, backend)
        copies += np.bincount(drawn, minlength=weights.size)
    return np.repeat(np.arange(weights.size), copies)


def _ancestors(weights: FloatArray, pointers: FloatArray, backend: Backend) -> IntArray:
    cumulative = np.cumsum(weights)
    cumulative /= cumulative[-1]  # the last entry is exactly 1, so that no pointer < 1 falls off the end
    pointers = np.minimum(pointers, _BELOW_ONE)
    kernels = backend.kernels("particles")
    if kernels is None:
        return np.searchsorted(cumulative, pointers, side="right")
    chosen = np.empty(pointers.size, np.int64)
    kernels.ancestors(cumulative, pointers, chosen)
    return chosen


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
}
