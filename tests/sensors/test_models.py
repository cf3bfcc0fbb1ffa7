"""What every lidar model of the registry keeps, in every profile and with every switch that changes its formula."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mclcli.filter import weights
from mclcli.geometry import se2, se3
from mclcli.native.backend import NUMPY
from mclcli.sensors import beams
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.sensors.models import LIDAR_MODELS, lidar_entry
from mclcli.settings import profiles
from mclcli.world import distance_field
from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.support import scan_of

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.records import LaserScan
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.instruments import LidarModel
    from mclcli.settings import Profile

RESOLUTION, ORIGIN = 0.25, (-3.0, -2.0, 0.0)
GENERATOR = np.random.default_rng(21)
CELLS = GENERATOR.choice(np.array([FREE, OCCUPIED, UNKNOWN], np.int8), (30, 40), p=[0.9, 0.06, 0.04])
RANGES = np.concatenate([GENERATOR.uniform(0.4, 6.0, 15), [8.0, math.inf]])
POSES = np.round(GENERATOR.uniform([-5, -4, -3], [9, 8, 3], (100, 3)) * 64) / 64
MOUNT = se3.from_rpy([0.25, -0.125, 0.3], 0.0, 0.0, 0.6)
TINY = 1e-9  # [m, rad] poses whose scores stand such a nudge are away from borders between cells


class Variant(NamedTuple):
    """A profile, a model of the registry, and switches on top."""

    profile: Profile
    model: str
    changes: tuple[tuple[str, str], ...] = ()

    @property
    def chosen(self) -> profiles.Settings:
        return profiles.build({"max_beams": 0, **dict(self.changes)}, profile=self.profile, model=self.model)

    def over(self, origin: Any = ORIGIN) -> LidarModel:
        """The model over the map."""
        entry, chosen = lidar_entry(self.model), self.chosen
        grid = OccupancyGrid(CELLS, RESOLUTION, np.array(origin, dtype=np.float64))
        return entry.make(grid, chosen.lidars[entry.group], distance_field.compute, NUMPY, 1)

    def beams(self, scan: LaserScan, mount: FloatArray = MOUNT) -> Beams:
        """The beams that it scores."""
        return beams.select(scan, mount, self.chosen.beams)

    def scores(self, poses: FloatArray, seen: Beams | None = None, origin: Any = ORIGIN) -> FloatArray:
        """Log-likelihoods (N,)."""
        seen = self.beams(scan_of(RANGES)) if seen is None else seen
        return self.over(origin).measure("lidar", seen).log_likelihood(poses)

    def steady(self, seen: Beams | None = None) -> FloatArray:
        """Poses whose scores do not jump when they are nudged."""
        nudges = TINY * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
        moved = np.array([self.scores(POSES + nudge, seen) for nudge in nudges])
        return np.asarray(POSES[np.ptp(moved, axis=0) < 1e-5])


VARIANTS = [Variant(profile, model) for profile in profiles.PROFILES for model in LIDAR_MODELS] + [
    Variant("textbook", "likelihood_field", (("field_lookup", "bilinear"),)),
    Variant("textbook", "likelihood_field", (("field_method", "brushfire"), ("max_range", "score"))),
    Variant("textbook", "likelihood_field", (("field_unknown", "uniform"), ("obstacles", "boundary"))),
    Variant("textbook", "beam", (("no_return", "censored"),)),
    Variant("textbook", "beam", (("raycast", "approximate"), ("ray_unknown", "free"))),
    Variant("beluga", "likelihood_field", (("field_unknown", "uniform"),)),
]
each = pytest.mark.parametrize("variant", VARIANTS, ids=lambda v: "-".join([*v[:2], *(c for _, c in v.changes)]))
few = settings(max_examples=12)


@each
def test_scores_tell_poses_apart(variant: Variant) -> None:
    assert np.ptp(variant.scores(POSES)) > 0.1
    assert len(variant.steady()) > 70


@each
@few
@given(dx=st.integers(-400, 400), dy=st.integers(-400, 400))
def test_moving_map_and_robot_together_changes_nothing(variant: Variant, dx: int, dy: int) -> None:
    shift = np.array([dx * 0.25, dy * 0.25, 0.0])  # exact in binary, as are the poses
    moved = variant.scores(POSES + shift, origin=np.add(ORIGIN, shift))
    np.testing.assert_allclose(moved, variant.scores(POSES), rtol=0, atol=1e-9)


@each
@few
@given(x=st.floats(-50.0, 50.0), y=st.floats(-50.0, 50.0), yaw=st.floats(-math.pi, math.pi))
def test_turning_map_and_robot_together_changes_nothing(variant: Variant, x: float, y: float, yaw: float) -> None:
    """But for nav2_amcl, which ignores the yaw of the map's origin."""
    turn, poses = np.array([x, y, yaw]), variant.steady()
    turned = variant.scores(se2.compose(turn, poses), origin=se2.compose(turn, np.array(ORIGIN)))
    same = np.isclose(turned, variant.scores(poses), rtol=0, atol=1e-4)
    if variant.profile == "nav2":
        assert abs(yaw) < 0.3 or not same.all()
    else:
        assert same.all()


