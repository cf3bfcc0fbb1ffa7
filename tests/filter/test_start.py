"""Where particles start, and regular sets of poses over a map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.errors import InputError
from mclcli.filter import particles
from mclcli.filter.start import (
    GIVEN_SPREAD,
    AlongPoses,
    Anywhere,
    AroundPose,
    AroundSeveral,
    Opening,
    Patience,
    WhenTold,
)
from mclcli.geometry import se2
from mclcli.motion.odometry import OdometryPath
from mclcli.records import StampedPose
from tests.support import SECOND
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

GRID = drawn("#..\n.?.", 0.5, (1.0, -2.0, 0.4))
EMPTY = OdometryPath()


def generator() -> np.random.Generator:
    return np.random.default_rng(12)


def test_a_gaussian_cloud_has_the_covariance_asked_for() -> None:
    covariance = np.array([[0.25, 0.1, 0.0], [0.1, 0.09, 0.02], [0.0, 0.02, 0.04]])
    cloud = particles.gaussian(np.array([1.0, 2.0, 0.5]), covariance, 60_000, generator())
    np.testing.assert_allclose(cloud.mean(axis=0), [1.0, 2.0, 0.5], atol=0.01)
    np.testing.assert_allclose(np.cov(cloud.T), covariance, atol=0.005)


def test_no_spread_puts_every_particle_on_the_pose() -> None:
    cloud = particles.gaussian(np.array([1.0, 2.0, math.pi]), np.zeros((3, 3)), 5, generator())
    assert cloud.tolist() == [[1.0, 2.0, math.pi]] * 5


def test_yaw_near_pi_is_wrapped() -> None:
    cloud = particles.gaussian(np.array([0.0, 0.0, 3.1]), np.diag([0, 0, 0.04]), 1000, generator())
    assert ((cloud[:, 2] > -math.pi) & (cloud[:, 2] <= math.pi)).all()
    assert 0.2 < (cloud[:, 2] < 0).mean() < 0.6


def test_uniform_particles_fill_free_cells_only_and_evenly() -> None:
    cloud = particles.uniform(GRID, 40_000, generator())
    cells = np.floor(GRID.to_cells(cloud[:, :2])).astype(int)
    assert GRID.free[cells[:, 1], cells[:, 0]].all()
    _, counts = np.unique(cells, axis=0, return_counts=True)
    np.testing.assert_allclose(counts / 40_000, np.full(4, 0.25), atol=0.015)
    within = GRID.to_cells(cloud[:, :2]) % 1.0
    np.testing.assert_allclose(np.cov(within.T), np.eye(2) / 12.0, atol=0.002)
    assert ((cloud[:, 2] > -math.pi) & (cloud[:, 2] <= math.pi)).all()
    assert abs(np.exp(1j * cloud[:, 2]).mean()) < 0.02


def test_a_map_without_a_free_cell_is_an_error() -> None:
    with pytest.raises(InputError, match="no cell is free"):
        Anywhere(drawn("#?\n##")).place(Opening(0, EMPTY), 10, generator())


def test_around_a_pose_holds_at_any_stamp() -> None:
    start = AroundPose(np.array([1.0, 2.0, 0.5]), particles.DEFAULT_SPREAD)
    first, later = (start.place(Opening(stamp, EMPTY), 500, generator()) for stamp in (0, 10**18))
    assert first.tobytes() == later.tobytes()
    np.testing.assert_allclose(first.std(axis=0), [0.5, 0.5, math.radians(15)], rtol=0.15)


def test_a_pose_alone_has_the_default_spread() -> None:
    start = AroundPose.at(1.0, 2.0, 0.5)
    np.testing.assert_array_equal(start.pose, [1.0, 2.0, 0.5])
    np.testing.assert_allclose(start.covariance, particles.DEFAULT_SPREAD, rtol=1e-12)
    np.testing.assert_allclose(AroundPose.at(0, 0, 0, 0.2, 0.3).covariance, np.diag([0.04, 0.04, 0.09]), rtol=1e-12)


def test_several_hypotheses_share_the_particles_by_their_weights() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 1.0], [0.0, 10.0, -1.0]])
    spreads = np.array([np.diag([0.01, 0.01, 0.001]), np.zeros((3, 3)), np.diag([0.04, 0.0, 0.0])])
    cloud = AroundSeveral(poses, spreads, np.array([1.0, 2.0, 1.0])).place(Opening(0, EMPTY), 1001, generator())
    assert cloud.shape == (1001, 3)
    nearest = np.argmin(np.hypot(*(cloud[:, np.newaxis, :2] - poses[:, :2]).transpose(2, 0, 1)), axis=1)
    assert np.abs(np.bincount(nearest) - 1001 * np.array([0.25, 0.5, 0.25])).max() <= 1.0
    assert (cloud[nearest == 1] == poses[1]).all()
    np.testing.assert_allclose(cloud[nearest == 0].std(axis=0), np.sqrt([0.01, 0.01, 0.001]), rtol=0.2)


def test_a_robot_that_waits_to_be_told_starts_nowhere() -> None:
    assert WhenTold().place(Opening(0, EMPTY), 3, generator()) is Patience.SKIP


def given(seconds: float, *pose: float, covariance: FloatArray | None = None) -> StampedPose:
    return StampedPose(int(seconds * SECOND), "map", np.array(pose), covariance)


EXACTLY = np.zeros((3, 3))


def test_before_the_first_stated_pose_there_is_no_start() -> None:
    start = AlongPoses([given(5, 1, 2, 3)])
    assert start.place(Opening(5 * SECOND - 1, EMPTY), 3, generator()) is Patience.SKIP
    assert isinstance(start.place(Opening(5 * SECOND, EMPTY), 3, generator()), np.ndarray)


def test_between_two_close_stated_poses_the_start_is_interpolated() -> None:
    start = AlongPoses([given(2, 2, 0, 0.2), given(1, 1, 0, 0, covariance=EXACTLY)])
    cloud = start.place(Opening(int(1.25 * SECOND), EMPTY), 2, generator())
    assert isinstance(cloud, np.ndarray)
    np.testing.assert_allclose(cloud[0], se2.interpolate([1, 0, 0], [2, 0, 0.2], 0.25), atol=1e-12)
    later = AlongPoses([StampedPose(2 * SECOND + 1, "map", np.ones(3)), given(1, 1, 0, 0, covariance=EXACTLY)])
    apart = later.place(Opening(int(1.25 * SECOND), EMPTY), 2, generator())
    assert isinstance(apart, np.ndarray)
    assert apart.tolist() == [[1.0, 0.0, 0.0]] * 2  # more than a second apart: carried, not joined


def test_a_lone_stated_pose_is_carried_on_by_odometry() -> None:
    path = OdometryPath()
    path.append(0, np.array([10.0, 0.0, 0.0]))
    path.append(4 * SECOND, np.array([14.0, 0.0, 0.0]))
    start = AlongPoses([given(1, 5, 5, math.pi / 2, covariance=EXACTLY)])
    cloud = start.place(Opening(3 * SECOND, path), 2, generator())
    assert isinstance(cloud, np.ndarray)
    np.testing.assert_allclose(cloud[0], [5.0, 7.0, math.pi / 2], atol=1e-12)


def test_a_stated_pose_without_covariance_is_taken_as_good() -> None:
    cloud = AlongPoses([given(0, 0, 0, 0)]).place(Opening(0, EMPTY), 5000, generator())
    assert isinstance(cloud, np.ndarray)
    np.testing.assert_allclose(np.cov(cloud.T), GIVEN_SPREAD, atol=0.001)
    np.testing.assert_allclose(GIVEN_SPREAD, np.diag([0.01, 0.01, math.radians(5.0) ** 2]), rtol=1e-12)


@pytest.mark.parametrize(("first", "last"), [(2, 4), (0, 2), (2, 2)], ids=["starts later", "ends before", "one stamp"])
def test_a_lone_stated_pose_stays_where_odometry_does_not_reach(first: int, last: int) -> None:
    """It holds for 1 s, and the start is at 3 s."""
    path = OdometryPath()
    path.append(first * SECOND, np.array([10.0, 0.0, 0.0]))
    if last > first:
        path.append(last * SECOND, np.array([14.0, 0.0, 0.0]))
    cloud = AlongPoses([given(1, 5, 5, 0.5, covariance=EXACTLY)]).place(Opening(3 * SECOND, path), 2, generator())
    assert isinstance(cloud, np.ndarray)
    np.testing.assert_allclose(cloud, [[5.0, 5.0, 0.5]] * 2, atol=1e-12)
