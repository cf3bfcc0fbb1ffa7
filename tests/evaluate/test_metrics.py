"""Absolute and relative errors, against the same said pose by pose."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.evaluate.association import associate
from mclcli.evaluate.metrics import errors_of, relative_errors, share_within, statistics, way_of
from mclcli.geometry import se2
from mclcli.geometry.trajectory import Trajectory
from tests.evaluate.drives import drive, noisy, shifted
from tests.reference import evaluation as naive

SEEDS = st.integers(0, 10_000)
VALUES = st.lists(st.floats(-50, 50), min_size=1, max_size=30)


@given(VALUES)
def test_statistics(values: list[float]) -> None:
    found = statistics(np.array(values))
    assert found is not None
    assert found.count == len(values)
    for name, wanted in naive.statistics(values).items():
        assert asdict(found)[name] == pytest.approx(wanted, abs=1e-9)


def test_statistics_of_nothing() -> None:
    assert statistics(np.zeros(0)) is None


@given(SEEDS)
def test_relative_errors(seed: int) -> None:
    pairs = associate(*noisy(seed))
    mine, theirs = [tuple(p) for p in pairs.estimated.tolist()], [tuple(p) for p in pairs.expected.tolist()]
    along = {"metre": naive.way(theirs), "second": pairs.seconds.tolist()}
    for per, positions in along.items():
        found = relative_errors(pairs, per=per)
        wanted = np.array(naive.relative(mine, theirs, positions)).reshape(-1, 2)
        assert len(wanted) > 5
        np.testing.assert_allclose(found.translation, wanted[:, 0], atol=1e-9)
        np.testing.assert_allclose(found.yaw, wanted[:, 1], atol=1e-9)


@given(SEEDS, st.floats(-30, 30), st.floats(-30, 30), st.floats(-3.1, 3.1))
def test_relative_errors_do_not_see_where_a_track_starts(seed: int, x: float, y: float, yaw: float) -> None:
    track, reference = noisy(seed)
    moved = Trajectory(track.stamps_ns, se2.compose([x, y, yaw], track.poses))
    found, wanted = (relative_errors(associate(t, reference)) for t in (moved, track))
    np.testing.assert_allclose(found.translation, wanted.translation, atol=1e-9)
    np.testing.assert_allclose(found.yaw, wanted.yaw, atol=1e-9)


def test_drift_is_told_per_unit_however_far_poses_lie_apart() -> None:
    for spacing in (0.5, 4.0):
        reference = drive(np.arange(0.0, 80.0, spacing), turn=0.0)
        along = way_of(reference.poses)
        track = shifted(reference, 0.02 * along)
        assert relative_errors(associate(track, reference)).translation == pytest.approx(0.02)
        per_second = relative_errors(associate(track, reference), per="second")
        assert per_second.translation == pytest.approx(0.01)


def test_no_pair_spans_a_hole() -> None:
    reference = drive(np.concatenate([np.arange(0.0, 3.0, 0.5), np.arange(30.0, 33.0, 0.5)]))
    track = drive(np.arange(0.0, 33.0, 0.5))
    spans = relative_errors(associate(track, reference), per="second").spans
    assert spans.max() == pytest.approx(1.0)
    assert spans.size == 8


def test_a_robot_at_rest_does_not_drive() -> None:
    draws = np.random.default_rng(3)
    resting = np.column_stack([draws.normal(0.0, 0.01, (500, 2)), np.zeros(500)])
    assert way_of(resting)[-1] == 0.0
    still = Trajectory(np.arange(500) * 10**8, resting)
    assert relative_errors(associate(still, still)).translation.size == 0


def test_share_within_counts_the_bound_itself() -> None:
    assert share_within(np.array([0.0, 0.05, 0.0500001, 1.0]), 0.05) == 0.5


def test_yaw_goes_the_short_way_round() -> None:
    reference = drive(np.arange(5.0), turn=0.0)
    track = shifted(shifted(reference, 0.0, 3.1), 0.0, 3.1)
    np.testing.assert_allclose(errors_of(associate(track, reference)).yaw, 6.2 - 2 * np.pi)
