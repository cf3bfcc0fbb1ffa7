"""From a simulated drive to its best track: how good it is, what it says of itself, and of a wrong map."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.errors import InputError
from mclcli.geometry import se2, se3
from mclcli.records import NextLog
from mclcli.replay.loop import replay
from mclcli.replay.smoothing import Smoothed, Smoothing
from mclcli.settings import profiles
from mclcli.world.occupancy import OccupancyGrid
from samples.sim import memory
from samples.sim.layouts import office_floor
from samples.sim.recording import Recording, Scenario, simulate
from samples.sim.robot import Drive
from samples.sim.sensors import Lidar, Mount
from tests.replay import replays

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


@functools.cache
def driven(sweep: float = 0.0) -> Recording:
    floor = office_floor(seed=4, origin=(-9.6, -6.4, 0.0))
    lidar = Lidar(Mount(0.1, 0.0, 0.2), sweep=sweep, rate=5.0)
    tour = (("lobby", "south2", "south3"),)
    return simulate(Scenario(name="office", mapped=floor, tours=tour, lidar=lidar, drive=Drive(turn=1.6), seed=71))


def smoothed(recording: Recording, grid: OccupancyGrid | None = None, **changes: Any) -> Smoothed:
    settings = profiles.build({"hypotheses": 0, "particles": 1000})
    setup = memory.setup(recording, settings, seed=1, alpha="auto", **changes)
    smoothing = Smoothing(setup)
    for point in replay(smoothing.passing(memory.events(recording)), setup):
        smoothing.take(point)
    return smoothing.finish(grid or memory.grid_of(recording.scenario.mapped))


def errors(found: Smoothed, poses: FloatArray, recording: Recording) -> FloatArray:
    wrong = poses - recording.truth.at(np.array(found.stamps_ns))
    wrong[:, 2] = se2.wrap(wrong[:, 2])
    return wrong


def rmse(wrong: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(wrong[:, :2] ** 2, axis=1))))


def inside(wrong: FloatArray, covariances: FloatArray) -> float:
    """Share of errors within their 95 % ellipse in the plane."""
    planar, spread = wrong[:, :2], np.linalg.inv(covariances[:, :2, :2])
    return float(np.mean(np.einsum("ni,nij,nj->n", planar, spread, planar) < 5.991))


def test_the_track_is_better_than_the_filters_and_as_good_as_it_says() -> None:
    found = smoothed(driven())
    wrong = errors(found, found.best.poses, driven())
    assert rmse(wrong) < 0.005
    assert rmse(errors(found, found.filtered, driven())) > 0.012
    assert 0.88 < inside(wrong, found.best.covariances) <= 1.0
    squares = np.einsum("ni,nij,nj->n", wrong, np.linalg.inv(found.best.covariances), wrong)
    assert 0.5 < squares.mean() / 3.0 < 2.0
    assert (found.best.reliability > 0.9).all()


def test_it_learns_how_the_robot_measures() -> None:
    """Noise of 15 mm, 1 % of length and ½ % of turning too much, and walls whose face is half a cell before them."""
    learned = smoothed(driven()).best.learned
    assert learned.law.sigma == pytest.approx(0.015, abs=0.0015)
    assert learned.law.offset == pytest.approx(0.0293, abs=0.0015)
    assert learned.law.z > 0.95
    assert learned.drift.length == pytest.approx(1 / 1.01 - 1, abs=0.012)
    assert learned.drift.turn == pytest.approx(1 / 0.995 - 1, abs=0.015)
    assert not any((learned.evidence.repeated, learned.evidence.misfitting, learned.evidence.scarce))


def test_a_wrong_map_is_told_and_states_no_certainty() -> None:
    """What is occupied in each piece of 2 m stands 10 cm off, every piece its own way."""
    grid = memory.grid_of(driven().scenario.mapped)
    cells, rng = np.where(grid.occupied, 0, grid.cells).astype(np.int8), np.random.default_rng(5)
    for row in range(0, cells.shape[0], 40):
        for column in range(0, cells.shape[1], 40):
            down, right = rng.integers(-2, 3, 2)
            rows, columns = np.nonzero(grid.occupied[row : row + 40, column : column + 40])
            rows, columns = rows + row + down, columns + column + right
            there = (rows >= 0) & (rows < cells.shape[0]) & (columns >= 0) & (columns < cells.shape[1])
            cells[rows[there], columns[there]] = 100
    wrong_map = OccupancyGrid(cells, grid.resolution, grid.origin)
    right, wrong = smoothed(driven()), smoothed(driven(), wrong_map)
    told = wrong.best.learned.evidence
    assert told.repeated
    assert told.misfitting
    spread = [np.sqrt(np.trace(one.best.covariances.mean(axis=0)[:2, :2])) for one in (right, wrong)]
    assert spread[1] > 5.0 * spread[0]


def test_odometry_within_a_scan_makes_its_stamp_less_sure() -> None:
    swept = driven(0.15)
    found = smoothed(swept, deskew=True)
    wrong = errors(found, found.best.poses, swept)
    assert rmse(wrong) < 0.012
    assert inside(wrong, found.best.covariances) > 0.88
    assert found.best.covariances[:, 2, 2].mean() > smoothed(driven()).best.covariances[:, 2, 2].mean()


def test_clock_and_mount_are_told_where_they_are_off_and_nowhere_else() -> None:
    right = smoothed(driven()).best.learned.mounting
    assert not right.is_late
    assert not right.is_moved
    late = smoothed(driven(), scan_offset_ns=-60_000_000).best.learned.mounting
    assert late.is_late
    assert late.late[0] == pytest.approx(0.06, abs=0.03)
    moved = smoothed(driven(), mounts={"": se3.from_planar([0.05, 0.0, 0.0])}).best.learned.mounting
    assert moved.is_moved
    assert moved.ahead[0] == pytest.approx(0.05, abs=0.02)


def test_what_does_not_follow_is_smoothed_by_itself() -> None:
    """The same drive as a second log, an hour later: the robot is back at the start, and no odometry says how."""
    events, hour = memory.events(driven()), 3600 * 10**9
    later = [
        (topic, dataclasses.replace(record, stamp_ns=record.stamp_ns + hour))  # type: ignore[type-var, attr-defined]
        for topic, record in events
    ]
    setup = memory.setup(driven(), profiles.build({"hypotheses": 0, "particles": 1000}), seed=1, alpha="auto")
    smoothing = Smoothing(setup)
    for point in replay(smoothing.passing([*events, ("", NextLog("another log")), *later]), setup):
        smoothing.take(point)
    found = smoothing.finish(memory.grid_of(driven().scenario.mapped))
    assert set(found.segments) == {0, 1}
    stamps = np.array(found.stamps_ns)
    wrong = found.best.poses - driven().truth.at(np.where(stamps >= stamps[0] + hour, stamps - hour, stamps))
    assert rmse(wrong) < 0.005
    assert found.best.odometry_costs.max() < 12.0


@pytest.mark.parametrize(("asked", "most"), [(0, 60), (200, 60), (12, 12)])
def test_no_more_beams_are_taken_than_see_different_cells(asked: int, most: int) -> None:
    setup = memory.setup(
        driven(), profiles.build({"hypotheses": 0, "max_beams": asked, "particles": 100}), alpha="auto"
    )
    smoothing = Smoothing(setup)
    for point in itertools.islice(replay(smoothing.passing(memory.events(driven())), setup), 5):
        smoothing.take(point)
    assert smoothing.drive().scans.counts.max() == most


def test_points_are_measured_and_keep_the_logs_odometry() -> None:
    found = smoothed(driven())
    points = list(found.points())
    assert [p.stamp_ns for p in points] == list(found.stamps_ns)
    assert all(p.updated and p.step is None for p in points)
    np.testing.assert_array_equal([p.estimate.pose for p in points], found.best.poses)
    np.testing.assert_array_equal([p.odom_from_base for p in points], found.recorded)


def test_the_same_drive_makes_the_same_bytes() -> None:
    first, second = smoothed(driven()), smoothed(driven())
    assert first.best.poses.tobytes() == second.best.poses.tobytes()
    assert first.best.covariances.tobytes() == second.best.covariances.tobytes()


def test_landmarks_alone_are_not_smoothed() -> None:
    with pytest.raises(InputError, match="needs a lidar"):
        Smoothing(replays.setup(instruments={"/camera": replays.CAMERA}))


def test_a_run_without_a_pose_is_not_smoothed() -> None:
    smoothing = Smoothing(replays.setup())
    with pytest.raises(InputError, match="no scan to smooth"):
        smoothing.finish(memory.grid_of(driven().scenario.mapped))
