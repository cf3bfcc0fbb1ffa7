"""How well a reading fits, and what a temperature makes of it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter import fit, temperature
from mclcli.filter.weights import evidences
from mclcli.replay.setup import lidar_model
from mclcli.sensors import Measurement, Temperature
from mclcli.sensors.beams import Beams
from mclcli.settings import Profile, profiles
from mclcli.world import distance_field
from tests.replay.replays import MODEL
from tests.support import level, sightings
from tests.worlds import drawn

ROOM = drawn("##########\n" + "#........#\n" * 6 + "##########", 0.5)


def saying(*values: float, floor: float = -10.0, alpha: Temperature = "auto", count: int = 1) -> Measurement:
    return Measurement("lidar", lambda _: np.array(values), count, 0.0, alpha, log_floor=floor)


def each(measurement: Measurement, weights: list[float]) -> float:
    logs = measurement.log_likelihood(np.zeros((len(weights), 3)))[np.newaxis]
    _, of_each = evidences(np.log(weights), logs)
    return fit.of_each([measurement], of_each)[0]


def test_a_fit_lies_between_nothing_and_everything() -> None:
    assert each(saying(0.0, 0.0), [0.5, 0.5]) == pytest.approx(1.0)
    assert each(saying(-10.0, -10.0), [0.5, 0.5]) == pytest.approx(0.0, abs=1e-12)
    assert each(saying(-4.0, -4.0), [0.5, 0.5]) == pytest.approx(0.6)
    assert each(saying(-12.0, 3.0), [0.5, 0.5]) == 1.0


def test_the_best_particles_decide() -> None:
    """One of a thousand that fits perfectly costs log 1000 of what 60 beams could lose, 2 nats each."""
    fits = each(
        Measurement("lidar", lambda p: np.where(np.arange(len(p)), -120.0, 0.0), 60, 0.0, log_floor=-120.0),
        [1e-3] * 1000,
    )
    assert fits == pytest.approx(1.0 - math.log(1000) / 120.0)


def test_without_a_reading_or_a_floor_nothing_speaks_against_a_fit() -> None:
    assert each(saying(0.0, count=0), [1.0]) == 1.0
    assert each(saying(-5.0, floor=-math.inf), [1.0]) == 1.0
    assert fit.of_all([], 0.0) == 0.0
    assert fit.of_all([saying(0.0)], -math.inf) == 0.0
    assert fit.of_all([saying(0.0)], math.nan) == 0.0


@pytest.mark.parametrize(("how_well", "factor"), [(0.8, 1.0), (0.65, 0.5), (0.56, 0.2), (0.5, 0.05), (0.1, 0.05)])
def test_trust_falls_in_proportion_between_its_bounds(how_well: float, factor: float) -> None:
    assert fit.trust(how_well, 0.5, 0.8) == pytest.approx(factor)


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_trust_grows_with_the_fit(one: float, ignored: float, trusted: float) -> None:
    low, high = sorted((ignored, trusted))
    assert 0.05 <= fit.trust(one, low, high) <= fit.trust(min(1.0, one + 0.1), low, high) <= 1.0
    assert fit.trust(high, low, high) == 1.0


@pytest.mark.parametrize(("alpha", "expected"), [("auto", 0.5 * 0.05), (0.3, 0.3), ("ess", 1.0)])
def test_only_auto_heeds_the_fit(alpha: Temperature, expected: float) -> None:
    measurement = Measurement("lidar", lambda p: np.zeros(len(p)), 4, 0.0, alpha, lambda _: np.zeros(4))

    def resolved(fits: list[float] | None) -> tuple[float, ...]:
        one = np.zeros((1, 3)), np.log([1 / 3] * 3)
        return temperature.resolve([measurement], *one, {}, 0.05, fits, (0.5, 0.8))

    assert resolved([0.2]) == pytest.approx((expected,))
    assert resolved([0.9]) == resolved(None)


def test_where_a_model_cannot_tell_what_checks_it_does() -> None:
    check = Measurement("lidar", lambda p: -np.abs(p[:, 0]), 4, 0.0, log_floor=-2.0)
    own = Measurement("lidar", lambda p: np.full(len(p), 7.0), 4, 9.0, log_floor=6.0)
    cloud, all_but_one = np.array([[9.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), np.array([0.0, 1.0])
    assert fit.of_update([own], 7.0, cloud, all_but_one) == pytest.approx(1 / 3)
    checked = dataclasses.replace(own, check=check)
    assert fit.of_update([checked], 7.0, cloud, all_but_one) == pytest.approx(0.75)
    halves = fit.of_update([checked], 7.0, cloud, np.array([0.5, 0.5]))
    assert halves == pytest.approx(1.0 + math.log((math.exp(-9.0) + math.exp(-0.5)) / 2) / 2)
    other = Measurement("vision", lambda p: -3.0 * p[:, 0], 1, 0.0, log_floor=-4.0)
    both = [checked, other, Measurement("lidar_2", other.log_likelihood, 0, 0.0)]
    assert fit.of_update(both, 7.0, cloud, all_but_one) == pytest.approx(1.0 - 2.0 / 6.0)


@pytest.mark.parametrize("model", list(profiles.MODELS))
@pytest.mark.parametrize("profile", list(profiles.PROFILES))
def test_every_model_knows_its_floor(profile: Profile, model: str) -> None:
    """Somewhere in a room a scan fits better than one that has nothing to do with it; nowhere far outside it does."""
    settings = profiles.build({}, profile=profile, model=model)
    measured = lidar_model(ROOM, settings, distance_field.compute)
    angles = np.linspace(-2.0, 2.0, 9)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    beams = Beams(np.zeros((9, 2)), directions, np.full(9, 1.2), 8.0, np.arange(9), 9)
    measurement = measured.measure("lidar", beams)
    assert measurement.log_floor < measurement.log_peak
    inside = np.column_stack([*np.random.default_rng(1).uniform(0.5, [4.5, 3.5], (300, 2)).T, np.zeros(300)])
    logs = measurement.log_likelihood(inside)
    assert measurement.log_floor - 1e-9 <= logs.max() <= measurement.log_peak + 1e-9


def test_bearings_know_their_floor() -> None:
    from mclcli.sensors.bearing import observe
    from mclcli.world.landmarks import Landmarks

    posts = Landmarks(("post",), np.array([[3.0, 0.0, 0.0]]))
    seen = observe(sightings(0, ["post", "other"], level(0.0, 1.0)), np.eye(4), posts)
    measurement = MODEL.measure("vision", seen)
    best, worst = measurement.log_likelihood(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, math.pi]]))
    assert (best, worst) == pytest.approx((measurement.log_peak, measurement.log_floor))
