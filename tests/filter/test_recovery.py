"""When particles are drawn anew, how many, and from where."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import UsageError
from mclcli.filter import recovery
from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import Localizer, initial_state
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.recovery import Averages, FromAnywhere, RecoveryParameters
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.sensors import Measurement
from tests.reference import recovery as naive
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.filter.recovery import RecoveryRule
    from mclcli.records import StepRecord

QUIET = DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.0, 0.0))
STILL = np.zeros(3)
N = 100
RATES = RecoveryParameters("uniform", 0.05, 0.4)
fits = st.lists(st.floats(-400.0, 5.0), min_size=1, max_size=30)


@given(fits, st.floats(0.0, 0.3), st.floats(0.3, 1.0))
def test_the_averages_are_those_of_the_book(values: list[float], slow: float, fast: float) -> None:
    averages: Averages | None = None
    for value in values:
        averages = recovery.observe(averages, value / 100, RecoveryParameters("uniform", slow, fast))
    assert averages is not None
    expected = naive.averages([math.exp(value / 100) for value in values], slow, fast)
    assert (math.exp(averages.log_slow), math.exp(averages.log_fast)) == pytest.approx(expected, rel=1e-9)
    assert averages.share == pytest.approx(naive.share(*expected), abs=1e-9)


@given(fits)
def test_whole_likelihoods_never_vanish(values: list[float]) -> None:
    averages: Averages | None = None
    for value in values:
        averages = recovery.observe(averages, 20 * value - 3000, RATES)
    assert averages is not None
    assert math.isfinite(averages.log_slow)
    assert 0.0 <= averages.share <= 1.0


def test_nothing_to_judge_changes_nothing() -> None:
    assert recovery.observe(None, None, RATES) is None
    before = Averages(-1.0, -2.0)
    assert recovery.observe(before, None, RATES) == before


def run(
    fits_per_beam: list[float], rule: RecoveryRule = "per_beam", beams: int = 10, seed: int = 0
) -> list[StepRecord]:
    """Steps whose particles all fit alike."""
    parameters = RecoveryParameters("uniform", 0.01, 0.5, rule)
    localizer = Localizer(QUIET, FilterParameters(), seed, KldParameters(N, N), parameters)
    state, records = initial_state(np.zeros((N, 3))), []
    for stamp, fit in enumerate(fits_per_beam):
        same = Measurement("lidar", lambda p, fit=fit: np.full(len(p), beams * math.log(fit)), beams, 0.0)  # type: ignore[misc]
        state, record = localizer.step(state, STILL, [same], stamp, propose=anew)
        records.append(record)
    return records


def anew(record: StepRecord, n: int, rng: np.random.Generator) -> FloatArray:
    """Far away, where nobody was."""
    del record
    return np.full((n, 3), 50.0) + rng.random((n, 3))


def test_readings_that_fit_as_before_draw_no_particle_anew() -> None:
    assert [record.injected for record in run([0.8] * 6)] == [0] * 6
    assert not any(record.resampled for record in run([0.8] * 6))


def test_readings_that_fit_worse_draw_a_share_anew() -> None:
    """Fast average (0.8 + 0.4)/2 against a slow one of 0.796: 24.6 % of the particles."""
    records = run([0.8] * 4 + [0.4, 0.4])
    assert records[4].injected in {24, 25}
    assert records[4].resampled
    last = records[5].poses
    assert np.count_nonzero(last[:, 0] > 40.0) == records[4].injected
    assert len(last) == N
    np.testing.assert_allclose(records[5].weights, 1 / N)


def test_the_number_drawn_anew_is_right_on_average() -> None:
    """1 − (0.8 + 0.4)/2 / (0.99·0.8 + 0.01·0.4) of 100 is 24.62: 24 or 25, which of them is drawn by lot."""
    counts = [run([0.8, 0.4], seed=seed)[1].injected for seed in range(100)]
    assert set(counts) == {24, 25}
    assert np.mean(counts) == pytest.approx(24.62, abs=0.15)  # three standard deviations of the mean


def test_more_beams_do_not_make_a_robot_more_lost() -> None:
    few, many = (run([0.8] * 4 + [0.4], beams=beams)[4].injected for beams in (2, 200))
    assert abs(few - many) <= 1
    linear = run([0.8] * 4 + [0.4], rule="linear", beams=200)[4]
    assert linear.injected >= 49  # (1 − w_fast / w_slow) of likelihoods that are nearly all from before


def test_the_rule_of_beluga_sees_only_the_number_of_particles() -> None:
    assert [record.injected for record in run([0.8] * 4 + [0.1] * 4, rule="normalised")] == [0] * 8


def test_steps_that_say_nothing_are_no_reason() -> None:
    (record,) = run([0.8])
    assert recovery.log_fit(record, "per_beam") == pytest.approx(math.log(0.8))
    for change in ({"degenerate": True}, {"beams_used": 0}, {"log_evidence": -math.inf}):
        assert recovery.log_fit(dataclasses.replace(record, **change), "per_beam") is None
    one = dataclasses.replace(record, beams_used=1, log_evidence=-0.7)
    assert recovery.log_fit(one, "per_beam") == pytest.approx(-0.7)


def test_without_a_proposal_nothing_is_drawn() -> None:
    localizer = Localizer(QUIET, FilterParameters(), 0, KldParameters(N, N), RATES)
    state = initial_state(np.zeros((N, 3)))
    for stamp, fit in enumerate((0.0, 0.0, -9.0)):
        same = Measurement("lidar", lambda p, fit=fit: np.full(len(p), fit), 1, 0.0)  # type: ignore[misc]
        state, record = localizer.step(state, STILL, [same], stamp)
        assert record.injected == 0


def test_anywhere_is_every_free_cell() -> None:
    grid = drawn("#..\n..#")
    poses = FromAnywhere(grid)(None, 4000, np.random.default_rng(0))  # type: ignore[arg-type]
    cells = np.floor(grid.to_cells(poses[:, :2])).astype(int)
    assert grid.free[cells[:, 1], cells[:, 0]].all()
    assert len(np.unique(cells, axis=0)) == 4


def test_a_fast_average_slower_than_the_slow_one_is_refused() -> None:
    with pytest.raises(UsageError, match=r"recovery_alpha_fast = 0\.001: must be at least"):
        RecoveryParameters("uniform", 0.1, 0.001)
    assert RecoveryParameters("uniform", 0.1, 0.1).recovery_alpha_fast == 0.1
