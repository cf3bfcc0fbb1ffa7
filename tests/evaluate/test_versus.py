"""What a robot believed, between what its localizer said."""

from __future__ import annotations

import numpy as np
import pytest

from mclcli.errors import InputError
from mclcli.evaluate.versus import carried, compare, composed
from mclcli.geometry import se2
from mclcli.geometry.trajectory import Trajectory
from tests.evaluate.drives import EPOCH, drive, shifted
from tests.support import SECOND

START = np.array([3.0, -2.0, 1.0])  # of the odometry's frame in map
ODOMETRY = drive(np.arange(0.0, 20.0, 0.25))
TRUE = Trajectory(ODOMETRY.stamps_ns, se2.compose(START, ODOMETRY.poses))


def test_the_last_answer_is_carried_on_by_odometry() -> None:
    said = Trajectory(TRUE.stamps_ns[8::20], TRUE.poses[8::20])
    belief = carried(said, ODOMETRY)
    assert belief.stamps_ns.tolist() == TRUE.stamps_ns[8:].tolist()
    np.testing.assert_allclose(belief.poses, TRUE.poses[8:], atol=1e-9)


def test_a_belief_knows_nothing_of_the_next_answer() -> None:
    poses = np.array([TRUE.poses[0], se2.compose([2.0, 0.0, 0.0], TRUE.poses[40])])
    belief = carried(Trajectory(TRUE.stamps_ns[[0, 40]], poses), ODOMETRY)
    error = belief.poses[:, 0] - TRUE.poses[:, 0]
    np.testing.assert_allclose(error[:40], 0.0, atol=1e-9)
    np.testing.assert_allclose(error[40:], 2.0, atol=1e-9)


def test_answers_between_scans_start_from_interpolated_odometry() -> None:
    exact = drive(np.array([1.1]))
    belief = carried(Trajectory(exact.stamps_ns, se2.compose(START, exact.poses)), ODOMETRY)
    np.testing.assert_allclose(belief.poses, TRUE.poses[5:], atol=1e-9)


def test_a_recorded_transform_after_odometry() -> None:
    stamps = EPOCH + np.array([1, 2, 3, 9], dtype=np.int64) * SECOND
    path = Trajectory(stamps, np.broadcast_to(START, (4, 3)))
    belief = composed(path, ODOMETRY)
    assert belief.stamps_ns[[0, -1]].tolist() == [EPOCH + SECOND, EPOCH + 9 * SECOND]
    assert belief.stamps_ns.size == 10  # not from 3 s to 9 s, where it is not known
    np.testing.assert_allclose(belief.poses[-1], TRUE.poses[36], atol=1e-9)


@pytest.mark.parametrize("make", [carried, composed])
def test_beliefs_of_another_time_are_refused(make: object) -> None:
    far = Trajectory(TRUE.stamps_ns + 10**15, TRUE.poses)
    with pytest.raises(InputError, match="same clock"):
        make(far, ODOMETRY)  # type: ignore[operator]


def test_the_first_moment_apart() -> None:
    dx = np.where(np.arange(80) >= 30, 0.1 * (np.arange(80) - 29), 0.0)
    found = compare(shifted(TRUE, dx), TRUE)
    assert [(loss.start_ns, loss.end_ns) for loss in found.apart] == [(int(TRUE.stamps_ns[35]), None)]
    assert compare(TRUE, TRUE).apart == ()