@each
@few
@given(order=st.permutations(range(len(RANGES))))
def test_the_order_of_beams_does_not_matter(variant: Variant, order: list[int]) -> None:
    seen = variant.beams(scan_of(RANGES))
    places = [i for i in order if i < seen.ranges.size]
    shuffled = dataclasses.replace(
        seen, origins=seen.origins[places], directions=seen.directions[places], ranges=seen.ranges[places]
    )
    np.testing.assert_allclose(variant.scores(POSES, shuffled), variant.scores(POSES, seen), rtol=1e-12, atol=1e-12)


@each
@few
@given(order=st.permutations(range(len(POSES))))
def test_the_order_of_poses_does_not_matter(variant: Variant, order: list[int]) -> None:
    assert (variant.scores(POSES[order]) == variant.scores(POSES)[order]).all()


@each
@few
@given(missing=st.sets(st.integers(0, len(RANGES) - 1), min_size=1))
def test_dropping_nan_beams_is_removing_them(variant: Variant, missing: set[int]) -> None:
    ranges = RANGES.copy()
    ranges[list(missing)] = math.nan
    whole = variant.beams(scan_of(RANGES))
    without = whole.subset(~np.isin(whole.indices, list(missing)))
    seen = variant.beams(scan_of(ranges))
    assert seen.indices.tolist() == without.indices.tolist()
    assert (variant.scores(POSES, seen) == variant.scores(POSES, without)).all()


@each
@few
@given(yaw=st.floats(-3.0, 3.0), x=st.floats(-1.0, 1.0))
def test_an_upside_down_lidar_sees_the_mirrored_scan(variant: Variant, yaw: float, x: float) -> None:
    place = [x, 0.1, 0.4]
    hanging = variant.beams(scan_of(RANGES, angle_min=-1.0, angle_increment=0.11), se3.from_rpy(place, math.pi, 0, yaw))
    standing = variant.beams(scan_of(RANGES, angle_min=1.0, angle_increment=-0.11), se3.from_rpy(place, 0, 0, yaw))
    poses = variant.steady(standing)
    assert len(poses) > 70
    np.testing.assert_allclose(variant.scores(poses, hanging), variant.scores(poses, standing), rtol=0, atol=1e-4)


@each
@few
@given(
    sigma=st.floats(1e-3, 10.0), z_hit=st.floats(0.0, 1.0), r_max=st.floats(0.1, 1000.0), max_dist=st.floats(0.3, 5.0)
)
def test_fields_are_monotone_in_distance(
    variant: Variant, sigma: float, z_hit: float, r_max: float, max_dist: float
) -> None:
    model = variant.over()
    if not isinstance(model, LikelihoodField):
        return
    parameters = dataclasses.replace(model.parameters, sigma_hit=sigma, z_hit=z_hit)
    changed = LikelihoodField(dataclasses.replace(model.field), parameters)
    p = changed.term(changed.likelihood(np.linspace(0.0, max_dist, 200), r_max))
    assert (np.diff(p) <= 0.0).all()


@each
@few
@given(alpha=st.floats(0.02, 1.0))
def test_temperature_leaves_the_best_pose_the_best(variant: Variant, alpha: float) -> None:
    scores = variant.scores(POSES)
    tempered = weights.temper([alpha], scores[np.newaxis])
    assert tempered[scores.argmax()] == tempered.max()


@each
@few
@given(
    pose=st.tuples(*[st.floats(-1e200, 1e200)] * 2, st.floats(-1e6, 1e6)),
    ranges=st.lists(st.floats(), min_size=1, max_size=5),
    near=st.floats(0.1, 7.0),
)
def test_every_finite_pose_has_a_finite_score(
    variant: Variant, pose: tuple[float, ...], ranges: list[float], near: float
) -> None:
    """Whatever was read; one reading at least is an ordinary one."""
    seen = variant.beams(scan_of([near, *ranges]))
    assert np.isfinite(variant.scores(np.array([pose, POSES[0]]), seen)).all()


@each
@few
@given(index=st.integers(0, len(POSES) - 1))
def test_explanations_add_up_to_the_score(variant: Variant, index: int) -> None:
    seen = variant.beams(scan_of(RANGES))
    model, pose = variant.over(), POSES[index]
    rows = lidar_entry(variant.model).explain(model, seen, pose)
    assert [int(row.name) for row in rows] == seen.indices.tolist()
    assert all(row.error == row.measured - row.expected for row in rows if row.expected is not None)
    p = np.array([sum(row.shares.values()) for row in rows])
    logs = np.array([row.log_p for row in rows])
    np.testing.assert_allclose(logs, np.log(np.maximum(p, 1e-12)), rtol=0, atol=1e-6)
    group = variant.chosen.lidars[lidar_entry(variant.model).group]
    combined = {"log": logs.sum(), "one_plus_cubes": math.log1p((p**3).sum()), "cubes": math.log((p**3).sum())}
    score = model.measure("lidar", seen).log_likelihood(pose[np.newaxis])[0]
    assert score == pytest.approx(combined[group.combination], abs=1e-6)
