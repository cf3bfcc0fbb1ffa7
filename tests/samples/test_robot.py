from __future__ import annotations

import numpy as np
import pytest

from mclcli.geometry import se2
from samples.sim.building import FREE, Building
from samples.sim.layouts import office_floor
from samples.sim.planning import terrain
from samples.sim.robot import Drive, OdometryNoise, Trajectory, odometry, travel

EXACT = OdometryNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
DRIVE = Drive(speed=0.7, turn=1.0)


@pytest.fixture(scope="module")
def floor() -> Building:
    return office_floor(2)


@pytest.fixture(scope="module")
def truth(floor: Building) -> Trajectory:
    return travel(floor, terrain(floor), (("lobby", "south2", "core1"),), DRIVE)


@pytest.fixture(scope="module")
def kidnapped(floor: Building) -> Trajectory:
    return travel(floor, terrain(floor), (("lobby", "west"), ("passage", "north5")), DRIVE)


def test_the_robot_touches_nothing(floor: Building, truth: Trajectory) -> None:
    ring = 0.22 * np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=-1)
    cells = np.floor((truth.poses[:, np.newaxis, :2] + ring) / floor.resolution).astype(int)
    assert np.all(floor.grid[cells[..., 1], cells[..., 0]] == FREE)


def test_the_robot_arrives(floor: Building, truth: Trajectory) -> None:
    for place in ("lobby", "south2", "core1"):
        assert np.min(np.hypot(*(truth.poses[:, :2] - floor.places[place]).T)) < 1.0
    assert np.sum(np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)) > 8.0


def test_speeds_and_accelerations_stay_within_the_drive(truth: Trajectory) -> None:
    twist = se2.log(se2.between(truth.poses[:-1], truth.poses[1:])) / 0.02
    assert 0.65 < np.max(twist[:, 0]) <= 0.7 + 1e-9
    assert np.min(twist[:, 0]) > -1e-9
    assert np.max(np.abs(twist[:, 1])) < 1e-9
    assert np.max(np.abs(twist[:, 2])) <= 1.0 + 1e-9
    assert np.max(np.abs(np.diff(twist[:, 0]))) <= 0.7 * 0.02 + 1e-9
    assert np.max(np.abs(np.diff(twist[:, 2]))) <= 3.0 * 0.02 + 1e-9


def test_stamps_are_50_hz(truth: Trajectory) -> None:
    assert truth.stamps_ns.dtype == np.int64
    assert set(np.diff(truth.stamps_ns).tolist()) == {20_000_000}


def test_exact_odometry_is_the_truth_from_its_start(truth: Trajectory) -> None:
    odom, twists = odometry(truth, EXACT, seed=0)
    laid = se2.compose(truth.poses[0], odom.poses)
    np.testing.assert_allclose(laid[:, :2], truth.at(odom.stamps_ns)[:, :2], atol=1e-9)
    np.testing.assert_allclose(se2.exp(twists[1:] * 0.04), se2.between(odom.poses[:-1], odom.poses[1:]), atol=1e-12)


def test_odometry_errs_with_the_motion_and_the_seed(truth: Trajectory) -> None:
    ends = np.array([odometry(truth, OdometryNoise(), seed)[0].poses[-1] for seed in range(6)])
    assert np.all(np.std(ends, axis=0) > 1e-3)
    np.testing.assert_array_equal(ends[0], odometry(truth, OdometryNoise(), 0)[0].poses[-1])
    still = Trajectory(truth.stamps_ns, np.tile(truth.poses[0], (len(truth.poses), 1)))
    np.testing.assert_allclose(odometry(still, OdometryNoise(), 0)[0].poses, 0.0, atol=1e-12)


def test_noise_has_the_variance_that_is_asked_for() -> None:
    straight = np.column_stack([0.01 * np.arange(40_001), np.zeros(40_001), np.zeros(40_001)])  # 400 m
    line = Trajectory(20_000_000 * np.arange(40_001, dtype=np.int64), straight)
    odom, _ = odometry(line, OdometryNoise(0.05, 0.03, 0.0, 0.0, 0.02, 0.0, 0.001), seed=1)
    steps = se2.log(se2.between(odom.poses[:-1], odom.poses[1:]))
    length = 0.02
    assert np.mean(steps[:, 0]) == pytest.approx(1.02 * length, rel=0.02)
    assert np.std(steps[:, 0]) == pytest.approx(0.05 * np.sqrt(length), rel=0.03)
    assert np.std(steps[:, 2]) == pytest.approx(0.03 * np.sqrt(length), rel=0.03)
    assert np.sum(steps[:, 2]) == pytest.approx(0.001 * 400, abs=4 * 0.03 * np.sqrt(400))


def test_a_slip_moves_the_odometry_alone(truth: Trajectory) -> None:
    slipped, _ = odometry(truth, OdometryNoise(0, 0, 0, 0, 0, 0, 0, slips=((3.0, (0.5, 0.1, 0.3)),)), seed=0)
    exact, _ = odometry(truth, EXACT, seed=0)
    before = slipped.stamps_ns <= 3_000_000_000
    np.testing.assert_array_equal(slipped.poses[before], exact.poses[before])
    jump = se2.between(exact.poses[before.sum()], slipped.poses[before.sum()])
    np.testing.assert_allclose(jump, [0.5, 0.1, 0.3], atol=1e-9)


def test_a_kidnapping_is_not_in_the_odometry(kidnapped: Trajectory) -> None:
    hops = np.hypot(*np.diff(kidnapped.poses[:, :2], axis=0).T)
    (moment,) = np.flatnonzero(hops > 1.0)
    odom, _ = odometry(kidnapped, OdometryNoise(), seed=0)
    assert np.max(np.hypot(*np.diff(odom.poses[:, :2], axis=0).T)) < 0.1
    between = kidnapped.stamps_ns[moment] + np.array([1_000_000, 19_999_999, 20_000_000])
    np.testing.assert_allclose(
        kidnapped.at(between)[:, :2], kidnapped.poses[[moment, moment, moment + 1], :2], atol=1e-12
    )


def test_an_unknown_place_is_an_error(floor: Building) -> None:
    with pytest.raises(KeyError, match="cellar"):
        travel(floor, terrain(floor), (("lobby", "cellar"),), DRIVE)
