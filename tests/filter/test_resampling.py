"""Every registered resampler keeps the contract: ascending ancestors, in range, unbiased."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter.resampling import RESAMPLERS
from tests.reference import filter as naive

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

each = pytest.mark.parametrize("name", RESAMPLERS)
raw = st.lists(st.one_of(st.just(0.0), st.floats(1e-6, 1.0)), min_size=1, max_size=30)
weight_sets = raw.filter(lambda w: sum(w) > 0.0).map(lambda w: np.array(w) / math.fsum(w))
seeds = st.integers(0, 2**32 - 1)


class Fixed:
    """A generator whose every uniform is the same number."""

    def __init__(self, uniform: float) -> None:
        self.uniform = uniform

    def random(self, size: int | None = None) -> Any:
        return self.uniform if size is None else np.full(size, self.uniform)

    def standard_exponential(self, size: int) -> FloatArray:
        return np.full(size, -math.log(max(self.uniform, 1e-300)))


@each
@given(weights=weight_sets, n=st.integers(1, 50), seed=seeds)
def test_ancestors_ascend_in_range_and_have_weight(name: str, weights: FloatArray, n: int, seed: int) -> None:
    ancestors = RESAMPLERS[name](weights, n, np.random.default_rng(seed))
    assert ancestors.shape == (n,)
    assert ancestors.dtype == np.int64
    assert (np.diff(ancestors) >= 0).all()
    assert ancestors[0] >= 0
    assert ancestors[-1] < weights.size
    assert (weights[ancestors] > 0.0).all()


@each
@pytest.mark.parametrize("uniform", [0.0, 1e-300, 0.5, np.nextafter(1.0, 0.0)])
@pytest.mark.parametrize("n", [1, 2, 3, 7, 64, 1000])
def test_extreme_draws_never_pick_what_weighs_nothing(name: str, uniform: float, n: int) -> None:
    weights = np.array([0.0, 0.0, 0.3, 0.0, 0.7, 0.0])
    ancestors = RESAMPLERS[name](weights, n, Fixed(uniform))  # type: ignore[arg-type]
    assert set(ancestors.tolist()) <= {2, 4}


@each
def test_every_resampler_is_unbiased(name: str) -> None:
    weights = np.array([0.02, 0.0, 0.4, 0.13, 0.05, 0.4])
    n, rounds = 7, 6000
    generator = np.random.default_rng(8)
    counts = np.array([np.bincount(RESAMPLERS[name](weights, n, generator), minlength=6) for _ in range(rounds)])
    noise = np.sqrt(n * weights * (1 - weights) / rounds)  # of independent draws: the largest of all schemes
    assert (np.abs(counts.mean(axis=0) - n * weights) <= 4.0 * noise).all()


@each
def test_no_resampler_scatters_more_than_independent_draws(name: str) -> None:
    weights = np.array([0.1, 0.25, 0.3, 0.35])
    generator = np.random.default_rng(3)
    counts = np.array([np.bincount(RESAMPLERS[name](weights, 9, generator), minlength=4) for _ in range(4000)])
    assert (counts.var(axis=0) <= 1.1 * 9 * weights * (1 - weights)).all()


@given(weights=weight_sets, n=st.integers(1, 50), seed=seeds)
def test_systematic_draws_floor_or_ceiling(weights: FloatArray, n: int, seed: int) -> None:
    ancestors = RESAMPLERS["systematic"](weights, n, np.random.default_rng(seed))
    counts = np.bincount(ancestors, minlength=weights.size)
    assert (counts >= np.floor(n * weights - 1e-9)).all()
    assert (counts <= np.ceil(n * weights + 1e-9)).all()


@given(
    parts=st.lists(st.integers(0, 8), min_size=1, max_size=12).filter(any),
    n=st.integers(1, 30),
    offset=st.floats(0.01, 0.99),
)
def test_systematic_agrees_with_a_walk_along_the_weights(parts: list[int], n: int, offset: float) -> None:
    weights = np.array(parts) / sum(parts)
    edges = np.cumsum(weights) * n - offset
    if np.abs(edges - np.rint(edges)).min() > 1e-9:  # a pointer on an edge may fall to either side by rounding
        expected = naive.systematic(weights.tolist(), n, offset)
        assert RESAMPLERS["systematic"](weights, n, Fixed(offset)).tolist() == expected  # type: ignore[arg-type]


@each
def test_all_the_weight_on_one_particle_leaves_only_that_one(name: str) -> None:
    weights = np.zeros(1000)
    weights[617] = 1.0
    assert set(RESAMPLERS[name](weights, 1000, np.random.default_rng(0)).tolist()) == {617}


@pytest.mark.parametrize("name", ["systematic", "stratified"])
def test_equal_weights_leave_every_particle_once_or_nearly(name: str) -> None:
    ancestors = RESAMPLERS[name](np.full(500, 1 / 500), 500, np.random.default_rng(0))
    assert np.abs(ancestors - np.arange(500)).max() <= 1


def test_a_million_particles_keep_their_proportions() -> None:
    weights = np.full(1_000_000, 1e-6)
    ancestors = RESAMPLERS["systematic"](weights, 1_000_000, np.random.default_rng(0))
    assert np.unique(ancestors).size > 999_000


@each
def test_the_same_stream_gives_the_same_ancestors(name: str) -> None:
    weights = np.random.default_rng(1).dirichlet(np.ones(50))
    first, second = (RESAMPLERS[name](weights, 50, np.random.default_rng(2)) for _ in range(2))
    assert first.tobytes() == second.tobytes()
