"""Which pose belongs to which, and what is left uncovered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError
from mclcli.evaluate.association import Matching, aligned, associate
from mclcli.evaluate.metrics import errors_of
from mclcli.geometry import se2
from mclcli.geometry.trajectory import Trajectory
from tests.evaluate.drives import drive, noisy
from tests.reference import evaluation as naive
from tests.support import SECOND

NEAREST = Matching("nearest", max_diff_ns=SECOND // 10)
STAMPS = st.lists(st.integers(0, 300), min_size=1, max_size=25, unique=True).map(sorted)


def at_ticks(ticks: list[int]) -> Trajectory:
    """Poses that tell their own number, 10 ms a tick."""
    x = np.arange(len(ticks), dtype=np.float64)
    return Trajectory(np.array(ticks, dtype=np.int64) * (SECOND // 100), np.stack([x, x, 0 * x], axis=-1))


@given(STAMPS, STAMPS)
def test_nearest_is_what_the_definition_says(track: list[int], reference: list[int]) -> None:
    wanted = sorted(naive.nearest(track, reference, 10))
    if not wanted:
        with pytest.raises(InputError, match="covers no stamp"):
            associate(at_ticks(track), at_ticks(reference), NEAREST)
        return
    pairs = associate(at_ticks(track), at_ticks(reference), NEAREST)
    found = [(int(mine), int(theirs)) for mine, theirs in zip(pairs.estimated[:, 0], pairs.expected[:, 0], strict=True)]
    assert sorted(found) == wanted
    assert pairs.total == len(track)


def test_interpolation_needs_a_reference_on_both_sides_and_near() -> None:
    reference = drive(np.array([0.0, 1.0, 2.0, 8.0, 9.0]))
    track = drive(np.array([-0.5, 0.0, 0.5, 1.9, 5.0, 8.5, 9.0, 9.1]))
    pairs = associate(track, reference)
    np.testing.assert_allclose(pairs.seconds, [0.0, 0.5, 1.9, 8.5, 9.0])
    np.testing.assert_allclose(pairs.expected, pairs.estimated, atol=1e-12)
    assert (pairs.total, pairs.pieces.tolist()) == (8, [0, 0, 0, 1, 1])
    assert associate(track, reference, Matching(max_gap_ns=6 * SECOND)).stamps_ns.size == 6


def test_single_poses_left_out_make_no_hole() -> None:
    reference = drive(np.arange(0.0, 10.0, 0.5))
    track = drive(np.arange(0.0, 9.0, 0.25))
    pairs = associate(track, reference, Matching("nearest", max_diff_ns=1000))
    assert pairs.stamps_ns.size == 18
    assert set(pairs.pieces.tolist()) == {0}


def test_no_overlap_says_when_the_two_are() -> None:
    with pytest.raises(InputError, match=r"the track is from @1700000100\.000 to @1700000100\.000, the reference"):
        associate(drive(np.array([100.0])), drive(np.array([0.0, 1.0])))


@given(st.integers(0, 1000), st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))
def test_alignment_undoes_a_rigid_motion(seed: int, x: float, y: float, yaw: float) -> None:
    _, reference = noisy(seed)
    moved = Trajectory(reference.stamps_ns, se2.compose([x, y, yaw], reference.poses))
    pairs, motion = aligned(associate(moved, reference))
    assert errors_of(pairs).translation.max() < 1e-9
    np.testing.assert_allclose(se2.compose(motion, [x, y, yaw]), 0.0, atol=1e-9)


@given(st.integers(0, 1000), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.05, 0.05))
def test_no_other_motion_fits_better(seed: int, x: float, y: float, yaw: float) -> None:
    track, reference = noisy(seed, sigma=0.3)
    pairs = associate(track, reference)
    _, motion = aligned(pairs)
    mine, theirs = [tuple(p) for p in pairs.estimated.tolist()], [tuple(p) for p in pairs.expected.tolist()]
    best = naive.misfit(mine, theirs, tuple(motion.tolist()))
    other = (motion + np.array([x, y, yaw])).tolist()
    assert best <= naive.misfit(mine, theirs, tuple(other)) + 1e-12


def test_alignment_turns_covariances_along() -> None:
    reference = drive(np.arange(10.0))
    spread = np.broadcast_to(np.diag([4.0, 1.0, 0.1]), (10, 3, 3))
    moved = Trajectory(reference.stamps_ns, se2.compose([0, 0, np.pi / 2], reference.poses), spread)
    pairs, _ = aligned(associate(moved, reference))
    assert pairs.covariances is not None
    np.testing.assert_allclose(pairs.covariances[0], np.diag([1.0, 4.0, 0.1]), atol=1e-9)
