"""Ray casting against every cell by brute force, and where rays start, end and squeeze through."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, get_args

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mclcli.geometry import se2
from mclcli.native import backend
from mclcli.world.raycast import CastMethod, RayCaster, make_caster
from tests.reference.raycast import first_hit, is_clear, pieces
from tests.support import grid_of
from tests.worlds import drawn, empty

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mclcli.arrays import BoolArray, FloatArray

EPSILON = 1 / 256
WALKS: tuple[CastMethod, ...] = ("exact", "approximate")
shapes = st.tuples(st.integers(1, 12), st.integers(1, 12))
rooms = shapes.flatmap(lambda shape: arrays(np.bool_, shape, elements=st.integers(0, 6).map(lambda i: i == 0)))
places = st.floats(-4.0, 16.0)
angles = st.one_of(st.floats(-4.0, 4.0), st.sampled_from([0.0, math.pi / 4, math.pi / 2, math.pi, -math.pi / 2, 2.0]))


def cast(caster: RayCaster, pose: Sequence[float], max_range: float = 30.0, direction: ArrayLike = (1.0, 0.0)) -> float:
    """One ray straight ahead."""
    rays = np.array([direction], dtype=np.float64)
    return float(caster.ranges(np.array([pose], dtype=np.float64), np.zeros((1, 2)), rays, max_range)[0, 0])


@given(occupied=rooms, x=places, y=places, yaw=angles, limit=st.floats(0.1, 40.0))
def test_the_exact_range_is_that_of_brute_force(
    occupied: BoolArray, x: float, y: float, yaw: float, limit: float
) -> None:
    dx, dy = math.cos(yaw), math.sin(yaw)
    assume(is_clear(occupied.tolist(), x, y, dx, dy))
    expected = first_hit(occupied.tolist(), x, y, dx, dy, limit)
    assert cast(make_caster(grid_of(occupied)), (x, y, yaw), limit) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("share", [0.005, 0.02, 0.2])
def test_leaps_over_open_space_lose_nothing(share: float) -> None:
    generator = np.random.default_rng(3)
    occupied = generator.random((90, 70)) < share
    x, y = generator.uniform(-9, 79, 60), generator.uniform(-9, 99, 60)
    yaw = np.arctan2(generator.uniform(0, 90, 60) - y, generator.uniform(0, 70, 60) - x)
    poses = np.column_stack([x, y, yaw])
    got = make_caster(grid_of(occupied)).ranges(poses, np.zeros((1, 2)), np.array([[1.0, 0.0]]), 150.0)[:, 0]
    cells = occupied.tolist()
    expected = [first_hit(cells, px, py, math.cos(a), math.sin(a), 150.0) for px, py, a in poses.tolist()]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)
    assert (got < 150.0).sum() > 10
    assert np.ptp(got[got < 150.0]) > 10.0


@given(occupied=rooms, x=places, y=places, yaw=angles)
def test_the_approximate_range_keeps_its_bound(occupied: BoolArray, x: float, y: float, yaw: float) -> None:
    dx, dy = math.cos(yaw), math.sin(yaw)
    assume(is_clear(occupied.tolist(), x, y, dx, dy, 1e-7))
    met = [first for first, last in pieces(occupied.tolist(), x, y, dx, dy) if last - first >= EPSILON]
    exact, limit = first_hit(occupied.tolist(), x, y, dx, dy, 40.0), min([40.0, *met])
    got = cast(make_caster(grid_of(occupied), method="approximate"), (x, y, yaw), 40.0)
    assert exact - EPSILON - 1e-9 <= got <= limit + 1e-9


def grazing(generator: np.random.Generator, count: int) -> FloatArray:
    """Poses (N, 3) whose rays pass the corner (20, 20) at distances of 1e-6 to 0.1 cells, on either side."""
    yaw = generator.uniform(-math.pi, math.pi, count)
    aside = generator.choice([-1.0, 1.0], count) * 10.0 ** generator.uniform(-6, -1, count)
    back = generator.uniform(3.0, 15.0, count)
    x = 20.0 - back * np.cos(yaw) - aside * np.sin(yaw)
    return np.column_stack([x, 20.0 - back * np.sin(yaw) + aside * np.cos(yaw), yaw])


def test_the_bound_holds_for_rays_that_graze_a_corner() -> None:
    occupied = np.zeros((40, 40), dtype=bool)
    occupied[20:26, 20:23] = True
    poses, missed = grazing(np.random.default_rng(8), 2000), 0
    casters = [make_caster(grid_of(occupied), method=method) for method in WALKS]
    exact, near = (caster.ranges(poses, np.zeros((1, 2)), np.array([[1.0, 0.0]]), 50.0)[:, 0] for caster in casters)
    for (x, y, yaw), true, got in zip(poses.tolist(), exact.tolist(), near.tolist(), strict=True):
        cuts = pieces(occupied.tolist(), x, y, math.cos(yaw), math.sin(yaw))
        met = [first for first, last in cuts if last - first >= EPSILON]
        assert true - EPSILON - 1e-9 <= got <= min([50.0, *met]) + 1e-9
        missed += got > true + EPSILON
        assert bool(got <= true + EPSILON) or cuts[0][1] - cuts[0][0] < EPSILON
    assert 0 < missed < 1000  # cut corners, which only the exact walk sees


def test_both_walks_agree_on_walls() -> None:
    generator = np.random.default_rng(4)
    occupied = np.ones((60, 60), dtype=bool)
    occupied[1:-1, 1:-1] = False
    occupied[30, :20] = occupied[10:50, 40] = True
    poses = np.column_stack([generator.uniform(1, 59, (4000, 2)), generator.uniform(-4, 4, 4000)])
    both = [make_caster(grid_of(occupied), method=method) for method in WALKS]
    exact, near = (caster.ranges(poses, np.zeros((1, 2)), np.array([[1.0, 0.0]]), 90.0)[:, 0] for caster in both)
    agree = np.abs(exact - near) <= EPSILON + 1e-9
    assert agree.mean() > 0.995


@pytest.mark.parametrize("method", WALKS)
@pytest.mark.parametrize("count", [1, 7, 60, 128, 300])
def test_rays_cast_together_are_those_cast_alone(method: CastMethod, count: int) -> None:
    generator = np.random.default_rng(count)
    caster = make_caster(grid_of(generator.random((50, 70)) < 0.03), method=method)
    poses = np.column_stack([generator.uniform(-9, 79, (9, 2)), generator.uniform(-4, 4, 9)])  # some off the map
    poses[4, 1] = math.nan
    yaw = generator.uniform(-4, 4, count)
    origins, directions = generator.uniform(-2, 2, (count, 2)), np.column_stack([np.cos(yaw), np.sin(yaw)])
    together = caster.ranges(poses, origins, directions, 30.0)
    for b in range(count):
        alone = caster.ranges(poses, origins[b : b + 1], directions[b : b + 1], 30.0)[:, 0]
        np.testing.assert_array_equal(together[:, b], alone)
    assert np.isnan(together[4]).all()
    assert np.isfinite(np.delete(together, 4, axis=0)).all()


@pytest.mark.parametrize("method", WALKS)
@pytest.mark.parametrize("mirrored", [False, True])
def test_no_ray_gets_through_a_diagonal_wall(method: CastMethod, *, mirrored: bool) -> None:
    wall = np.eye(40, dtype=bool)
    caster = make_caster(grid_of(wall[:, ::-1] if mirrored else wall), method=method)
    generator = np.random.default_rng(6)
    along, back = generator.uniform(10, 30, 6000), generator.uniform(1, 9, 6000)
    along[:4000] = np.rint(along[:4000])  # through the corners of its cells, as far as rounding allows
    along[2000:4000] += generator.choice([1e-15, -1e-9, 1e-6, -1e-3, 3e-3], 2000)
    yaw = generator.choice([-0.25, 0.75], 6000) * math.pi + generator.uniform(-0.7, 0.7, 6000)  # from both sides
    x, y = along - back * np.cos(yaw), along - back * np.sin(yaw)
    poses = np.column_stack([40.0 - x, y, math.pi - yaw]) if mirrored else np.column_stack([x, y, yaw])
    got = caster.ranges(poses, np.zeros((1, 2)), np.array([[1.0, 0.0]]), 60.0)[:, 0]
    assert (got <= back + 2.0).all()


@pytest.mark.parametrize("method", WALKS)
@pytest.mark.parametrize("quarter", range(4))
def test_a_ray_exactly_through_the_corner_of_two_blocked_cells_stops(method: CastMethod, quarter: int) -> None:
    diagonal = np.rot90(np.array([[0, 1], [1, 0]], dtype=bool), quarter)
    caster = make_caster(grid_of(diagonal), method=method)
    starts = [(-1.0, -1.0), (3.0, -1.0), (3.0, 3.0), (-1.0, 3.0)]
    x, y = starts[-quarter % 4]
    step = np.sign([1.0 - x, 1.0 - y]) * 0.5  # exactly diagonal, as no angle in radians is
    assert cast(caster, (x, y, 0.0), 30.0, step) == pytest.approx(4.0, abs=1e-12)
    alone = make_caster(grid_of([[0, 1], [0, 0]]), method=method)
    assert cast(alone, (-1.0, -1.0, 0.0), 30.0, (0.5, 0.5)) == 30.0


@pytest.mark.parametrize("method", get_args(CastMethod))
def test_where_rays_start_and_end(method: CastMethod) -> None:
    caster = make_caster(drawn("#....\n#....\n#...."), method=method)
    assert cast(caster, (0.4, 1.2, 0.3)) == 0.0  # within an obstacle
    assert cast(caster, (4.4, 1.2, math.pi), 2.0) == 2.0
    away = cast(caster, (2.4, 1.2, 0.0))
    assert away == (3.0 if method == "bresenham_nav2" else 30.0)  # nav2 takes the map's border for a wall


@pytest.mark.parametrize("method", WALKS)
def test_a_ray_from_outside_may_enter_the_map(method: CastMethod) -> None:
    caster = make_caster(drawn("..#..\n..#.."), method=method)
    assert cast(caster, (-3.0, 0.5, 0.0)) == pytest.approx(5.0)
    assert cast(caster, (9.0, 1.5, math.pi)) == pytest.approx(6.0)
    assert cast(caster, (9.0, 1.5, 0.0)) == 30.0
    assert cast(caster, (-3.0, 0.5, 0.0), 4.0) == 4.0
    assert cast(caster, (2.5, -7.0, math.pi / 2)) == pytest.approx(7.0)
    assert cast(caster, (1e9, 1.5, math.pi), 2e9) == pytest.approx(1e9 - 3.0)
    assert cast(caster, (1e300, 1.5, 1.0)) == 30.0


@pytest.mark.parametrize(("method", "outside"), [("bresenham_nav2", 0.0), ("bresenham_beluga", 30.0)])
def test_the_originals_see_nothing_of_the_map_from_outside(method: CastMethod, outside: float) -> None:
    assert cast(make_caster(drawn("..#..\n..#.."), method=method), (-3.0, 0.5, 0.0)) == outside


@pytest.mark.parametrize("method", get_args(CastMethod))
@pytest.mark.parametrize("pose", [(math.nan, 1.0, 0.0), (1.0, math.inf, 0.0), (1.0, 1.0, math.nan)])
@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_pose_that_is_nowhere_expects_nothing(method: CastMethod, pose: tuple[float, float, float]) -> None:
    assert math.isnan(cast(make_caster(drawn("...\n..."), method=method), pose))


@pytest.mark.parametrize("method", get_args(CastMethod))
def test_unknown_cells_stop_rays_or_do_not(method: CastMethod) -> None:
    grid = drawn("......?.#.\n......?.#.\n......?.#.")
    stopped = cast(make_caster(grid, method=method, ray_unknown="occupied"), (1.4, 1.4, 0.0))
    through = cast(make_caster(grid, method=method, ray_unknown="free"), (1.4, 1.4, 0.0))
    assert through - stopped == pytest.approx(2.0)


@pytest.mark.parametrize("method", [*WALKS, "bresenham_beluga"])
def test_a_tilted_beam_measures_along_itself(method: CastMethod) -> None:
    caster = make_caster(drawn("....#.\n....#.\n....#."), method=method)
    level, tilted = cast(caster, (0.5, 1.5, 0.0)), cast(caster, (0.5, 1.5, 0.0), 30.0, (0.8, 0.0))
    assert tilted == pytest.approx(level / 0.8)
    assert cast(caster, (0.5, 1.5, 0.0), 4.2, (0.8, 0.0)) == 4.2
    assert cast(caster, (0.5, 1.5, 0.0), 30.0, (0.0, 0.0)) == 30.0  # straight down


def test_bresenham_measures_between_centres() -> None:
    caster = make_caster(drawn("....#\n....#\n....#", 0.5), method="bresenham_beluga")
    assert cast(caster, (0.4, 0.9, 0.1)) == 2.0
    assert cast(caster, (0.4, 0.4, 0.25)) == 0.5 * math.hypot(4, 1)
    nav2 = make_caster(drawn("....#\n....#\n....#", 0.5), method="bresenham_nav2")
    assert cast(nav2, (0.4, 0.9, 0.1)) == 1.5  # its cells begin half a cell earlier


def test_the_beams_origins_and_directions_turn_with_the_base() -> None:
    generator = np.random.default_rng(9)
    caster = make_caster(grid_of(generator.random((40, 50)) < 0.05, 0.1, (-2.0, -1.0, 0.4)))
    poses = np.column_stack([generator.uniform(-1, 2, (20, 2)), generator.uniform(-4, 4, 20)])
    origins, yaws = generator.uniform(-0.3, 0.3, (7, 2)), generator.uniform(-4, 4, 7)
    got = caster.ranges(poses, origins, np.column_stack([np.cos(yaws), np.sin(yaws)]), 4.0)
    for n, pose in enumerate(poses):
        for b, (origin, yaw) in enumerate(zip(origins, yaws, strict=True)):
            sensor = se2.compose(pose, np.array([*origin, yaw]))
            assert cast(caster, sensor.tolist(), 4.0) == pytest.approx(got[n, b], abs=1e-9)


@pytest.mark.parametrize("method", WALKS)
@given(dx=st.floats(-50, 50), dy=st.floats(-50, 50), turn=st.floats(-3, 3), seed=st.integers(0, 99))
def test_ranges_move_and_turn_with_the_map(method: CastMethod, dx: float, dy: float, turn: float, seed: int) -> None:
    generator = np.random.default_rng(seed)
    occupied = generator.random((15, 20)) < 0.05
    poses = np.column_stack([generator.uniform(0, 5, (8, 2)), generator.uniform(-4, 4, 8)])
    moved = se2.compose(np.array([dx, dy, turn]), poses)
    beam = np.zeros((1, 2)), np.array([[1.0, 0.0]]), 9.0
    before = make_caster(grid_of(occupied, 0.25), method=method).ranges(poses, *beam)
    after = make_caster(grid_of(occupied, 0.25, (dx, dy, turn)), method=method).ranges(moved, *beam)
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-9 if method == "exact" else 2 * EPSILON)


@pytest.mark.parametrize("quarter", range(4))
def test_the_exact_range_does_not_depend_on_the_direction_of_the_grid(quarter: int) -> None:
    generator = np.random.default_rng(quarter)
    occupied = generator.random((21, 21)) < 0.05
    poses = np.column_stack([generator.uniform(0, 21, (300, 2)), generator.uniform(-4, 4, 300)])
    beam = np.zeros((1, 2)), np.array([[1.0, 0.0]]), 40.0
    turned = se2.compose(np.array([10.5, 10.5, quarter * math.pi / 2]), poses - [10.5, 10.5, 0.0])
    before = make_caster(grid_of(occupied)).ranges(poses, *beam)
    after = make_caster(grid_of(np.rot90(occupied, -quarter))).ranges(turned, *beam)  # row 0 is at the bottom
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", get_args(CastMethod))
def test_a_map_without_an_obstacle_is_seen_through(method: CastMethod) -> None:
    caster = make_caster(empty(700, 3), method=method)
    assert cast(caster, (1.4, 1.4, 0.0), 600.0) == 600.0


def test_the_largest_open_squares_are_found() -> None:
    occupied = np.random.default_rng(1).random((9, 11)) < 0.15
    squares = np.empty((4, 11, 13), np.uint8)
    backend.load("raycast").fill_squares(occupied, squares)
    padded = np.pad(occupied, 1, constant_values=True)
    for q, right, up in ((0, -1, -1), (1, 1, -1), (2, -1, 1), (3, 1, 1)):
        for row in range(11):
            for column in range(13):
                side = 0
                while not padded[
                    np.ix_([row + up * i for i in range(side + 1)], [column + right * i for i in range(side + 1)])
                ].any():
                    side += 1
                assert squares[q, row, column] == side


@pytest.mark.parametrize("method", get_args(CastMethod))
def test_what_cannot_be_cast_is_refused(method: CastMethod) -> None:
    caster = make_caster(drawn("..."), method=method)
    assert not caster.table.flags.writeable
    with pytest.raises(ValueError, match="max_range"):
        cast(caster, (0.0, 0.0, 0.0), math.inf)
    with pytest.raises(ValueError, match="at most 1 long"):
        cast(caster, (0.0, 0.0, 0.0), 1.0, (1.0, 1.0))
    with pytest.raises(ValueError, match="no such way"):
        make_caster(drawn("..."), method="guess")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="ray_unknown"):
        make_caster(drawn("..."), method=method, ray_unknown="maybe")  # type: ignore[arg-type]
