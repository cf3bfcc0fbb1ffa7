from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mclcli.geometry import se2
from samples.sim.building import OCCUPIED, Building, Landmarks, Rect, paint, solid
from samples.sim.robot import Trajectory
from samples.sim.sensors import PERSON_RADIUS, Camera, Lidar, Mount, People, scans, sightings
from tests.samples.naive import ray_length

NOBODY = People()
PURE = Lidar(
    Mount(0.0, 0.0, 0.2), beams=37, angle_increment=math.tau / 36, sigma=0.0, dropout=0.0, short=0.0, rate=10.0
)
SHARP = Camera(Mount(0.0, 0.0, 0.5), fov=2.0, reach=20.0, sigma=0.0, missed=0.0, wrong=0.0, unknown=0.0)


@pytest.fixture(scope="module")
def room() -> Building:
    """A room of 5 × 3 m with a pillar; marks on the right wall, behind the pillar, and behind the robot."""
    grid = solid(6.0, 4.0, margin=0.3)
    paint(grid, Rect(0.5, 0.5, 5.5, 3.5), 0)
    paint(grid, Rect(3.5, 1.0, 3.8, 1.4), OCCUPIED)
    positions = np.array([[5.475, 2.825, 1.5], [5.475, 0.625, 1.5], [0.525, 2.025, 1.5]])
    return Building("room", grid, (), (), {}, Landmarks(("a", "b", "c"), positions))


def standing(pose: tuple[float, float, float], steps: int = 60) -> Trajectory:
    return Trajectory(20_000_000 * np.arange(steps, dtype=np.int64), np.tile(np.array(pose), (steps, 1)))


def test_a_pure_scan_is_the_geometry(room: Building) -> None:
    mounted = replace(PURE, mount=Mount(0.2, -0.1, 0.2, yaw=0.35))
    _, ranges = scans(mounted, room, NOBODY, standing((2.0, 2.0, 0.5)), seed=0)
    x, y, yaw = se2.compose([2.0, 2.0, 0.5], [0.2, -0.1, 0.35])
    exact = [ray_length(room.occupied, 0.05, float(x), float(y), float(yaw + a)) for a in mounted.angles]
    assert ranges.dtype == np.float32
    np.testing.assert_allclose(ranges, np.tile(exact, (len(ranges), 1)), atol=0.5 / 1024 + 1e-9)
    np.testing.assert_array_equal(ranges * 1024, np.round(ranges * 1024))


def test_upside_down_mirrors_the_scan(room: Building) -> None:
    truth = standing((2.0, 2.0, 0.0))
    _, upright = scans(PURE, room, NOBODY, truth, seed=0)
    _, hanging = scans(replace(PURE, mount=Mount(0.0, 0.0, 0.2, upside_down=True)), room, NOBODY, truth, seed=0)
    assert not np.allclose(upright, hanging)
    np.testing.assert_allclose(hanging, upright[:, ::-1], atol=1e-3)  # beams ±180° look the same way


def test_noise_dropouts_and_short_readings_have_their_shares(room: Building) -> None:
    truth = standing((2.0, 2.0, 0.0), 5000)
    _, pure = scans(PURE, room, NOBODY, truth, seed=0)
    _, real = scans(replace(PURE, sigma=0.02, dropout=0.05, short=0.1), room, NOBODY, truth, seed=0)
    error = real - pure
    assert np.isinf(real).mean() == pytest.approx(0.05, abs=0.006)
    assert np.mean(error < -0.1) == pytest.approx(0.1, abs=0.02)
    assert np.std(error[np.abs(error) < 0.08]) == pytest.approx(0.02, rel=0.1)


def test_beyond_range_max_is_no_return(room: Building) -> None:
    _, ranges = scans(replace(PURE, range_max=2.0), room, NOBODY, standing((2.0, 2.0, 0.0)), seed=0)
    assert np.isinf(ranges[0, 18])  # straight ahead, 3.5 m of nothing
    assert np.max(ranges[np.isfinite(ranges)]) < 2.0


