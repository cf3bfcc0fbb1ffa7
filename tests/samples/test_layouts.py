from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from samples.sim.building import FREE, OCCUPIED, UNKNOWN, Building, patch
from samples.sim.changes import close_doors, move_boxes
from samples.sim.layouts import corridors, hall, office_floor
from samples.sim.planning import plan, terrain

if TYPE_CHECKING:
    from collections.abc import Callable

LAYOUTS: dict[str, Callable[[int], Building]] = {
    "office": office_floor,
    "hall": hall,
    "pillars": lambda seed: hall(seed, racks=False),
    "corridors": corridors,
}
SEEDS = (0, 4, 9)


@pytest.fixture(params=[(name, seed) for name in LAYOUTS for seed in SEEDS], ids=lambda p: f"{p[0]}-{p[1]}")
def building(request: pytest.FixtureRequest) -> Building:
    name, seed = request.param
    return LAYOUTS[name](seed)


def test_every_place_can_be_reached(building: Building) -> None:
    ground = terrain(building)
    start, *others = building.places.values()
    for place in others[::3]:
        path = plan(ground, start, place)
        assert np.hypot(*(path[-1] - place)) < 1.6
        assert np.max(np.hypot(*np.diff(path, axis=0).T)) < 0.16


def test_paths_keep_clear_of_everything(building: Building) -> None:
    start, *_, goal = building.places.values()
    for x, y in plan(terrain(building), start, goal):
        around = building.grid[
            round((y - 0.2) / 0.05) : round((y + 0.2) / 0.05), round((x - 0.2) / 0.05) : round((x + 0.2) / 0.05)
        ]
        assert np.all(around == FREE)


def test_the_grid_is_closed(building: Building) -> None:
    """No free cell borders the unknown: whatever is free has walls around it."""
    free = building.grid == FREE
    assert 0.3 < free.mean() < 0.9
    for unknown in (np.roll(building.grid == UNKNOWN, shift, axis) for shift in (-1, 1) for axis in (0, 1)):
        assert not np.any(free & unknown)


def test_landmarks_hang_on_walls_apart_from_each_other(building: Building) -> None:
    marks = building.landmarks
    assert len(marks.ids) == len(set(marks.ids)) == len(marks.positions) >= 8
    cells = np.floor(marks.positions[:, :2] / building.resolution).astype(int)
    for column, row in cells:
        assert building.grid[row, column] == FREE
        assert np.any(building.grid[row - 1 : row + 2, column - 1 : column + 2] == OCCUPIED)
    gaps = np.hypot(*(marks.positions[:, np.newaxis, :2] - marks.positions[:, :2]).transpose(2, 0, 1))
    assert np.min(gaps[~np.eye(len(gaps), dtype=bool)]) >= 1.4


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_seed_makes_the_building(name: str) -> None:
    once, again, other = LAYOUTS[name](1), LAYOUTS[name](1), LAYOUTS[name](2)
    np.testing.assert_array_equal(once.grid, again.grid)
    assert once.landmarks.ids == again.landmarks.ids
    assert not np.array_equal(once.landmarks.positions, other.landmarks.positions)
    if name != "corridors":
        assert not np.array_equal(once.grid, other.grid)


def test_corridors_repeat_but_for_their_boxes() -> None:
    floor = corridors(seed=0, count=3)
    bare = np.array(floor.grid)
    arms = [bare[60:, 28 + 80 * k - 10 : 28 + 80 * k + 60] for k in range(3)]
    assert not np.array_equal(arms[0], arms[1])
    assert len(floor.boxes) == 2
    free = [np.sum(arm == FREE) for arm in arms]
    assert free[0] < free[1]
    assert free[2] < free[1]


def test_moved_boxes_leave_free_floor_behind() -> None:
    floor = office_floor(4)
    changed = move_boxes(floor, seed=1, count=2)
    for box in floor.boxes[:2]:
        assert np.all(patch(changed.grid, box) == FREE)
    for box in changed.boxes:
        assert np.all(patch(changed.grid, box.grown(-0.05)) != FREE)
        assert np.any(patch(changed.grid, box) == OCCUPIED)
    assert changed.boxes[2:] == floor.boxes[2:]
    assert set(changed.boxes[:2]).isdisjoint(floor.boxes)
    outside = np.array(changed.grid)
    for box in (*floor.boxes[:2], *changed.boxes[:2]):
        patch(outside, box)[:] = patch(floor.grid, box)
    np.testing.assert_array_equal(outside, floor.grid)


def test_a_closed_door_shuts_its_room() -> None:
    floor = office_floor(4)
    inside, outside = floor.places["south1"], floor.places["lobby"]
    assert len(plan(terrain(floor), outside, inside)) > 10
    with pytest.raises(ValueError, match="no way"):
        plan(terrain(close_doors(floor, (0,))), outside, inside)


def test_map_and_floor_frames_are_inverse() -> None:
    floor = hall(0, origin=(3.0, -2.0, 0.7))
    poses = np.array([[1.0, 2.0, 0.5], [20.0, 3.0, -3.0]])
    np.testing.assert_allclose(floor.to_floor(floor.to_map(poses)), poses, atol=1e-12)
    np.testing.assert_allclose(floor.to_map([0.0, 0.0, 0.0]), [3.0, -2.0, 0.7])
