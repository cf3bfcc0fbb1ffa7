"""Residual resampling: what is certain is certain, and only the rest is left to chance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter.resampling import RESAMPLERS, residual

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray

parts = st.lists(st.integers(0, 40), min_size=1, max_size=30).filter(any)


def counts(weights: FloatArray, n: int, seed: int) -> IntArray:
    """How often each particle is drawn."""
    return np.bincount(residual(weights, n, np.random.default_rng(seed)), minlength=weights.size)


@given(parts, st.integers(1, 80), st.integers(0, 2**32 - 1))
def test_every_particle_is_drawn_at_least_as_often_as_is_certain(shares: list[int], n: int, seed: int) -> None:
    drawn = counts(np.array(shares) / sum(shares), n, seed)
    expected = np.array([n * share / sum(shares) for share in shares])
    assert drawn.sum() == n
    assert (drawn >= np.floor(expected - 1e-9)).all()
    assert not drawn[expected == 0.0].any()


@given(st.lists(st.integers(1, 9), min_size=1, max_size=12), st.integers(0, 2**32 - 1))
def test_whole_numbers_of_copies_leave_nothing_to_chance(copies: list[int], seed: int) -> None:
    size = 2 ** int(np.ceil(np.log2(sum(copies))))
    wanted = [*copies, size - sum(copies)]  # of a power of two, so that n·W is exact
    assert counts(np.array(wanted) / size, size, seed).tolist() == wanted


def test_what_remains_is_drawn_in_proportion() -> None:
    weights, n, rounds = np.array([0.43, 0.27, 0.21, 0.09]), 5, 8000
    generator = np.random.default_rng(11)
    drawn = np.array([np.bincount(residual(weights, n, generator), minlength=4) for _ in range(rounds)])
    assert (drawn.min(axis=0) == [2, 1, 1, 0]).all()
    left = (n * weights - [2, 1, 1, 0]) / 1  # of the one draw that is left
    np.testing.assert_allclose(drawn.mean(axis=0) - [2, 1, 1, 0], left, atol=4 * 0.5 / np.sqrt(rounds))


def test_it_scatters_less_than_independent_draws() -> None:
    weights, n = np.random.default_rng(5).dirichlet(np.ones(8)), 40
    spread = {}
    for name in ("residual", "multinomial"):
        generator = np.random.default_rng(6)
        drawn = [np.bincount(RESAMPLERS[name](weights, n, generator), minlength=8) for _ in range(1500)]
        spread[name] = np.var(drawn, axis=0).sum()
    assert spread["residual"] < 0.35 * spread["multinomial"]


@pytest.mark.parametrize("scale", [1.0 - 1e-12, 1.0, 1.0 + 1e-12])
def test_weights_whose_sum_is_off_by_rounding_give_as_many_as_asked_for(scale: float) -> None:
    assert counts(np.full(3000, scale / 3000), 3000, 0).sum() == 3000
    assert counts(np.full(7, scale / 7), 1_000_000, 0).sum() == 1_000_000
