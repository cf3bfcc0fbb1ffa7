"""The proof: branch and bound finds what trying every pose finds, and its bounds are bounds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mclcli.search import branching, lattice, plain
from mclcli.sensors.likelihood_field import LikelihoodFieldParameters
from mclcli.world import pyramid
from mclcli.world.distance_field import DistanceField
from mclcli.world.occupancy import FREE, OCCUPIED, OccupancyGrid
from tests.reference import search as reference
from tests.search.worlds import World, worlds

if TYPE_CHECKING:
    from mclcli.search.branching import Search

SLOW = settings(deadline=None, max_examples=40)
SLOWEST = settings(deadline=None, max_examples=15)  # every level of large worlds, node by node


def brute_force(world: World, search: Search) -> list[tuple[float, int, int, int]]:
    """Every pose, scored by the reference from the table of the field."""
    table = search.log_p[search.field.codes].tolist()
    ends = [(float(x), float(y)) for x, y in world.ends]
    return reference.every_score(
        table, float(search.log_p[-1]), ends, search.lattice.angles.tolist(), world.allowed.tolist()
    )


@SLOW
@given(worlds(largest=12))
def test_the_best_pose_is_the_one_that_trying_all_finds_to_the_bit(world: World) -> None:
    search = world.search()
    value, key = search.maximum()
    scores = brute_force(world, search)
    if not scores:
        assert (value, key) == (-math.inf, -1)
        return
    best = reference.best(scores)
    angle, row, column = search.lattice.nodes(np.array([key]))[0]
    assert (value, angle, row, column) == best


@SLOW
@given(worlds(largest=12), st.floats(0.1, 4.0), st.floats(0.1, 1.0))
def test_all_leaves_within_the_slack_are_found_and_the_mass_of_the_others_is_bounded(
    world: World, slack: float, alpha: float
) -> None:
    search = world.search()
    value, key = search.maximum()
    if key < 0:
        return
    found = search.near(value, key, slack, alpha, 200_000)
    assert found is not None
    scores = brute_force(world, search)
    height, width = search.lattice.places.shape
    expected = {(k * height + row) * width + column: v for v, k, row, column in scores if v >= value - slack}
    assert dict(zip(found.keys.tolist(), found.values.tolist(), strict=True)) == expected
    assert found.keys[0] == key
    assert (np.diff(found.values) <= 0.0).all()
    others = sum(math.exp(alpha * (v - value)) for v, *_ in scores if v < value - slack)
    assert others <= found.pruned * (1.0 + 1e-9) + 1e-12


def test_too_many_leaves_are_refused_not_cut_off() -> None:
    world = World(*_small_room())
    search = world.search()
    value, key = search.maximum()
    everything = search.near(value, key, 1e6, 1.0, search.lattice.size)
    assert everything is not None
    assert everything.keys.size == search.lattice.size
    assert everything.pruned == 0.0
    assert search.near(value, key, 1e6, 1.0, search.lattice.size - 1) is None


@SLOWEST
@given(worlds(largest=40))
def test_the_bound_of_a_node_is_not_below_any_of_its_children_at_every_level(world: World) -> None:
    search = world.search()
    rng = np.random.default_rng(0)
    nodes = plain.roots_of(search)
    while nodes and nodes[0][0] > 0:
        some = [nodes[i] for i in rng.permutation(len(nodes))[:20]]
        kids = {node: plain.children_of(search, node) for node in some}
        for node, children in kids.items():
            for level, t, row, column in children:
                value = (
                    plain.bound_of(search, (level, t, row, column)) if level else plain.value_of(search, t, row, column)
                )
                leaves = _some_leaves(search, (level, t, row, column), rng)
                assert plain.bound_of(search, node) >= max(leaves, default=-math.inf)
                assert not leaves or value >= max(leaves)
        nodes = [child for children in kids.values() for child in children]


def _some_leaves(search: Search, node: plain.Node, rng: np.random.Generator) -> list[float]:
    level, t, row, column = node
    span = pyramid.angles_in(level)
    height, width = search.lattice.places.shape
    picks = [
        (t * span + i, (row << level) + j, (column << level) + k)
        for i, j, k in rng.integers(0, [span, 1 << level, 1 << level], (6, 3))
    ]
    inside = [(a, r, c) for a, r, c in picks if a < search.lattice.angles.size and r < height and c < width]
    return [plain.value_of(search, int(a), int(r), int(c)) for a, r, c in inside]


@SLOWEST
@given(worlds(largest=40))
def test_the_compiled_search_agrees_with_the_readable_one(world: World) -> None:
    search = world.search()
    assert plain.maximum(search) == search.maximum()


@SLOWEST
@given(worlds(largest=40))
def test_the_sweep_finds_every_node_at_a_cost_that_is_a_bound(world: World) -> None:
    search = world.search()
    state, found, costs = np.zeros(4, np.int64), [], search.costs
    while not costs.done(state):
        found.append(costs.sweep(state, costs.most, costs.most, np.empty(0)))
    places = np.concatenate([nodes.places for nodes in found])
    bounds = costs.bounds(np.concatenate([nodes.costs for nodes in found]))
    fine = [(pyramid.FINE, *place) for place in map(tuple, places.tolist())]
    expected = {child for root in plain.roots_of(search) for child in plain.children_of(search, root)}
    assert set(fine) == expected
    assert len(fine) == len(expected)
    for i in np.random.default_rng(0).permutation(len(fine))[:200].tolist():
        exact = plain.bound_of(search, fine[i])
        assert exact <= bounds[i]
        assert bounds[i] <= exact + costs.step * search.lattice.ends.shape[1] + 1e-6


@pytest.mark.parametrize("shape", [(40, 3), (3, 40)])
def test_beams_longer_than_the_map_is_wide_are_found_along_it(shape: tuple[int, int]) -> None:
    cells = np.full(shape, FREE, np.int8)
    cells.reshape(-1)[[17 * 3 + 1, 25 * 3 + 1, 35 * 3 + 1] if shape[0] > shape[1] else [57, 65, 75]] = OCCUPIED
    reach = np.array([[12.0, 0.0], [20.0, 0.0], [30.0, 0.0]])
    world = World(OccupancyGrid(cells, 0.1, np.zeros(3)), reach, np.ones(shape, bool), _small_room()[3])
    search = world.search()
    value, key = search.maximum()
    angle, row, column = search.lattice.nodes(np.array([key]))[0]
    assert (value, angle, row, column) == reference.best(brute_force(world, search))
    assert sorted((int(row), int(column))) == [1, 5]


def test_a_sweep_stops_and_goes_on_where_the_room_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    whole: list[np.ndarray] = []
    parts: list[np.ndarray] = []
    search = World(*_small_room()).search()
    for chunk, into in ((1 << 17, whole), (2100, parts)):
        monkeypatch.setattr("mclcli.search.cost_tables._CHUNK", chunk)
        state = np.zeros(4, np.int64)
        while not search.costs.done(state):
            into.append(search.costs.sweep(state, search.costs.most, search.costs.most, np.empty(0)).places)
    assert len(parts) > len(whole)
    np.testing.assert_array_equal(np.concatenate(parts), np.concatenate(whole))


def test_of_equal_poses_the_first_is_found() -> None:
    empty = np.zeros((9, 17), bool)
    grid, ends, _, parameters = _small_room()
    free = World(grid.__class__(np.zeros((9, 17), np.int8), 0.1, np.zeros(3)), ends, ~empty, parameters)
    assert free.search().maximum()[1] == 0
    empty[4, 3] = empty[4, 5] = True
    assert World(free.grid, ends, empty, parameters).search().maximum()[1] == 4 * 17 + 3


def test_no_endpoint_moves_by_more_than_a_cell_from_angle_to_angle() -> None:
    for reach in (0.0, 0.3, 7.0, 400.0, 12345.6):
        step = lattice.angle_step(reach)
        assert step * reach <= 1.0
        assert math.tau / step == pytest.approx(round(math.tau / step), abs=1e-6)


def test_angles_can_be_limited() -> None:
    found = lattice.build(np.array([[50.0, 0.0]]), lattice.count_places(np.ones((3, 3), bool)), (3.0, 0.5))
    off = np.abs(np.remainder(found.angles - 3.0 + math.pi, math.tau) - math.pi)
    assert off.max() <= 0.5
    assert found.angles.size == pytest.approx(1.0 / found.step, abs=1.5)


def test_the_pyramid_takes_little_more_than_a_byte_a_cell() -> None:
    field = DistanceField(np.zeros((900, 700), np.uint16), np.array([0.0, 2.0]), 0.05, np.zeros(3))
    built = pyramid.build(field)
    assert built.pool.nbytes <= 1.2 * field.codes.size


def test_sightings_are_added_to_every_leaf() -> None:
    grid, ends, allowed, parameters = _small_room()
    search = World(grid, ends, allowed, parameters).search()
    marks = np.array([[2.5, 3.5, 0.3, 0.5, 0.0], [14.0, 1.0, -1.2, 0.5, 0.0]])
    density = 0.9 / (0.05 * math.sqrt(math.tau))
    law = np.array([density, -0.5 / 0.05**2, 0.1 / math.tau, 1e-15, 2.0 * math.log(density + 0.1 / math.tau)])
    both = branching.Sightings(marks, law)
    seen = branching.prepare(search.field, search.pyramid, search.lattice, search.log_p, both)
    scores = []
    for value, k, row, column in brute_force(World(grid, ends, allowed, parameters), search):
        yaw = search.lattice.angles[k]
        x, y = column + 0.5 + 0.5 * math.cos(yaw), row + 0.5 + 0.5 * math.sin(yaw)
        for mark_x, mark_y, bearing in marks[:, :3]:
            error = math.remainder(bearing - (math.atan2(mark_y - y, mark_x - x) - yaw), math.tau)
            value += math.log(density * math.exp(-0.5 * (error / 0.05) ** 2) + 0.1 / math.tau)  # noqa: PLW2901
        scores.append((value, k, row, column))
    best, key = seen.maximum()
    expected = reference.best(scores)
    assert best == pytest.approx(expected[0], abs=1e-9)
    assert tuple(search.lattice.nodes(np.array([key]))[0]) == expected[1:]


def _small_room() -> tuple:  # type: ignore[type-arg]
    from mclcli.sensors.likelihood_field import LikelihoodFieldParameters
    from tests.worlds import room

    grid = room()
    angles = np.arange(8) * 0.7
    ends = np.stack([6.0 * np.cos(angles), 4.0 * np.sin(angles)], axis=-1)
    return grid, ends, grid.free, LikelihoodFieldParameters(sigma_hit=0.15)


@SLOW
@given(worlds(largest=10), st.floats(0.1, 4.0), st.floats(0.1, 1.0), st.sampled_from([0.01, 0.1, 0.5]))
def test_the_mass_of_other_leaves_is_bounded_with_sightings_too(
    world: World, slack: float, alpha: float, sigma: float
) -> None:
    plainly = world.search()
    rng = np.random.default_rng(7)
    marks = np.column_stack([rng.uniform(-3.0, 12.0, (4, 2)), rng.uniform(-math.pi, math.pi, 4), np.zeros((4, 2))])
    density = 0.9 / (sigma * math.sqrt(math.tau))
    most = 4.0 * math.log(density + 0.1 / math.tau)
    law = np.array([density, -0.5 / sigma**2, 0.1 / math.tau, 1e-15, most])
    seen = branching.Sightings(marks, law)
    search = branching.prepare(plainly.field, plainly.pyramid, plainly.lattice, plainly.log_p, seen)
    value, key = search.maximum()
    if key < 0:
        return
    every, found = (search.near(value, key, nats, alpha, 200_000) for nats in (1e6, slack))
    assert every is not None
    assert found is not None
    assert every.keys.size == search.lattice.size
    inside = every.values >= value - slack
    assert every.values[inside].tolist() == found.values.tolist()
    others = float(np.exp(alpha * (every.values[~inside] - value)).sum())
    assert others <= found.pruned * (1.0 + 1e-9) + 1e-12


@pytest.mark.parametrize("beams", [1, 200, 300, 5000])
def test_the_sum_of_all_beams_costs_fits_its_numbers_and_the_worst_beams_cost_the_most(beams: int) -> None:
    grid, _, allowed, _ = _small_room()
    ends = np.random.default_rng(2).uniform(-5.0, 5.0, (beams, 2))
    sharp = LikelihoodFieldParameters(sigma_hit=0.05, z_hit=1.0, z_rand=0.0)  # 27 nats for a beam that fits nothing
    costs = World(grid, ends, allowed, sharp).search().costs
    assert costs.most <= 65_535
    assert costs.most == beams * min(255, 65_535 // beams)
    for plane in (costs.coarse, costs.fine, costs.leaves):
        assert plane.cells.max() == costs.most // beams
