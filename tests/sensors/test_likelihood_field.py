"""The likelihood field against its equation, and what must not change it."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.geometry import se2, se3
from mclcli.native.backend import NUMPY, Backend
from mclcli.sensors import beams
from mclcli.sensors.beams import BeamSelection
from mclcli.sensors.likelihood_field import FLOOR, LikelihoodField, LikelihoodFieldParameters
from mclcli.world import distance_field
from mclcli.world.occupancy import UNKNOWN, OccupancyGrid
from tests.reference.sensors import endpoints_of, exact_distances, field_log_p
from tests.support import BACKENDS, each_backend, grid_of, scan_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.records import LaserScan
    from mclcli.sensors.likelihood_field import FieldCombination

GENERATOR = np.random.default_rng(11)
ROOM = GENERATOR.random((30, 40)) < 0.05
RESOLUTION = 0.25
ORIGIN = (-3.0, -2.0, 0.0)
MAX_DIST = 1.0
PARAMETERS = LikelihoodFieldParameters(z_hit=0.9, z_rand=0.1, sigma_hit=0.3, laser_likelihood_max_dist=MAX_DIST)
EVERY = BeamSelection(max_beams=0)
RANGES = GENERATOR.uniform(0.5, 6.0, 17)
POSES = np.column_stack([GENERATOR.uniform(-5, 9, 300), GENERATOR.uniform(-4, 8, 300), GENERATOR.uniform(-4, 4, 300)])
MOUNT = (0.2, -0.1, 0.6)


def model_over(grid: OccupancyGrid, backend: Backend = NUMPY, threads: int = 1) -> LikelihoodField:
    return LikelihoodField(distance_field.compute(grid, "exact", MAX_DIST), PARAMETERS, backend, threads)


def scores(
    poses: FloatArray,
    scan: LaserScan,
    origin: tuple[float, ...] = ORIGIN,
    mount: FloatArray | None = None,
    occupied: BoolArray = ROOM,
    backend: Backend = NUMPY,
) -> FloatArray:
    transform = se3.from_planar(MOUNT) if mount is None else mount
    model = model_over(grid_of(occupied, RESOLUTION, origin), backend)
    return model.measure("lidar", beams.select(scan, transform, EVERY)).log_likelihood(poses)


def naive(poses: FloatArray, scan: LaserScan, origin: tuple[float, ...]) -> list[float]:
    distances = exact_distances(ROOM.tolist(), RESOLUTION, MAX_DIST)
    ends = endpoints_of(scan.ranges.tolist(), scan.angle_min, scan.angle_increment, MOUNT, scan.range_max)
    p = {"z_hit": 0.9, "z_rand": 0.1, "sigma": 0.3, "r_max": scan.range_max}
    return [field_log_p(distances, RESOLUTION, origin, MAX_DIST, pose, ends, **p) for pose in poses.tolist()]


@pytest.mark.parametrize("origin", [ORIGIN, (-3.0, -2.0, 0.7), (4.0, 1.0, -2.5)])
@each_backend
def test_every_pose_agrees_with_the_equation(origin: tuple[float, ...], backend: Backend) -> None:
    scan = scan_of(RANGES)
    found = scores(POSES, scan, origin, backend=backend)
    np.testing.assert_allclose(found, naive(POSES, scan, origin), rtol=0, atol=1e-9)


def test_poses_on_and_off_the_map_were_among_them() -> None:
    inside = grid_of(ROOM, RESOLUTION, ORIGIN).contains(POSES[:, :2])
    assert 50 < inside.sum() < 250
    assert np.ptp(scores(POSES, scan_of(RANGES))) > 10.0


@pytest.mark.parametrize("code", [np.uint16, np.uint32])
def test_both_backends_agree_to_the_bit(code: type[np.uint16 | np.uint32]) -> None:
    field = distance_field.compute(grid_of(ROOM, RESOLUTION, ORIGIN), "exact", MAX_DIST)
    codes: NDArray[np.uint16] | NDArray[np.uint32] = field.codes.astype(code)  # type: ignore[assignment]
    codes.flags.writeable = False
    field = distance_field.DistanceField(codes, field.levels, RESOLUTION, field.origin)
    seen = beams.select(scan_of(RANGES), se3.from_planar(MOUNT), EVERY)
    one, other = (LikelihoodField(field, PARAMETERS, b).measure("lidar", seen).log_likelihood(POSES) for b in BACKENDS)
    assert one.tobytes() == other.tobytes()


@each_backend
@pytest.mark.parametrize("combination", ["log", "one_plus_cubes"])
@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
def test_single_beams_are_worth_their_log_likelihood_however_they_combine(
    lookup: str, combination: str, backend: Backend
) -> None:
    parameters = dataclasses.replace(PARAMETERS, field_lookup=lookup, combination=combination)  # type: ignore[arg-type]
    model = dataclasses.replace(model_over(grid_of(ROOM, RESOLUTION, ORIGIN), backend), parameters=parameters)
    seen = beams.select(scan_of(RANGES), se3.from_planar(MOUNT), EVERY).with_return()
    p = model.likelihood(model.distances(seen, POSES[:20]), seen.r_max)
    np.testing.assert_allclose(model.each(seen, POSES[:20]), np.log(np.maximum(p, 1e-12)), rtol=0, atol=1e-12)


def test_tables_cannot_be_written_to() -> None:
    assert not model_over(grid_of(ROOM, RESOLUTION, ORIGIN)).table(8.0).flags.writeable


def test_single_beams_are_worth_the_same_bits_by_both_backends() -> None:
    found = []
    for backend in BACKENDS:
        selected = beams.select(scan_of(RANGES), se3.from_planar(MOUNT), EVERY)
        each = model_over(grid_of(ROOM, RESOLUTION, ORIGIN), backend).measure("lidar", selected).each
        assert each is not None
        found.append(each(POSES).tobytes())
        assert each(POSES[1:2]).tobytes() == each(POSES)[1].tobytes()
    assert found[0] == found[1]


@each_backend
def test_threads_and_blocks_change_no_bit(backend: Backend) -> None:
    many = np.tile(POSES, (30, 1))
    selected = beams.select(scan_of(RANGES), se3.from_planar(MOUNT), EVERY)
    grid = grid_of(ROOM, RESOLUTION, ORIGIN)
    alone, shared = (
        model_over(grid, backend, threads).measure("lidar", selected).log_likelihood(many) for threads in (1, 3)
    )
    assert alone.tobytes() == shared.tobytes()
    assert alone.tobytes() == np.tile(scores(POSES, scan_of(RANGES)), 30).tobytes()


@given(st.permutations(range(20)))
def test_particles_are_scored_one_by_one(order: list[int]) -> None:
    everyone = scores(POSES[:20], scan_of(RANGES))
    assert (scores(POSES[order], scan_of(RANGES)) == everyone[order]).all()


@given(dx=st.integers(-400, 400), dy=st.integers(-400, 400))
def test_moving_the_map_and_the_robot_together_changes_nothing(dx: int, dy: int) -> None:
    shift = np.array([dx * 0.25, dy * 0.25, 0.0])  # exact in binary, so that no endpoint changes its cell
    poses = np.round(POSES * 64) / 64
    moved = scores(poses + shift, scan_of(RANGES), tuple(np.add(ORIGIN, shift)))
    np.testing.assert_allclose(moved, scores(poses, scan_of(RANGES)), rtol=0, atol=1e-9)


def away_from_borders(poses: FloatArray, scan: LaserScan) -> FloatArray:
    """Poses none of whose endpoints lies within 1e-6 cells of a border between cells."""
    ends = beams.select(scan, se3.from_planar(MOUNT), EVERY).endpoints
    points = se2.compose(poses[:, np.newaxis], np.column_stack([ends, np.zeros(len(ends))]))[..., :2]
    cells = grid_of(ROOM, RESOLUTION, ORIGIN).to_cells(points)
    return np.asarray(poses[(np.abs(cells - np.rint(cells)) > 1e-6).all(axis=(1, 2))])


@given(st.floats(-math.pi, math.pi), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_turning_the_origin_and_the_robot_together_changes_nothing(yaw: float, x: float, y: float) -> None:
    poses = away_from_borders(POSES, scan_of(RANGES))
    assert len(poses) > 250
    turn = np.array([x, y, yaw])
    turned = scores(se2.compose(turn, poses), scan_of(RANGES), tuple(se2.compose(turn, np.array(ORIGIN))))
    np.testing.assert_allclose(turned, scores(poses, scan_of(RANGES)), rtol=0, atol=1e-9)


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_turning_the_picture_by_quarters_turns_the_poses(quarters: int) -> None:
    poses = away_from_borders(POSES, scan_of(RANGES))
    height, width = (side * RESOLUTION for side in ROOM.shape)
    # np.rot90 of rows counted upwards turns clockwise; the outer corner moves to keep the map in its quadrant
    corner = {1: (0.0, width, -math.pi / 2), 2: (width, height, math.pi), 3: (height, 0.0, math.pi / 2)}[quarters]
    local = se2.compose(se2.inverse(np.array(ORIGIN)), poses)
    turned = se2.compose(np.array(ORIGIN), se2.compose(np.array(corner), local))
    got = scores(turned, scan_of(RANGES), occupied=np.ascontiguousarray(np.rot90(ROOM, quarters)))
    np.testing.assert_allclose(got, scores(poses, scan_of(RANGES)), rtol=0, atol=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(0.0, 2.0))
def test_an_upside_down_lidar_sees_the_mirrored_scan(yaw: float, x: float, z: float) -> None:
    scan = scan_of(RANGES, angle_min=-1.0, angle_increment=0.11)
    mirrored = scan_of(RANGES, angle_min=1.0, angle_increment=-0.11)
    hanging = scores(POSES, scan, mount=se3.from_rpy([x, 0.1, z], math.pi, 0.0, yaw))
    standing = scores(POSES, mirrored, mount=se3.from_rpy([x, 0.1, z], 0.0, 0.0, yaw))
    close = np.isclose(hanging, standing, rtol=0, atol=1e-9)
    assert close.mean() > 0.98  # sin π is not quite 0: an endpoint on a border may fall into the next cell


@given(st.lists(st.sampled_from([math.nan, 0.5, 1.7, 3.3, 5.1]), min_size=1, max_size=12))
def test_dropping_nan_beams_is_removing_them(ranges: list[float]) -> None:
    scan = scan_of(ranges, angle_min=-0.7, angle_increment=0.13)
    kept = [i for i, r in enumerate(ranges) if not math.isnan(r)]
    alone = [scores(POSES[:20], scan_of([ranges[i]], angle_min=-0.7 + i * 0.13, angle_increment=0.13)) for i in kept]
    np.testing.assert_allclose(scores(POSES[:20], scan), np.sum([np.zeros(20), *alone], axis=0), rtol=0, atol=1e-9)


@given(z_hit=st.floats(0.0, 1.0), z_rand=st.floats(0.0, 1.0), sigma=st.floats(1e-3, 10.0), r_max=st.floats(0.1, 1000.0))
def test_nearer_to_an_obstacle_is_never_less_likely(z_hit: float, z_rand: float, sigma: float, r_max: float) -> None:
    parameters = LikelihoodFieldParameters(z_hit=z_hit, z_rand=z_rand, sigma_hit=sigma)
    table = LikelihoodField(model_over(grid_of(ROOM, RESOLUTION)).field, parameters).table(r_max)
    assert (np.diff(table) <= 0.0).all()
    assert table[-1] >= math.log(FLOOR)
    assert np.isfinite(table).all()


def test_the_floor_is_one_in_a_million_million() -> None:
    parameters = LikelihoodFieldParameters(z_hit=1.0, z_rand=0.0, sigma_hit=0.01)
    table = LikelihoodField(model_over(grid_of(ROOM, RESOLUTION)).field, parameters).table(8.0)
    assert table[-1] == pytest.approx(math.log(1e-12), abs=1e-12)
    assert table[0] == 0.0


@each_backend
@given(
    pose=st.tuples(*[st.floats(-1e200, 1e200)] * 2, st.floats(-1e6, 1e6)),
    ranges=st.lists(st.floats(), min_size=1, max_size=5),
)
def test_every_finite_pose_has_a_finite_score(pose: tuple[float, ...], ranges: list[float], backend: Backend) -> None:
    model = model_over(grid_of(ROOM, RESOLUTION, ORIGIN), backend)
    selected = beams.select(scan_of(ranges), se3.from_planar(MOUNT), BeamSelection(max_range="score"))
    got = model.measure("lidar", selected).log_likelihood(np.array([pose]))
    assert np.isfinite(got).all()
    assert got[0] >= selected.ranges.size * math.log(FLOOR) - 1e-9


def test_origins_far_from_zero_lose_nothing() -> None:
    far = np.array([5_000_000.25, 4_500_000.5, 0.0])
    poses = np.round(POSES * 64) / 64
    moved = scores(poses + far, scan_of(RANGES), tuple(np.add(ORIGIN, far)))
    np.testing.assert_allclose(moved, scores(poses, scan_of(RANGES)), rtol=0, atol=1e-9)


def test_the_peak_is_the_score_of_a_perfect_fit() -> None:
    grid = grid_of(np.ones((9, 9)))
    selected = beams.select(scan_of([1.0, 2.0, 1.5]), np.eye(4), EVERY)
    measurement = model_over(grid).measure("lidar", selected, 0.25)
    assert measurement.log_likelihood(np.array([[4.5, 4.5, 0.3]]))[0] == pytest.approx(measurement.log_peak)
    assert (measurement.count, measurement.alpha, measurement.sensor) == (3, 0.25, "lidar")


CHANGES: list[dict[str, float | str]] = [
    {},
    {"combination": "one_plus_cubes"},
    {"off_map": "uniform", "hit_normalised": "yes"},
    {"field_unknown": "uniform", "z_rand": 0.05},
    {"sigma_hit": 1e-20, "z_rand": 0.0, "hit_normalised": "yes"},
    {"sigma_hit": 1e-100},
    {"field_anchor": "half_cell"},
]


@pytest.mark.parametrize("changes", CHANGES, ids=lambda c: "-".join(map(str, c.values())))
@pytest.mark.parametrize("code", [np.uint16, np.uint32])
def test_both_backends_interpolate_to_the_same_bits(
    changes: dict[str, float | str], code: type[np.uint16 | np.uint32]
) -> None:
    grid = grid_of(ROOM, RESOLUTION, (-3.0, -2.0, 0.4))
    marked = changes.get("field_unknown") == "uniform"
    cells = np.where(np.random.default_rng(2).random(ROOM.shape) < 0.1, UNKNOWN, grid.cells) if marked else grid.cells
    grid = OccupancyGrid(cells.astype(np.int8), grid.resolution, grid.origin)
    field = distance_field.compute(grid, "exact", MAX_DIST, mark_unknown=marked)
    codes: NDArray[np.uint16] | NDArray[np.uint32] = field.codes.astype(code)  # type: ignore[assignment]
    field = dataclasses.replace(field, codes=codes)
    parameters = dataclasses.replace(PARAMETERS, field_lookup="bilinear", **changes)  # type: ignore[arg-type]
    near = np.column_stack([GENERATOR.uniform(1, 3, 300), GENERATOR.uniform(2, 3, 300), GENERATOR.uniform(-4, 4, 300)])
    selected = beams.select(scan_of(RANGES), se3.from_planar(MOUNT), EVERY)
    found = []
    for backend in BACKENDS:
        score = LikelihoodField(field, parameters, backend, threads=2).measure("lidar", selected).log_likelihood
        found.append(np.concatenate([score(POSES), score(near)]).tobytes())
    assert found[0] == found[1]


@each_backend
@pytest.mark.parametrize("combination", ["log", "one_plus_cubes"])
def test_interpolated_bits_do_not_depend_on_the_company(combination: FieldCombination, backend: Backend) -> None:
    parameters = dataclasses.replace(PARAMETERS, field_lookup="bilinear", combination=combination)
    model = LikelihoodField(model_over(grid_of(ROOM, RESOLUTION, ORIGIN)).field, parameters, backend)
    score = model.measure("lidar", beams.select(scan_of(RANGES), se3.from_planar(MOUNT), EVERY)).log_likelihood
    together, order = score(POSES), np.random.default_rng(6).permutation(len(POSES))
    assert (score(POSES[order]) == together[order]).all()
    assert [score(POSES[n : n + 1])[0] for n in (0, 17, 255, 256, 299)] == together[[0, 17, 255, 256, 299]].tolist()
