"""Temperatures: from the sample they leave, and from the correlation of neighbouring beams."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter import temperature
from mclcli.filter.temperature import Correlation, conditional_ess, correlate, largest_alpha
from mclcli.filter.weights import uniform_log_weights
from mclcli.sensors import Measurement, Temperature

GENERATOR = np.random.default_rng(5)
LOGS = st.lists(st.floats(-300.0, 0.0), min_size=2, max_size=30)


def naive_conditional_ess(weights: list[float], logs: list[float], alpha: float) -> float:
    top = max(logs)
    likelihood = [np.exp(alpha * (value - top)) for value in logs]
    first = sum(w * p for w, p in zip(weights, likelihood, strict=True))
    return float(len(logs) * first**2 / sum(w * p * p for w, p in zip(weights, likelihood, strict=True)))


@given(logs=LOGS, alpha=st.floats(0.02, 1.0))
def test_the_conditional_ess_is_its_formula(logs: list[float], alpha: float) -> None:
    weights = np.linspace(1.0, 2.0, len(logs))
    weights /= weights.sum()
    found = conditional_ess(np.log(weights), np.array(logs), alpha)
    assert found == pytest.approx(naive_conditional_ess(weights.tolist(), logs, alpha), rel=1e-9)


@given(LOGS)
def test_the_conditional_ess_falls_monotonically(logs: list[float]) -> None:
    sizes = [conditional_ess(uniform_log_weights(len(logs)), np.array(logs), a) for a in np.linspace(0.0, 1.0, 21)]
    assert sizes[0] == pytest.approx(len(logs))
    assert all(later <= earlier * (1.0 + 1e-12) for earlier, later in itertools.pairwise(sizes))


def test_bisection_finds_where_the_sample_is_as_large_as_asked() -> None:
    logs = GENERATOR.normal(0.0, 40.0, 500)
    carried = uniform_log_weights(500)
    alpha = largest_alpha(carried, logs, 0.05)
    assert 0.02 < alpha < 1.0
    assert conditional_ess(carried, logs, alpha) == pytest.approx(25.0, rel=1e-6)


@pytest.mark.parametrize(("spread", "expected"), [(1e-6, 1.0), (1e9, 0.02)])
def test_alpha_stays_within_its_bounds(spread: float, expected: float) -> None:
    alpha = largest_alpha(uniform_log_weights(100), GENERATOR.normal(0.0, spread, 100), 0.5)
    assert alpha == pytest.approx(expected, abs=1e-9)


def test_nothing_is_tempered_where_no_weight_is_usable() -> None:
    assert largest_alpha(uniform_log_weights(3), np.array([np.nan, 0.0, 0.0]), 0.5) == 1.0


def series(rho: float, size: int) -> np.ndarray:
    """An autoregression of first order: its autocorrelations are rho, rho², …, hence Σ = rho/(1 − rho)."""
    noise = GENERATOR.standard_normal(size)
    values = np.empty(size)
    values[0] = noise[0]
    for i in range(1, size):
        values[i] = rho * values[i - 1] + np.sqrt(1 - rho**2) * noise[i]
    return values


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.6])
def test_auto_finds_the_effective_number_of_beams(rho: float) -> None:
    found = None
    alphas = []
    for _ in range(60):
        found = correlate(series(rho, 300), found)
        alphas.append(found.alpha)
    assert np.median(alphas[20:]) == pytest.approx((1 - rho) / (1 + rho), rel=0.15)


@pytest.mark.parametrize("size", [1, 2, 60, 61, 62, 300])
def test_autocovariances_are_their_formula(size: int) -> None:
    values = GENERATOR.standard_normal(size)
    mean = sum(values) / size
    expected = [sum((values[i] - mean) * (values[i + k] - mean) for i in range(size - k)) / size for k in range(61)]
    np.testing.assert_allclose(correlate(values).covariances, expected, rtol=0, atol=1e-14)


def test_the_running_average_takes_a_tenth_of_each_new_scan() -> None:
    first, second = GENERATOR.standard_normal(80), GENERATOR.standard_normal(80) + 3.0
    after = correlate(second, correlate(first))
    assert after.mean == pytest.approx(0.9 * first.mean() + 0.1 * second.mean(), rel=1e-12)
    before = correlate(first).covariances[0]
    assert after.covariances[0] == pytest.approx(0.9 * before + 0.1 * np.mean((second - after.mean) ** 2), rel=1e-12)


def test_auto_is_bounded_and_starts_in_the_middle() -> None:
    assert Correlation(0.0, np.zeros(61)).alpha == 0.5
    assert correlate(np.repeat(GENERATOR.standard_normal(2), 200)).alpha == 0.05
    assert correlate(np.tile([1.0, -1.0], 50)).alpha == 1.0


def test_auto_leaves_what_has_no_neighbours() -> None:
    """Sightings of landmarks stand in no order: they count as independent."""
    alone = Measurement("vision", lambda poses: np.zeros(len(poses)), 3, 0.0, "auto")
    assert temperature.resolve([alone], np.zeros((1, 5)), uniform_log_weights(5), {}, 0.05) == (1.0,)


def measurement(sensor: str, alpha: Temperature) -> Measurement:
    return Measurement(sensor, lambda poses: np.zeros(len(poses)), 9, 0.0, alpha, lambda _: series(0.5, 9)[np.newaxis])


def test_each_sensor_has_its_own_and_ess_is_shared() -> None:
    logs = GENERATOR.normal(0.0, 30.0, (4, 200))
    sensors = [measurement("a", 0.3), measurement("b", "ess"), measurement("c", "ess"), measurement("d", "auto")]
    carried = uniform_log_weights(200)
    known = {"d": Correlation(0.0, np.array([1.0, 0.5, -0.1]))}
    alphas = temperature.resolve(sensors, logs, carried, known, 0.05)
    joint = largest_alpha(carried, logs[1] + logs[2], 0.05)
    assert alphas == (0.3, joint, joint, 0.5)


def test_only_auto_looks_at_the_beams() -> None:
    seen = temperature.observe([measurement("a", 0.3), measurement("b", "auto")], np.zeros(3), {})
    assert set(seen) == {"b"}


@pytest.mark.parametrize(("count", "seen"), [(1, set()), (2, {"lidar"})])
def test_one_beam_has_no_neighbour_to_correlate_with(count: int, seen: set[str]) -> None:
    beams = np.arange(1.0, count + 1.0)[np.newaxis]
    few = Measurement("lidar", lambda poses: np.zeros(len(poses)), count, 0.0, "auto", lambda _: beams)
    assert set(temperature.observe([few], np.zeros(3), {})) == seen
