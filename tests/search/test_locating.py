"""Where a robot is found, how sure the search is, and what it searches with."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.geometry import se2, se3
from mclcli.records import LandmarkSightings, LaserScan
from mclcli.replay.finder import GlobalSearch, Limits
from mclcli.search import branching, window
from mclcli.search import scene as scenes
from mclcli.sensors import beams as beam_selection
from mclcli.sensors.beams import BeamSelection
from mclcli.sensors.bearing import BearingModel, BearingParameters, Bearings
from mclcli.sensors.endpoints import Anchoring
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.sensors.observation import Observation
from mclcli.settings import profiles
from mclcli.world import distance_field
from mclcli.world.landmarks import Landmarks
from mclcli.world.occupancy import UNKNOWN, OccupancyGrid
from tests.search.scenes import MOUNT, cells_allowed, finder_for, hall, seen_from
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.search.parameters import BaseCells
    from mclcli.sensors.likelihood_field import FieldAnchor, OriginYaw

POSE = (1.3, 1.1, 0.7)


def off(pose: np.ndarray, true: tuple[float, float, float]) -> tuple[float, float]:
    """Distance [m] and angle [rad] from the truth."""
    error = se2.between(np.array(true), pose)
    return math.hypot(error[0], error[1]), abs(float(error[2]))


@pytest.mark.parametrize("origin", [(-1.0, -0.5, 0.0), (5.0e6, -3.0e5, 0.8), (2.0, 3.0, -2.5)])
@pytest.mark.parametrize(
    "mount",
    [np.eye(4), MOUNT, se3.from_rpy([0.2, 0.1, 0.3], math.pi, 0.0, 1.0)],
    ids=["at the base", "yawed", "upside down"],
)
def test_the_robot_is_found_wherever_the_map_lies_and_however_the_lidar_hangs(
    origin: tuple[float, float, float], mount: np.ndarray
) -> None:
    grid = hall(origin)
    true = tuple(se2.compose(np.array(origin), [3.1, 1.4, 2.0]).tolist())
    location = finder_for(grid).find(seen_from(grid, true, mount=mount), 5)
    assert location is not None
    best = location.modes[0]
    distance, angle = off(best.pose, true)
    assert distance < 0.05
    assert angle < math.radians(1.0)
    assert best.log_likelihood <= location.maximum + 1.0  # between the poses of the lattice there may be a better one
    assert best.share > 0.9


def test_a_narrow_view_with_many_no_returns_is_enough_where_the_map_allows_it() -> None:
    grid = hall()
    location = finder_for(grid).find(seen_from(grid, POSE, fov=math.radians(120.0), range_max=3.0), 5)
    assert location is not None
    assert off(location.modes[0].pose, POSE)[0] < 0.1


def test_the_pose_is_that_of_the_last_scan_whatever_odometry_did_before() -> None:
    cells = np.pad(hall().cells, 20, constant_values=UNKNOWN)
    grid = OccupancyGrid(cells, 0.05, np.array([-2.0, -1.5, 0.0]))
    poses = [(1.0 + 0.2 * i, 1.1 + 0.05 * i, 0.15 * i) for i in range(9)]
    seen = seen_from(grid, *poses)
    drift = np.array([0.0, 0.02, 0.02])
    drifted = [dataclasses.replace(o, odom_from_base=o.odom_from_base + i * drift) for i, o in enumerate(seen)]
    search = finder_for(grid)
    for observations, odometry in ((seen, "exact"), (drifted, "9° and 0.16 m off")):
        location = search.find(observations, 3)
        assert location is not None, odometry
        distance, angle = off(location.modes[0].pose, poses[-1])
        assert distance < 0.05, odometry
        assert angle < math.radians(1.0), odometry


@pytest.mark.parametrize("kind", ["beyond the map", "at random", "all alike", "two beams"])
def test_a_scan_that_says_nothing_is_not_believed(kind: str) -> None:
    grid = hall()
    (seen,) = seen_from(grid, POSE, range_max=60.0)
    assert isinstance(seen.reading, LaserScan)
    count = 2 if kind == "two beams" else seen.reading.ranges.size
    ranges = {
        "beyond the map": np.full(count, 50.0),
        "at random": np.random.default_rng(0).uniform(0.1, 20.0, count),
        "all alike": np.full(count, 4.5),
        "two beams": np.array([1.0, 2.0]),
    }[kind]
    drowned = dataclasses.replace(seen, reading=dataclasses.replace(seen.reading, ranges=ranges))
    location = finder_for(grid).find([drowned], 5)
    assert location is not None
    assert location.modes[0].share < 0.5


def test_a_window_is_cut_into_stretches() -> None:
    assert [window.stretches(count, 4) for count in (1, 4)] == [[], []]
    assert window.stretches(12, 4) == [range(4), range(4, 8), range(8, 12)]
    assert window.stretches(5, 4) == [range(2), range(2, 5)]


def test_a_place_that_stands_twice_on_the_map_is_told_as_two() -> None:
    grid = hall(twin=True)
    location = finder_for(grid).find(seen_from(grid, POSE), 5)
    assert location is not None
    first, second = location.modes[:2]
    twin = (POSE[0] + 6.0, POSE[1], POSE[2])
    for mode in (first, second):
        assert min(off(mode.pose, POSE)[0], off(mode.pose, twin)[0]) < 0.05
    assert off(first.pose, tuple(second.pose.tolist()))[0] == pytest.approx(6.0, abs=0.05)
    assert first.share < 0.85
    assert second.share > 0.1


def test_a_prior_and_a_region_tell_twins_apart() -> None:
    grid = hall(twin=True)
    for limits in (Limits(disc=(7.0, 1.0, 2.0)), Limits(region=(5.0, -0.5, 11.0, 3.5))):
        location = finder_for(grid, limits=limits).find(seen_from(grid, POSE), 5)
        assert location is not None
        assert off(location.modes[0].pose, (POSE[0] + 6.0, POSE[1], POSE[2]))[0] < 0.05
        assert location.modes[0].share > 0.9
    away = finder_for(grid, limits=Limits(about=(POSE[2] + math.pi, 0.5))).find(seen_from(grid, POSE), 5)
    assert away is not None
    assert all(abs(se2.wrap(mode.pose[2] - POSE[2] - math.pi)) <= 0.6 for mode in away.modes)


def test_no_cell_allowed_is_nowhere() -> None:
    grid = hall()
    assert finder_for(grid, limits=Limits(disc=(50.0, 50.0, 1.0))).find(seen_from(grid, POSE), 5) is None


def test_a_window_joins_scans_by_odometry() -> None:
    """Two narrow views that say little alone; the frame of odometry is another than the map's."""
    grid, path = hall(), [(1.3, 1.1, 0.7 + 0.5 * i) for i in range(8)]
    alone = finder_for(grid).find(seen_from(grid, path[-1], fov=0.7), 5)
    joined = finder_for(grid).find(seen_from(grid, *path, fov=0.7), 5)
    assert alone is not None
    assert joined is not None
    assert off(joined.modes[0].pose, path[-1])[0] < 0.1
    assert joined.modes[0].share > max(0.9, alone.modes[0].share - 1e-6)


