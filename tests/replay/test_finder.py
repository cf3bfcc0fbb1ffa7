"""The search in the filter: where particles start, and where they are drawn anew."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mclcli import rng
from mclcli.filter.recovery import Situation
from mclcli.filter.start import Opening, Patience, Placed
from mclcli.geometry import se2
from mclcli.motion.odometry import OdometryPath
from mclcli.records import Estimate, LaserScan, StepRecord
from mclcli.replay.finder import FoundAgain, FoundOnMap
from tests.search.scenes import finder_for, hall, seen_from

TRUE = (1.3, 1.1, 0.7)


def draws() -> np.random.Generator:
    return rng.stream(0, rng.Purpose.INITIALISE)


def near(poses: np.ndarray, true: tuple[float, float, float]) -> np.ndarray:
    """Which poses are within 0.3 m and 10° of the truth."""
    off = se2.between(np.array(true), poses)
    return np.asarray((np.hypot(off[:, 0], off[:, 1]) < 0.3) & (np.abs(off[:, 2]) < math.radians(10.0)))


def test_one_clear_scan_is_enough_to_start_from() -> None:
    grid = hall()
    seen = tuple(seen_from(grid, TRUE))
    placed = FoundOnMap(finder_for(grid), grid).place(Opening(0, OdometryPath(), seen), 500, draws())
    assert isinstance(placed, Placed)
    assert placed.poses.shape == (500, 3)
    assert near(placed.poses, TRUE).mean() > 0.9
    assert near(placed.places[:1], TRUE).all()
    assert placed.probabilities[0] > 0.9
    again = FoundOnMap(finder_for(grid), grid).place(Opening(0, OdometryPath(), seen), 500, draws())
    assert isinstance(again, Placed)
    np.testing.assert_array_equal(placed.poses, again.poses)


def test_a_start_in_doubt_waits_and_then_shares_the_particles_out() -> None:
    grid = hall(twin=True)
    start = FoundOnMap(finder_for(grid), grid)
    path = [(TRUE[0], TRUE[1], TRUE[2] + 0.4 * i) for i in range(3)]
    seen = tuple(seen_from(grid, *path))
    assert start.place(Opening(0, OdometryPath(), seen[:1]), 400, draws()) is Patience.HOLD
    assert start.place(Opening(0, OdometryPath(), (seen[0], seen[0])), 400, draws()) is Patience.HOLD
    placed = start.place(Opening(0, OdometryPath(), seen, complete=True), 400, draws())
    assert isinstance(placed, Placed)
    twin = (TRUE[0] + 6.0, TRUE[1], TRUE[2])
    shares = near(placed.poses, TRUE).mean(), near(placed.poses, twin).mean()  # at the first of the scans
    assert {near(placed.places[:2], at).sum() for at in (TRUE, twin)} == {1}
    assert placed.probabilities[0] < 0.8
    assert min(shares) > 0.1
    assert sum(shares) > 0.5


def test_a_lost_robot_is_proposed_where_its_scan_fits() -> None:
    grid = hall()
    seen = tuple(seen_from(grid, TRUE))
    nothing = np.zeros((1, 3))
    record = StepRecord(
        step=3, stamp_ns=0, poses=nothing, sensors=("lidar",), alphas=(1.0,), log_likelihoods=np.zeros((1, 1)),
        log_weights=np.zeros(1), weights=np.ones(1), ess=1.0, log_evidence=0.0, resampled=True, degenerate=False,
        beams_used=1, estimate=Estimate(nothing[0], np.zeros((3, 3))), segment=0, converged=False, reliability=0.0,
    )  # fmt: skip
    proposal = FoundAgain(finder_for(grid), grid)
    drawn = proposal(Situation(record, seen, seen[0].odom_from_base, OdometryPath()), 200, draws()).poses
    assert near(drawn, TRUE).mean() > 0.9
    blind = proposal(Situation(record, (), seen[0].odom_from_base, OdometryPath()), 200, draws()).poses
    assert blind.shape == (200, 3)
    assert near(blind, TRUE).mean() < 0.2


def test_readings_shorter_than_a_cell_say_nothing_of_the_place() -> None:
    """Zeros stand for no return in many logs; of them every place would be as good, and each be looked at."""
    grid = hall()
    search = finder_for(grid)
    seen = seen_from(grid, TRUE)[0]
    assert isinstance(seen.reading, LaserScan)
    for least in (0.0, 0.9 * grid.resolution):
        short = dataclasses.replace(seen.reading, ranges=np.full_like(seen.reading.ranges, least), range_min=0.0)
        assert search.find([dataclasses.replace(seen, reading=short)], 4) is None
    some = seen.reading.ranges.copy()
    some[::2] = 0.0
    half = dataclasses.replace(seen, reading=dataclasses.replace(seen.reading, ranges=some, range_min=0.0))
    location = search.find([half], 4)
    assert location is not None
    assert near(np.array([location.modes[0].pose]), TRUE).all()
