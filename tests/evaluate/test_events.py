"""Convergence, losses, recoveries."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import UsageError
from mclcli.evaluate.association import associate
from mclcli.evaluate.evaluation import Evaluation, Protocol, evaluate
from mclcli.evaluate.events import APART, CONVERGED, LOST, Rule, convergence, losses, stretches
from mclcli.evaluate.metrics import errors_of
from tests.evaluate.drives import EPOCH, drive, shifted
from tests.reference import evaluation as naive
from tests.support import SECOND

LEVELS = st.sampled_from([0.0, 0.3, 0.7, 1.5])


def story(*parts: tuple[float, float], step: float = 0.5, yaw: float = 0.0) -> Evaluation:
    """Evaluation of a track with an error [m] for so many seconds, one part after the other."""
    dx = np.concatenate([np.full(round(seconds / step), error) for seconds, error in parts])
    reference = drive(np.arange(dx.size) * step)
    return evaluate(shifted(reference, dx, yaw), reference)


@given(st.lists(st.tuples(st.integers(1, 8), LEVELS, st.sampled_from([0.0, 0.3, 0.7])), min_size=1, max_size=12))
def test_losses_are_what_the_definition_says(parts: list[tuple[int, float, float]]) -> None:
    dx, dyaw = (np.concatenate([np.full(part[0], part[k]) for part in parts]) for k in (1, 2))
    reference = drive(np.arange(dx.size) * 0.5)
    pairs = associate(shifted(reference, dx, dyaw), reference)
    wanted = naive.losses(pairs.seconds.tolist(), dx.tolist(), dyaw.tolist())
    stamps = pairs.stamps_ns.tolist()
    found = [
        (stamps.index(loss.start_ns), None if loss.end_ns is None else stamps.index(loss.end_ns))
        for loss in losses(pairs, errors_of(pairs))
    ]
    assert found == wanted


def test_lost_and_found_again() -> None:
    e = story((20, 0.1), (5, 3.0), (20, 0.1), (5, 2.0))
    assert [(loss.start_ns - EPOCH) / SECOND for loss in e.losses] == [20.0, 45.0]
    assert [loss.end_ns and (loss.end_ns - EPOCH) / SECOND for loss in e.losses] == [25.0, None]
    assert [loss.largest for loss in e.losses] == [pytest.approx(3.0), pytest.approx(2.0)]
    assert (e.recoveries, e.converged_after, e.found_after) == (1, 0.0, 0.0)
    assert e.lost_seconds == pytest.approx(5.0 + 4.5)


@pytest.mark.parametrize(
    ("parts", "count"),
    [
        ([(20, 0.1), (2.0, 3.0), (20, 0.1)], 0),  # the last of its poses is 1.5 s after the first
        ([(20, 0.1), (2.5, 3.0), (20, 0.1)], 1),
        ([(20, 0.1), (9, 0.9), (20, 0.1)], 0),  # neither right nor lost
        ([(20, 0.1), (3, 3.0), (1, 0.1), (3, 3.0), (20, 0.1)], 1),  # a moment's luck is no recovery
        ([(20, 0.1), (3, 3.0), (3, 0.1), (3, 3.0), (20, 0.1)], 2),
    ],
)
def test_what_counts_as_a_loss(parts: list[tuple[float, float]], count: int) -> None:
    assert len(story(*parts).losses) == count


def test_three_poses_are_needed_however_long_they_last() -> None:
    assert len(story((60, 0.1), (10, 3.0), (60, 0.1), step=5.0).losses) == 0
    assert len(story((60, 0.1), (15, 3.0), (60, 0.1), step=5.0).losses) == 1


def test_yaw_alone_loses_a_robot() -> None:
    e = story((20, 0.1), yaw=0.6)
    assert (e.found_after, e.converged_after, e.losses) == (None, None, ())


def test_searching_at_the_start_is_no_loss() -> None:
    e = story((7, 9.0), (30, 0.1))
    assert (e.losses, e.found_after, e.converged_after) == ((), 7.0, 7.0)


@pytest.mark.parametrize(("seconds", "after"), [(10.0, None), (10.5, 5.0)])
def test_convergence_has_to_hold(seconds: float, after: float | None) -> None:
    assert story((5, 0.6), (seconds, 0.4), (5, 0.6)).converged_after == after


def test_nothing_holds_across_a_hole() -> None:
    reference = drive(np.concatenate([np.arange(0.0, 6.0, 0.5), np.arange(20.0, 26.0, 0.5)]))
    pairs = associate(drive(np.arange(0.0, 26.0, 0.5)), reference)
    assert convergence(pairs, errors_of(pairs)) is None
    assert convergence(pairs, errors_of(pairs), Rule(0.5, 0.2, 5.0)) == 0.0


def test_stretches_end_where_the_two_agree_again() -> None:
    reference = drive(np.arange(0.0, 30.0, 0.5))
    dx = np.where((np.arange(60) >= 20) & (np.arange(60) < 30), 0.8, 0.1)
    pairs = associate(shifted(reference, dx), reference)
    (apart,) = stretches(pairs, errors_of(pairs), APART)
    assert (apart.start_ns - EPOCH, (apart.end_ns or 0) - EPOCH) == (10 * SECOND, 15 * SECOND)
    assert not apart.from_start


def test_rules_that_contradict_each_other_are_refused() -> None:
    reference = drive(np.arange(5.0))
    with pytest.raises(UsageError, match="must not be tighter"):
        evaluate(reference, reference, Protocol(converged=CONVERGED, lost=Rule(0.4, LOST.yaw, 2.0)))
