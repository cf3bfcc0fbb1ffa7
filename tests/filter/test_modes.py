"""Places that a start has found are kept alive until the readings have chosen one."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import Localizer, initial_state
from mclcli.filter.modes import Modes
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.resampling import RESAMPLERS
from mclcli.native.backend import NUMPY
from mclcli.sensors import Measurement
from tests.filter.test_localizer_policies import QUIET

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

if TYPE_CHECKING:
    from mclcli.records import StepRecord

N = 1000
AHEAD = np.array([0.5, 0.0, 0.0])


def run(log_odds: list[float], share: float = 0.9) -> list[StepRecord]:
    """Steps of a robot at x = 0 or at x = 100, with evidence for the former, in nats an update."""
    places = (np.arange(N) >= share * N).astype(np.int64)
    poses = np.zeros((N, 3))
    poses[:, 0] = 100.0 * places
    localizer = Localizer(QUIET, FilterParameters(resample_ess=1.0), 0, KldParameters(N, N))
    state, records = initial_state(poses, 0, places), []
    for stamp, odds in enumerate(log_odds):
        measurement = Measurement("lidar", functools.partial(near, odds), 1, 1.0)
        state, record = localizer.step(state, AHEAD, [measurement], stamp)
        records.append(record)
    return records


def near(odds: float, poses: FloatArray) -> FloatArray:
    return np.where(poses[:, 0] < 60.0, odds, 0.0)


def weight_ahead(record: StepRecord) -> float:
    return float(record.weights[record.poses[:, 0] < 60.0].sum())


def test_weights_are_those_of_exact_inference_whatever_the_numbers_of_particles() -> None:
    """0.9 against 0.1, and then 1, 2, −3 nats."""
    records = run([1.0, 2.0, -3.0])
    for record, nats in zip(records, [1.0, 3.0, 0.0], strict=True):
        odds = 9.0 * np.exp(nats)
        assert weight_ahead(record) == pytest.approx(odds / (1.0 + odds), abs=1e-9)


def test_a_place_that_fits_badly_for_a_while_comes_back() -> None:
    """−6 nats in all leave it 2 particles of 1,000 in proportion; it keeps 50."""
    records = run([2.0, 2.0, 2.0, -9.0])
    assert np.count_nonzero(records[3].poses[:, 0] >= 60.0) == pytest.approx(50, abs=1)
    assert weight_ahead(records[3]) == pytest.approx(9.0 * np.exp(-3.0) / (1.0 + 9.0 * np.exp(-3.0)), abs=1e-9)


def test_one_is_chosen_after_two_metres_of_hardly_any_doubt() -> None:
    """0.5 m an update: 0.99 from the second on, four more."""
    records = run([0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert [record.modes for record in records] == [2, 2, 2, 2, 0, 0, 0]
    assert np.count_nonzero(records[-1].poses[:, 0] >= 60.0) < 5


def test_doubt_begins_the_count_anew() -> None:
    assert all(record.modes == 2 for record in run([4.0, 0.0, -2.0, 2.0, 0.0]))


def test_one_is_chosen_after_ten_updates_at_rest() -> None:
    modes: Modes | None = Modes(np.array([0, 1]))
    for _ in range(9):
        assert modes is not None
        modes = modes.weighed(np.array([0.995, 0.005]), np.zeros(3))
    assert modes is not None
    assert modes.weighed(np.array([0.995, 0.005]), np.zeros(3)) is None


def test_a_single_place_needs_no_strata() -> None:
    assert initial_state(np.zeros((4, 3)), 0, np.zeros(4, np.int64)).modes is None
    assert initial_state(np.zeros((4, 3))).modes is None


def test_the_last_place_left_is_chosen() -> None:
    assert [record.modes for record in run([30.0, 0.0])] == [2, 0]


def test_many_places_share_few_particles_and_hopeless_ones_are_given_up() -> None:
    """Each has 3 of 60 at least; the one with a weight of 1e-9 none."""
    weights = np.full(10, (1.0 - 1e-9) / 9.0)
    weights[4] = 1e-9
    ancestors, log_weights, modes = Modes(np.arange(10)).resample(
        weights, 60, RESAMPLERS["systematic"], np.random.default_rng(0), NUMPY
    )
    counts = np.bincount(modes.labels, minlength=10)
    assert counts[4] == 0
    assert np.delete(counts, 4).min() >= 3
    assert counts.sum() == 60
    np.testing.assert_array_equal(ancestors, modes.labels)
    assert np.exp(log_weights).sum() == pytest.approx(1.0, abs=1e-12)
