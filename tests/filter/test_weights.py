"""Weights in log domain: log-sum-exp, normalisation, effective sample size, weights."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter import weights
from mclcli.sensors import Measurement
from tests.reference import filter as naive

if TYPE_CHECKING:
    from random import Random

    from mclcli.arrays import FloatArray

logs = st.lists(st.floats(-1e4, 1e3), min_size=1, max_size=40).map(np.array)


@given(logs)
def test_log_sum_exp_agrees_with_the_equation(values: FloatArray) -> None:
    assert weights.log_sum_exp(values) == pytest.approx(naive.log_sum_exp(values.tolist()), rel=1e-12, abs=1e-12)


@given(logs, st.floats(-1e4, 1e4))
def test_a_shift_comes_out_in_front(values: FloatArray, shift: float) -> None:
    shifted = weights.log_sum_exp(values + shift)
    assert shifted == pytest.approx(weights.log_sum_exp(values) + shift, rel=1e-12, abs=1e-9)
    np.testing.assert_allclose(weights.normalise(values + shift), weights.normalise(values), rtol=0, atol=1e-9)


@given(logs)
def test_weights_sum_to_one(values: FloatArray) -> None:
    normalised = weights.normalise(values)
    assert abs(math.fsum(normalised.tolist()) - 1.0) <= 1e-12
    np.testing.assert_allclose(normalised, naive.normalise(values.tolist()), rtol=1e-9, atol=1e-300)


@given(logs)
def test_the_softmax_knows_its_total(values: FloatArray) -> None:
    shares, total = weights.softmax(values)
    np.testing.assert_array_equal(shares, weights.normalise(values))
    assert total == weights.log_sum_exp(values)


@pytest.mark.parametrize("n", [1, 1000, 300_000])
def test_many_weights_sum_to_one_too(n: int) -> None:
    values = np.random.default_rng(0).normal(-500.0, 20.0, n)
    assert abs(math.fsum(weights.normalise(values).tolist()) - 1.0) <= 1e-12


@given(logs, st.randoms(use_true_random=False))
def test_the_order_of_particles_does_not_matter(values: FloatArray, random: Random) -> None:
    order = list(range(values.size))
    random.shuffle(order)
    np.testing.assert_allclose(weights.normalise(values[order]), weights.normalise(values)[order], rtol=1e-12)


def test_huge_and_tiny_logarithms_neither_overflow_nor_vanish() -> None:
    assert weights.log_sum_exp(np.array([1e4, 1e4])) == pytest.approx(1e4 + math.log(2))
    assert weights.normalise(np.array([-1e6, -1e6, -2e6])).tolist() == [0.5, 0.5, 0.0]


def test_impossible_particles_weigh_nothing() -> None:
    assert weights.normalise(np.array([-math.inf, 0.0, 0.0])).tolist() == [0.0, 0.5, 0.5]
    assert weights.log_sum_exp(np.array([-math.inf, -math.inf])) == -math.inf


@pytest.mark.parametrize(
    ("values", "usable"),
    [
        ([0.0, -1.0], True),
        ([-math.inf, -1.0], True),
        ([-math.inf, -math.inf], False),
        ([math.nan, 0.0], False),
        ([0.0, math.nan], False),
        ([math.inf, 0.0], False),
    ],
)
def test_what_can_be_normalised(values: list[float], usable: bool) -> None:  # noqa: FBT001
    assert weights.usable(np.array(values)) is usable


@given(logs)
def test_the_effective_sample_size_lies_between_one_and_all(values: FloatArray) -> None:
    ess = weights.effective_sample_size(weights.normalise(values))
    assert 1.0 - 1e-12 <= ess <= values.size * (1 + 1e-12)


def test_effective_sample_size_of_known_sets() -> None:
    assert weights.effective_sample_size(np.full(8, 0.125)) == 8.0
    assert weights.effective_sample_size(np.array([1.0, 0.0, 0.0])) == 1.0
    assert weights.effective_sample_size(np.array([0.5, 0.5, 0.0])) == 2.0


def saying(values: list[float], alpha: float) -> Measurement:
    return Measurement("s", lambda poses: np.asarray(values[: len(poses)]), 1, 0.0, alpha)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12), st.floats(1e-3, 1.0))
def test_the_best_pose_stays_the_best_under_any_temperature(values: list[float], alpha: float) -> None:
    poses = np.zeros((len(values), 3))
    tempered = weights.temper([alpha], weights.score([saying(values, alpha)], poses))
    assert tempered[np.argmax(values)] == tempered.max()


def test_each_sensor_has_its_own_temperature() -> None:
    sensors = [saying([1.0, 2.0], 0.5), saying([10.0, -4.0], 0.25)]
    scores = weights.score(sensors, np.zeros((2, 3)))
    assert scores.tolist() == [[1.0, 2.0], [10.0, -4.0]]
    assert weights.temper([0.5, 0.25], scores).tolist() == [3.0, 0.0]


def test_without_sensors_there_is_nothing_to_weigh() -> None:
    scores = weights.score([], np.zeros((4, 3)))
    assert scores.shape == (0, 4)
    assert weights.temper([], scores).tolist() == [0.0] * 4
