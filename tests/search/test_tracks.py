"""Candidates through a window: whatever odometry makes of the way, the path is that of the scans."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.search import places, window
from mclcli.search.calibration import LAW
from mclcli.search.tracks import Ends, factorised, follow, interpolating
from mclcli.world.occupancy import UNKNOWN, OccupancyGrid
from tests.search.scenes import finder_for, hall, seen_from

if TYPE_CHECKING:
    from mclcli.sensors.observation import Observation

PATH = [(1.0 + 0.25 * i, 1.1 + 0.1 * math.sin(i), 0.2 * i) for i in range(10)]
SPACING = np.array([0.05, 0.05, 0.01])


def roomy_hall() -> OccupancyGrid:
    """The hall with unknown space around it: an endpoint behind a wall is still on the map."""
    return OccupancyGrid(np.pad(hall().cells, 20, constant_values=UNKNOWN), 0.05, np.array([-2.0, -1.5, 0.0]))


def drifted(seen: list[Observation], slip: int = -1) -> list[Observation]:
    """The same scans, their odometry a tenth too long and turning by 2° too much at each, once by 20° and 0.3 m."""
    places_ = np.array([one.odom_from_base for one in seen])
    steps = se2.between(places_[:-1], places_[1:]) * np.array([1.1, 1.1, 1.0]) + np.array([0.0, 0.0, math.radians(2.0)])
    if slip >= 0:
        steps[slip] += np.array([0.3, 0.0, math.radians(20.0)])
    at = [places_[0]]
    for step in steps:
        at.append(se2.compose(at[-1], step))
    return [dataclasses.replace(one, odom_from_base=odom) for one, odom in zip(seen, at, strict=True)]


@pytest.mark.parametrize("slip", [-1, 5])
def test_a_window_of_poor_odometry_is_not_less_sure_than_its_last_scan(slip: int) -> None:
    grid = roomy_hall()
    seen, search = drifted(seen_from(grid, *PATH, fov=2.0), slip), finder_for(grid)
    alone, window_ = search.find(seen[-1:], 3), search.find(seen, 3)
    assert alone is not None
    assert window_ is not None
    off = se2.between(np.array(PATH[-1]), window_.modes[0].pose)
    assert math.hypot(off[0], off[1]) < 0.1
    assert abs(off[2]) < math.radians(2.0)
    assert window_.modes[0].share > alone.modes[0].share - 0.02
    began = se2.between(np.array(PATH[0]), window_.modes[0].began)
    assert math.hypot(began[0], began[1]) < 0.1
    assert (np.linalg.eigvalsh(window_.modes[0].spread) > 0.0).all()


def test_a_path_is_followed_both_ways_from_where_it_was_found() -> None:
    grid = roomy_hall()
    search = finder_for(grid)
    view = search.view(drifted(seen_from(grid, *PATH)))
    assert view is not None
    models = [interpolating(search.scene.model, LAW.outliers, sight.beams.r_max) for sight in view.sights]
    ends = Ends(models, [sight.beams for sight in view.sights], np.full(len(models), 0.9))
    found = follow(np.array([PATH[4]]), 4, ends, view, SPACING)
    off = se2.between(np.array(PATH), found[0])
    assert found.shape == (1, 10, 3)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.1
    assert np.abs(off[:, 2]).max() < math.radians(3.0)
    spread = factorised(found, ends, view).marginals()[0][0]
    assert (np.sqrt(spread[:, 0, 0]) < 0.1).all()


def test_poses_nearer_than_a_place_are_one_and_the_cheapest_stands_for_it() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.1], [0.4, 0.0, 0.4], [0.95, 0.0, 0.0]])
    radii = np.array([0.5, 0.5, 0.25])
    assert places.distinct(poses, np.array([2.0, 1.0, 3.0, 4.0]), radii).tolist() == [1, 2, 3]
    assert places.distinct(poses, np.array([1.0, 2.0, 3.0, 4.0]), radii).tolist() == [0, 2, 3]


def test_odometry_is_less_sure_the_farther_it_goes_and_never_quite_sure() -> None:
    still, near, far, turned = window.noise(np.array([[0, 0, 0], [0.5, 0, 0], [2.0, 0, 0], [0.0, 0, 1.0]], float))
    for covariance in (still, near, far, turned):
        assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    assert (np.diag(still) < np.diag(near)).all()
    assert (np.diag(near) < np.diag(far)).all()
    assert turned[2, 2] > still[2, 2]
    assert far[1, 2] > 0.0  # who turns too far to the left on the way is too far on the left


def test_turns_count_as_way() -> None:
    np.testing.assert_allclose(window.ways(np.array([[0, 0, 0], [3, 4, 0], [3, 4, 1.0]], float)), [5.0, 0.5])
