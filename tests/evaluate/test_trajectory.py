"""Errors of a track against a reference."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError
from mclcli.evaluate.metrics import absolute_pose_errors
from mclcli.geometry import se2
from mclcli.geometry.trajectory import Track, Trajectory, in_order
from tests.io.traces import point
from tests.support import SECOND

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

GAP = SECOND


def trajectory(*rows: tuple[float, ...]) -> Trajectory:
    """Trajectory from rows of seconds, x, y, yaw."""
    stamps = np.array([round(row[0] * SECOND) for row in rows], dtype=np.int64)
    return Trajectory(stamps, np.array([row[1:] for row in rows], dtype=np.float64))


LINE = trajectory((0, 0, 0, 0), (1, 2, 0, 0), (2, 4, 0, 0.5), (5, 4, 3, 0.5))


def at(*seconds: float, gap_ns: int = GAP) -> tuple[FloatArray, list[bool]]:
    poses, covered = LINE.at(np.array([round(s * SECOND) for s in seconds], dtype=np.int64), gap_ns)
    return poses, covered.tolist()


def test_own_stamps_give_own_poses() -> None:
    poses, covered = at(0, 1, 2, 5)
    np.testing.assert_allclose(poses, LINE.poses, atol=1e-12)
    assert covered == [True] * 4


def test_between_poses_the_twist_is_constant() -> None:
    poses, covered = at(0.25, 1.5)
    assert covered == [True, True]
    np.testing.assert_allclose(poses[0], [0.5, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(poses[1], se2.interpolate(LINE.poses[1], LINE.poses[2], 0.5), atol=1e-12)


def test_gaps_and_what_lies_outside_are_not_covered() -> None:
    assert at(-0.1, 2.1, 4.9, 5.0, 5.1)[1] == [False, False, False, True, False]
    assert at(2.1, 4.9, gap_ns=3 * GAP)[1] == [True, True]


def test_a_single_pose_covers_its_own_stamp() -> None:
    lone = trajectory((3, 1, 2, 0.5))
    poses, covered = lone.at(np.array([3, 4], dtype=np.int64) * SECOND, GAP)
    assert covered.tolist() == [True, False]
    np.testing.assert_allclose(poses[0], [1, 2, 0.5], atol=1e-12)


def test_a_track_is_without_error_against_itself() -> None:
    errors = absolute_pose_errors(LINE, LINE)
    assert errors.translation_rmse == pytest.approx(0.0, abs=1e-12)
    assert errors.yaw_rmse == pytest.approx(0.0, abs=1e-12)
    assert (errors.total, errors.stamps_ns.size) == (4, 4)


def test_known_errors() -> None:
    track = trajectory((0, 3, 4, 0.1), (1, 2, 0, -0.2), (9, 0, 0, 0))
    errors = absolute_pose_errors(track, LINE)
    np.testing.assert_allclose(errors.translation, [5.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(errors.yaw, [0.1, -0.2], atol=1e-12)
    assert errors.translation_rmse == pytest.approx(math.sqrt(12.5))
    assert errors.yaw_rmse == pytest.approx(math.sqrt(0.025))
    assert (errors.total, errors.stamps_ns.tolist()) == (3, [0, SECOND])


def test_yaw_errors_go_the_short_way_round() -> None:
    errors = absolute_pose_errors(trajectory((0, 0, 0, -3.1)), trajectory((0, 0, 0, 3.1)))
    assert errors.yaw[0] == pytest.approx(math.tau - 6.2)


@given(st.floats(-10, 10), st.floats(-10, 10))
def test_nothing_is_aligned_away(dx: float, dy: float) -> None:
    moved = Trajectory(LINE.stamps_ns, np.add(LINE.poses, [dx, dy, 0.0]))
    assert absolute_pose_errors(moved, LINE).translation_rmse == pytest.approx(math.hypot(dx, dy), abs=1e-9)


def test_a_reference_of_another_time_is_an_error() -> None:
    with pytest.raises(InputError, match="covers no stamp"):
        absolute_pose_errors(trajectory((100, 0, 0, 0)), LINE)


def test_large_stamps_keep_their_nanoseconds() -> None:
    epoch = 1_700_000_000 * SECOND
    line = Trajectory(np.array([epoch, epoch + 1000]), np.array([[0.0, 0, 0], [1.0, 0, 0]]))
    poses, covered = line.at(np.array([epoch + 1]), GAP)
    assert covered.tolist() == [True]
    assert poses[0, 0] == pytest.approx(0.001)


def test_a_pose_is_met_to_a_millisecond() -> None:
    sparse = trajectory((0, 0, 0, 0), (10, 10, 0, 0))
    ticks = np.array([-2, -1, 0, 1, 2, 9998, 9999, 10_000, 10_001, 10_002], dtype=np.int64) * 10**6
    poses, covered = sparse.at(ticks, GAP)
    assert covered.tolist() == [False, True, True, True, False, False, True, True, True, False]
    np.testing.assert_allclose(poses[covered, 0], [0.0, 0.0, 0.001, 9.999, 10.0, 10.0], atol=1e-12)


@given(st.lists(st.integers(0, 9), max_size=12))
def test_what_is_said_later_overrules(stamps: list[int]) -> None:
    said = list(enumerate(stamps))
    wanted = [(s, float(i)) for i, s in said if all(s < later for _, later in said[i + 1 :])]
    poses = np.array([[i, 0.0, 0.0] for i in range(len(stamps))], dtype=np.float64).reshape(-1, 3)
    found = in_order(np.array(stamps, dtype=np.int64), poses)
    assert list(zip(found.stamps_ns.tolist(), found.poses[:, 0].tolist(), strict=True)) == wanted


def test_an_empty_track_is_empty() -> None:
    assert Track().trajectory.stamps_ns.size == 0


def test_a_track_that_is_not_kept_still_tells_its_time() -> None:
    kept, passing = Track(), Track(whole=False)
    for number in range(3):
        for track in (kept, passing):
            track.append(point(number))
    assert kept.seconds == passing.seconds == (kept.stamps_ns[-1] - kept.stamps_ns[0]) * 1e-9 > 0.0
    assert kept.poses.shape == (3, 3)
    assert passing.poses.shape == (0, 3)