def test_an_offset_makes_up_for_short_ranges_in_windows_too() -> None:
    """Ranges that are 20 cm short of every wall: with the offset all beams fit, and nothing else is different."""
    grid, path = hall(), [(1.3, 1.1, 0.7), (1.6, 1.3, 1.0)]
    seen = seen_from(grid, *path)
    short = [
        dataclasses.replace(o, reading=dataclasses.replace(o.reading, ranges=o.reading.ranges - 0.2))
        for o in seen
        if isinstance(o.reading, LaserScan)
    ]
    settings = profiles.build({"range_offset": 0.2})
    plain, mended, without = (
        finder.find(scans, 1)
        for finder, scans in ((finder_for(grid), seen), (finder_for(grid, settings), short), (finder_for(grid), short))
    )
    assert plain is not None
    assert mended is not None
    assert without is not None
    np.testing.assert_allclose(mended.modes[0].pose, plain.modes[0].pose, atol=1e-6)
    assert mended.modes[0].log_likelihood == pytest.approx(plain.modes[0].log_likelihood, abs=1e-6)
    assert without.modes[0].log_likelihood < plain.modes[0].log_likelihood - 5.0


def test_landmarks_tell_twins_apart() -> None:
    grid = hall(twin=True)
    marks = Landmarks(("a", "b"), np.array([[2.0, 1.5, 0.0], [8.5, 1.0, 0.0]]))
    twin = np.array([POSE[0] + 6.0, POSE[1], POSE[2]])
    rays = np.column_stack(
        [se2.between(twin, np.column_stack([marks.positions[:, :2], np.zeros(2)]))[:, :2], np.zeros(2)]
    )
    scans = seen_from(grid, POSE)
    sighting = Observation("/marks", LandmarkSightings(0, "cam", ("a", "b"), rays), scans[0].odom_from_base, np.eye(4))
    location = finder_for(grid, landmarks=marks).find([sighting, *scans], 5)
    assert location is not None
    assert off(location.modes[0].pose, tuple(twin.tolist()))[0] < 0.05
    assert location.modes[0].share > 0.9
    assert location.beams == 92


