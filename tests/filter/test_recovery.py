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
from mclcli.filter.recovery import Averages, FromAnywhere, Proposed, RecoveryParameters
from mclcli.filter.rivals import HELD_OUT, HELD_OUT_IF_FOUND, SURE, Rivals
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.sensors import Measurement
from tests.reference import recovery as naive
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.filter.recovery import Propose, RecoveryRule
    from mclcli.records import StepRecord

QUIET = DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.0, 0.0))
STILL = np.zeros(3)
N = 100
RATES = RecoveryParameters("uniform", 0.05, 0.4, "linear")
fits = st.lists(st.floats(-400.0, 5.0), min_size=1, max_size=30)


@given(fits, st.floats(0.0, 0.3), st.floats(0.3, 1.0))
def test_the_averages_are_those_of_the_book(values: list[float], slow: float, fast: float) -> None:
    averages: Averages | None = None
    for value in values:
        averages = recovery.observe(averages, value / 100, RecoveryParameters("uniform", slow, fast, "linear"))
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
    fits: list[float],
    rule: RecoveryRule = "reliability",
    beams: int = 10,
    seed: int = 0,
    propose: Propose | None = None,
) -> list[StepRecord]:
    """Steps whose particles all fit alike, but those far away, which fit well."""
    parameters = RecoveryParameters("uniform", 0.01, 0.5, rule)
    localizer = Localizer(QUIET, FilterParameters(), seed, KldParameters(N, N), parameters)
    state, records = initial_state(np.zeros((N, 3))), []
    for stamp, fit in enumerate(fits):
        state, record = localizer.step(state, STILL, [fitting(fit, beams)], stamp, propose=propose or anew)
        records.append(record)
    return records


def fitting(fit: float, beams: int = 10, far: float = 0.99) -> Measurement:
    """A reading that fits so well, and as well as ``far`` where nobody was."""

    def log_likelihood(poses: FloatArray) -> FloatArray:
        return beams * (np.where(poses[:, 0] > 40.0, far, fit) - 1.0)

    return Measurement("lidar", log_likelihood, beams, 0.0, 1e-9, log_floor=-float(beams))


def anew(record: StepRecord, n: int, rng: np.random.Generator) -> Proposed:
    """Far away, where nobody was."""
    del record
    return Proposed.blindly(np.full((n, 3), 50.0) + rng.random((n, 3)))


def test_readings_that_fit_as_before_draw_no_particle_anew() -> None:
    assert [record.injected for record in run([0.8] * 6)] == [0] * 6
    assert not any(record.resampled for record in run([0.8] * 6))


def test_nothing_is_drawn_while_the_robot_does_not_seem_lost() -> None:
    """However much better it fitted before."""
    assert not any(record.injected for record in run([1.0] * 5 + [0.81] * 20))


@pytest.mark.parametrize("far", [0.79, 0.9])
def test_nothing_is_drawn_where_readings_do_not_fit_as_well_as_they_used_to(far: float) -> None:
    """0.79 is lost again; 0.9 is no more than look-alikes reach on a log that is used to 1."""
    parameters = RecoveryParameters("uniform", 0.01, 0.5)
    localizer = Localizer(QUIET, FilterParameters(), 0, KldParameters(N, N), parameters)
    state = initial_state(np.zeros((N, 3)))
    for stamp, fit in enumerate([1.0] * 5 + [0.3] * 3):
        state, record = localizer.step(state, STILL, [fitting(fit, far=far)], stamp, propose=anew)
        assert not record.injected


def test_what_was_drawn_has_to_hold_out_before_it_counts() -> None:
    """From 1 at 0.4, 0.4, 0.4 the fast average is 0.475: particles come with the third update, not before."""
    records = run([0.4] * 4)
    assert [record.injected for record in records[:2]] == [0] * (HELD_OUT - 1)
    slow = 0.4 + 0.6 * 0.99**3
    assert abs(records[2].injected - 100 * (1 - 0.475 / slow)) < 1
    assert records[2].resampled
    last = records[3].poses
    assert np.count_nonzero(last[:, 0] > 40.0) == records[2].injected
    assert len(last) == N


def test_nothing_is_drawn_while_the_robot_seems_right_though_rivals_are_remembered() -> None:
    """After 0.4, 0.4, 0.85 the rivals are old enough, but the next update decides."""
    injected = [record.injected > 0 for record in run([0.4, 0.4, 0.85, 0.85, 0.4])]
    assert injected == [False, False, False, False, True]