def test_people_walk_to_and_fro_through_the_scan(room: Building) -> None:
    truth = standing((1.0, 3.0, 0.0), 2000)
    walkers = People((np.array([[2.5, 3.0], [4.5, 3.0]]),), (0.5,), speed=1.0)
    stamps, ranges = scans(PURE, room, walkers, truth, seed=0)
    ahead = ranges[:, 18]  # the person crosses this beam's line from 1.5 to 3.5 m ahead
    expected = 1.5 + (2.0 - np.abs((stamps / 1e9 + 0.5) % 4.0 - 2.0)) - PERSON_RADIUS
    np.testing.assert_allclose(ahead, expected, atol=2e-3)


def test_people_step_aside(room: Building) -> None:
    del room
    walkers = People((np.array([[0.0, 0.1], [4.0, 0.1]]),), (0.0,), speed=1.0)
    stamps = 10_000_000 * np.arange(800, dtype=np.int64)
    there = walkers.positions(stamps, np.tile([2.0, 0.0, 0.0], (800, 1)))
    assert np.min(np.hypot(there[:, 0, 0] - 2.0, there[:, 0, 1])) == pytest.approx(0.75)


def test_a_sweep_takes_time(room: Building) -> None:
    """Turning at 1 rad/s, the last beam of a sweep of 0.09 s looks 0.0875 rad further than it would at once."""
    stamps = 20_000_000 * np.arange(60, dtype=np.int64)
    turning = Trajectory(stamps, np.column_stack([np.full(60, 2.0), np.full(60, 2.0), se2.wrap(stamps / 1e9)]))
    swept = replace(PURE, sweep=0.09)
    at, ranges = scans(swept, room, NOBODY, turning, seed=0)
    yaw = at[3] / 1e9 + np.arange(37) * round(0.09e9 / 37) / 1e9
    exact = [ray_length(room.occupied, 0.05, 2.0, 2.0, float(a)) for a in yaw + swept.angles]
    np.testing.assert_allclose(ranges[3], exact, atol=0.5 / 1024 + 1e-6)
    assert at[-1] + 90_000_000 <= stamps[-1]


def test_the_camera_sees_what_is_in_view(room: Building) -> None:
    pose = (1.5, 1.8, 0.2)
    images = sightings(SHARP, room, standing(pose), seed=0)
    assert len(images) > 3
    for image in images:
        assert image.ids == ("a",)  # b stands behind the pillar, c behind the robot
        expected = math.atan2(2.825 - 1.8, 5.475 - 1.5) - 0.2
        assert image.bearings[0] == pytest.approx(expected, abs=1e-12)


def test_a_turned_camera_measures_in_its_own_frame(room: Building) -> None:
    turned = replace(SHARP, mount=Mount(0.3, 0.1, 0.5, yaw=0.4))
    (image, *_) = sightings(turned, room, standing((1.5, 1.8, 0.2)), seed=0)
    x, y, yaw = se2.compose([1.5, 1.8, 0.2], [0.3, 0.1, 0.4])
    assert image.bearings[image.ids.index("a")] == pytest.approx(math.atan2(2.825 - y, 5.475 - x) - yaw)


def test_wrong_unknown_and_missed_sightings_have_their_shares(room: Building) -> None:
    poor = replace(SHARP, rate=25.0, missed=0.3, wrong=0.2, unknown=0.1, sigma=0.05)
    images = sightings(poor, room, standing((1.5, 1.8, 0.2), 10_000), seed=1)
    names = [name for image in images for name in image.ids]
    assert len(names) / len(images) == pytest.approx(0.7, abs=0.03)
    assert np.mean([name in {"b", "c"} for name in names]) == pytest.approx(0.2, abs=0.03)
    assert np.mean([name.startswith("x") for name in names]) == pytest.approx(0.1, abs=0.02)
    assert np.std(np.concatenate([image.bearings for image in images])) == pytest.approx(0.05, rel=0.05)


def test_sensor_seeds_change_the_noise_only(room: Building) -> None:
    truth, noisy = standing((2.0, 2.0, 0.0)), replace(PURE, sigma=0.02)
    first, again, other = (scans(noisy, room, NOBODY, truth, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first[1], again[1])
    np.testing.assert_array_equal(first[0], other[0])
    assert not np.array_equal(first[1], other[1])