def test_a_scan_without_a_reading_says_nothing() -> None:
    scan = LaserScan(0, "laser", -1.0, 0.1, 0.05, 8.0, np.full(20, np.inf))
    assert finder_for(hall()).find([Observation("/scan", scan, np.zeros(3), np.eye(4))], 5) is None


def test_shares_sum_to_one_rank_the_places_and_lie_in_their_intervals() -> None:
    """With fewer poses enumerated, the interval is wider."""
    grid = hall()
    seen = seen_from(grid, POSE, fov=1.5)
    whole = _with(finder_for(grid, alpha=0.3), leaf_nats=7.4).find(seen, 32)
    part = _with(finder_for(grid, alpha=0.3), leaf_nats=4.0).find(seen, 32)
    assert whole is not None
    assert part is not None
    for location in (whole, part):
        shares = [mode.share for mode in location.modes]
        assert sum(shares) + location.elsewhere + location.unlisted == pytest.approx(1.0, abs=1e-12)
        assert shares == sorted(shares, reverse=True)
        assert all(0.0 <= mode.low <= mode.share <= mode.high <= 1.0 for mode in location.modes)
    assert part.modes[0].high - part.modes[0].low > whole.modes[0].high - whole.modes[0].low


def test_no_place_is_listed_twice() -> None:
    grid = hall(twin=True)
    location = finder_for(grid).find(seen_from(grid, POSE, fov=1.5), 32)
    assert location is not None
    poses = np.array([mode.pose for mode in location.modes])
    assert len(poses) > 3
    for i, pose in enumerate(poses[:-1]):
        apart = se2.between(pose, poses[i + 1 :])
        assert ((np.hypot(apart[:, 0], apart[:, 1]) >= 0.5) | (np.abs(apart[:, 2]) >= math.radians(15.0))).all()


def _with(search: GlobalSearch, leaf_nats: float) -> GlobalSearch:
    parameters = dataclasses.replace(search.settings.search, leaf_nats=leaf_nats)
    return dataclasses.replace(search, settings=dataclasses.replace(search.settings, search=parameters))


def test_refinement_goes_beyond_the_lattice_and_tells_where_it_is_loose() -> None:
    grid = hall()
    true = (1.3137, 1.1219, 0.7043)
    location = finder_for(grid).find(seen_from(grid, true), 1)
    assert location is not None
    mode = location.modes[0]
    assert off(mode.pose, true)[0] < 0.03
    assert np.linalg.eigvalsh(mode.covariance).min() > 0.0
    np.testing.assert_array_equal(mode.covariance, mode.covariance.T)
    wall = finder_for(grid).find(seen_from(grid, (2.0, 0.4, -math.pi / 2.0), fov=0.9, range_max=1.2), 1)
    assert wall is not None
    spread = np.linalg.eigvalsh(wall.modes[0].covariance[:2, :2])
    assert spread[1] > 4.0 * spread[0]  # along the wall it may be anywhere


@pytest.mark.parametrize(("policy", "cells"), [("free", 1), ("open", 2), ("any", 3)])
def test_where_the_base_may_be_is_a_choice(policy: BaseCells, cells: int) -> None:
    assert cells_allowed(drawn("#?."), policy).sum() == cells


def test_a_region_and_a_disc_hold_the_centres_of_cells() -> None:
    grid = drawn("....\n....\n....", 0.5, (1.0, 2.0, 0.0))  # centres at x = 1.25 … 2.75, y = 2.25 … 3.25
    by_region = {
        (1.25, 2.25, 2.25, 2.75): (3, 2),
        (2.25, 2.75, 1.25, 2.25): (3, 2),
        (1.26, 2.26, 2.24, 3.3): (1, 2),
        (1.7, 2.0, 1.8, 9.0): (1, 3),
    }
    for region, (columns, rows) in by_region.items():
        allowed = scenes.allowed_cells(grid, "free", region)
        assert (allowed.any(axis=0).sum(), allowed.any(axis=1).sum()) == (columns, rows), region
    assert np.argwhere(scenes.allowed_cells(grid, "free", None, (1.75, 2.75, 0.5))).tolist() == [
        [0, 1], [1, 0], [1, 1], [1, 2], [2, 1],
    ]  # fmt: skip


@pytest.mark.parametrize("anchor", ["corner", "half_cell"])
@pytest.mark.parametrize("turn", ["use", "ignore"])
def test_poses_of_the_lattice_are_where_their_cells_are(anchor: FieldAnchor, turn: OriginYaw) -> None:
    field = distance_field.compute(drawn("....\n.#..", 0.5, (1.0, -2.0, 0.4)), "exact", 2.0)
    model = LikelihoodField(field, LikelihoodFieldParameters(field_anchor=anchor, origin_yaw=turn))
    anything: Any = None
    scene = scenes.Scene(model, anything, anything, anything, anything)
    assert scene.anchoring == Anchoring(anchor == "half_cell", turn == "use")
    cells = np.array([[0.5, 0.5, 0.0], [3.25, 1.75, 1.0], [-2.0, 9.0, -3.0]])
    back = np.column_stack(scene.anchoring.to_cells(field, scene.to_map(cells)))
    np.testing.assert_allclose(back, cells, atol=1e-12)