def test_what_a_search_has_found_holds_out_longer_unless_it_is_sure() -> None:
    at = np.array([[50.0, 0.0, 0.0]])
    for probability, needed in ((0.0, HELD_OUT), (0.3, HELD_OUT_IF_FOUND), (SURE - 1e-9, HELD_OUT_IF_FOUND), (SURE, 1)):
        rivals = Rivals().joined_by(at, np.array([probability]))
        proven = []
        for _ in range(HELD_OUT_IF_FOUND):
            rivals = rivals.judged([fitting(0.5)], 1.0, 10)
            proven.append(len(rivals.proven) == 1)
        assert proven == [age >= needed for age in range(1, HELD_OUT_IF_FOUND + 1)]


def test_rivals_are_forgotten_once_the_robot_seems_right_for_long() -> None:
    assert not any(record.injected for record in run([0.4, 0.4, *[0.9] * 6] * 3))


def test_a_sure_place_counts_at_once() -> None:
    def surely(record: StepRecord, n: int, rng: np.random.Generator) -> Proposed:
        return Proposed(anew(record, n, rng).poses, np.full(n, SURE))

    assert run([0.4], propose=surely)[0].injected
    assert not any(record.injected for record in run([0.9, 0.9], propose=surely))


def test_a_rival_that_does_not_fit_once_is_out() -> None:
    here, there = np.array([[50.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0]])
    rivals = Rivals().joined_by(np.concatenate([here, there]), np.zeros(2))
    for _ in range(HELD_OUT):
        assert not rivals.proven.size
        rivals = rivals.judged([fitting(0.5)], 1.0, 10)
    np.testing.assert_array_equal(rivals.proven, here)
    assert not rivals.judged([fitting(0.5, far=0.7)], 1.0, 10).poses.size
    younger = rivals.joined_by(here + 1.0, np.zeros(1)).judged([fitting(0.5)], 1.0, 1)
    np.testing.assert_array_equal(younger.poses, here)


def test_the_number_drawn_anew_is_right_on_average() -> None:
    share = 100 * (1 - 0.475 / (0.4 + 0.6 * 0.99**3))
    counts = [run([0.4] * 3, seed=seed)[2].injected for seed in range(100)]
    assert set(counts) == {int(share), int(share) + 1}
    assert np.mean(counts) == pytest.approx(share, abs=0.15)  # three standard deviations of the mean


def test_more_beams_do_not_make_a_robot_more_lost() -> None:
    few, many = (run([0.9] * 3 + [0.4] * 3, beams=beams)[5].injected for beams in (2, 200))
    assert few > 0
    assert abs(few - many) <= 1
    linear = run([0.8] * 4 + [0.4], rule="linear", beams=200)[4]
    assert linear.injected >= 49  # (1 − w_fast / w_slow) of likelihoods that are nearly all from before


def test_the_rule_of_beluga_sees_only_the_number_of_particles() -> None:
    assert [record.injected for record in run([0.8] * 4 + [0.1] * 4, rule="normalised")] == [0] * 8


def test_steps_that_say_nothing_are_no_reason() -> None:
    (record,) = run([0.8])
    assert recovery.log_fit(record, "reliability") == pytest.approx(math.log(0.8))
    assert recovery.log_fit(dataclasses.replace(record, reliability=0.0), "reliability") == -math.inf
    for change in ({"degenerate": True}, {"beams_used": 0}, {"log_evidence": -math.inf}):
        assert recovery.log_fit(dataclasses.replace(record, **change), "reliability") is None


def test_without_a_proposal_nothing_is_drawn() -> None:
    localizer = Localizer(QUIET, FilterParameters(), 0, KldParameters(N, N), RATES)
    state = initial_state(np.zeros((N, 3)))
    for stamp, fit in enumerate((0.0, 0.0, -9.0)):
        same = Measurement("lidar", lambda p, fit=fit: np.full(len(p), fit), 1, 0.0)  # type: ignore[misc]
        state, record = localizer.step(state, STILL, [same], stamp)
        assert record.injected == 0


def test_anywhere_is_every_free_cell() -> None:
    grid = drawn("#..\n..#")
    poses = FromAnywhere(grid)(None, 4000, np.random.default_rng(0)).poses  # type: ignore[arg-type]
    cells = np.floor(grid.to_cells(poses[:, :2])).astype(int)
    assert grid.free[cells[:, 1], cells[:, 0]].all()
    assert len(np.unique(cells, axis=0)) == 4


def test_a_fast_average_slower_than_the_slow_one_is_refused() -> None:
    with pytest.raises(UsageError, match=r"recovery_alpha_fast = 0\.001: must be at least"):
        RecoveryParameters("uniform", 0.1, 0.001)
    assert RecoveryParameters("uniform", 0.1, 0.1).recovery_alpha_fast == 0.1