def test_without_sightings_nothing_can_be_added() -> None:
    """What could be makes bounds looser, and the mass of poses that were not looked at larger."""
    assert branching.NO_SIGHTINGS.marks.shape == (0, 5)
    assert branching.NO_SIGHTINGS.law[4] == 0.0


def test_the_law_of_sightings_is_that_of_the_bearing_mixture() -> None:
    sigma, eps = 0.04, 0.2
    model = BearingModel(BearingParameters(sigma, eps))
    seen = Bearings(np.array([0.1, -0.2]), np.array([0.3, -0.5]), np.array([[1.0, 2.0], [3.0, 1.0]]), 1)
    field = distance_field.compute(drawn("....\n....", 0.5, (1.0, 2.0, 0.0)), "exact", 2.0)
    scene: Any = SimpleNamespace(model=SimpleNamespace(field=field), anchoring=Anchoring())
    found = scenes.sightings_of(scene, [seen], model)
    for error in (0.0, 0.03, 0.1, 2.0):
        p = max(found.law[0] * math.exp(found.law[1] * error**2) + found.law[2], found.law[3])
        assert math.log(p) == pytest.approx(float(model.log_p(np.array([error]))[0]), rel=1e-12)
    assert found.law[4] == pytest.approx(2.0 * float(model.log_p(np.zeros(1))[0]))
    np.testing.assert_allclose(found.marks[:, :2], [[0.0, 0.0], [4.0, -2.0]], atol=1e-12)
    np.testing.assert_allclose(found.marks[:, 2:], [[0.3, 0.2, -0.4], [-0.5, 0.2, -0.4]], atol=1e-12)


def test_all_profiles_find_the_robot() -> None:
    grid = hall()
    for profile in ("textbook", "nav2", "beluga"):
        settings = profiles.build({}, profile=profile)
        location = finder_for(grid, settings).find(seen_from(grid, POSE), 3)
        assert location is not None
        assert off(location.modes[0].pose, POSE)[0] < 0.08


def test_the_log_likelihood_is_what_scoring_says_at_that_pose() -> None:
    grid = hall((2.0, 3.0, 0.0))
    true = (3.4, 4.2, -2.0)
    search, seen = finder_for(grid), seen_from(grid, true)
    location, view = search.find(seen, 5), search.view(seen)
    assert location is not None
    assert view is not None
    for mode in location.modes:
        scored = search.scene.model.measure("lidar", view.beams).log_likelihood(mode.pose[np.newaxis])[0]
        assert scored == pytest.approx(mode.log_likelihood, abs=1e-9)


def test_scans_joined_are_those_beams_seen_from_the_last_base() -> None:
    grid, path = hall(), [(1.3, 1.1, 0.7), (1.5, 1.2, 1.0)]
    seen = seen_from(grid, *path)
    joined = finder_for(grid).view(seen)
    assert joined is not None
    ends = se2.compose(
        np.array(path[-1]), np.column_stack([joined.beams.endpoints, np.zeros(len(joined.beams.ranges))])
    )
    expected = []
    for pose, observation in zip(path, seen, strict=True):
        assert isinstance(observation.reading, LaserScan)
        own = beam_selection.select(observation.reading, MOUNT, BeamSelection(max_beams=120)).endpoints
        expected.append(se2.compose(np.array(pose), np.column_stack([own, np.zeros(len(own))]))[:, :2])
    distance = np.linalg.norm(ends[:, np.newaxis, :2] - np.concatenate(expected), axis=2).min(axis=1)
    assert distance.max() < 1e-9
    bearings = np.arctan2(*joined.beams.endpoints.T[::-1])
    assert (np.diff(bearings) >= 0.0).all()


def test_scans_are_chosen_along_the_way_and_a_standing_robot_has_one() -> None:
    straight = np.column_stack([np.linspace(0.0, 3.0, 61), np.zeros((61, 2))])
    assert window.spread(straight, 4).tolist() == [0, 20, 40, 60]
    assert window.spread(np.zeros((9, 3)), 5).tolist() == [8]
    assert window.spread(straight[:1], 5).tolist() == [0]
    assert window.spread(straight[:3] * 0.2, 9).tolist() == [2]
    assert window.spread(straight[:11] * 0.2, 12).tolist() == [0, 5, 10]  # none nearer than 5 cm
