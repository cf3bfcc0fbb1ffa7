"""Bearings to landmarks against their mixture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mclcli.errors import UsageError
from mclcli.geometry import se2, se3
from mclcli.native.backend import NUMPY, Backend
from mclcli.sensors.bearing import FLOOR, BearingModel, BearingParameters, observe
from mclcli.sensors.explain import explain_bearings
from mclcli.world.landmarks import Landmarks
from tests.reference.sensors import bearings_log_p
from tests.support import BACKENDS, each_backend, level, sightings

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors import Measurement

PLACES = {"a": (-1.0, 0.0), "b": (1.0, 0.5), "c": (0.0, -1.0)}
LANDMARKS = Landmarks(tuple(PLACES), np.array([(*place, 0.4) for place in PLACES.values()]))
GENERATOR = np.random.default_rng(3)
POSES = GENERATOR.uniform([-3, -3, -4], [3, 3, 4], (40, 3))
MOUNT = (0.2, -0.1, 0.5)
angles = st.floats(-math.pi, math.pi)
coordinates = st.floats(-1e3, 1e3)
SEEN = (("a", 0.3), ("c", -2.0), ("nobody", 1.0), ("a", 3.0))


def model(sigma: float = 0.1, eps: float = 0.1, backend: Backend = NUMPY) -> BearingModel:
    return BearingModel(BearingParameters(sigma_bearing=sigma, eps_outlier=eps), backend)


def seen_from(
    mount: FloatArray, *seen: tuple[str, float], sigma: float = 0.1, eps: float = 0.1, backend: Backend = NUMPY
) -> Measurement:
    rays = level(*(bearing for _, bearing in seen))
    return model(sigma, eps, backend).measure(
        "vision", observe(sightings(0, [i for i, _ in seen], rays), mount, LANDMARKS)
    )


@each_backend
@given(seen=st.lists(st.tuples(st.sampled_from(["a", "b", "c", "?"]), angles), max_size=40))
def test_every_pose_agrees_with_the_equation(seen: list[tuple[str, float]], backend: Backend) -> None:
    got = seen_from(se3.from_planar(MOUNT), *seen, backend=backend).log_likelihood(POSES)
    expected = [bearings_log_p(pose, MOUNT, seen, PLACES, sigma=0.1, eps=0.1) for pose in POSES.tolist()]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)


@given(
    pose=st.tuples(coordinates, coordinates, st.floats(-10.0, 10.0)),
    seen=st.lists(st.tuples(st.sampled_from("abc"), angles), min_size=1, max_size=40),
    eps=st.just(0.0) | st.floats(1e-300, 1.0),
    sigma=st.floats(0.01, 1.0),
)
@example(pose=(-1.0, 0.0, 0.3), seen=[("a", -0.2), ("b", 2.0)], eps=0.1, sigma=0.5)  # standing on the landmark
def test_both_backends_agree_to_the_bit(
    pose: tuple[float, ...],
    seen: list[tuple[str, float]],
    eps: float,
    sigma: float,
) -> None:
    one, other = (
        seen_from(se3.from_planar(MOUNT), *seen, sigma=sigma, eps=eps, backend=backend) for backend in BACKENDS
    )
    assert one.log_likelihood(np.array([pose])).tobytes() == other.log_likelihood(np.array([pose])).tobytes()


@pytest.mark.parametrize("sigma", [1e-100, 1e-17, 1e-6])
@each_backend
def test_no_deviation_is_too_small(sigma: float, backend: Backend) -> None:
    measurement = seen_from(np.eye(4), *[("b", math.atan2(0.5, 1.0))] * 20, sigma=sigma, eps=0.1, backend=backend)
    near, far = measurement.log_likelihood(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]))
    assert far == pytest.approx(20 * math.log(0.1 / math.tau), rel=1e-12)
    assert far <= near <= measurement.log_peak + 1e-9
    assert sigma < 1e-6 or near == pytest.approx(measurement.log_peak, rel=1e-12)


@given(pose=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_an_explanation_names_what_the_map_expects_and_adds_up_to_the_score(pose: tuple[float, ...]) -> None:
    """Expected bearings are turned into points again: each landmark lies where its bearing says."""
    seen = observe(sightings(0, [i for i, _ in SEEN], level(*(b for _, b in SEEN))), se3.from_planar(MOUNT), LANDMARKS)
    rows = explain_bearings(model(), seen, np.array(pose))
    assert [row.name for row in rows] == ["a", "c", "a", "nobody"]
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    camera = x + MOUNT[0] * c - MOUNT[1] * s, y + MOUNT[0] * s + MOUNT[1] * c
    for row in rows[:3]:
        assert row.expected is not None
        assert row.error is not None
        offset = PLACES[row.name][0] - camera[0], PLACES[row.name][1] - camera[1]
        wanted = math.atan2(offset[1], offset[0]) - yaw
        assert math.remainder(row.expected - wanted, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert math.remainder(row.measured - row.expected - row.error, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert row.angle == row.measured
        assert row.shares["rand"] == pytest.approx(0.1 / math.tau)
    assert rows[3].expected is None
    assert rows[3].error is None
    assert rows[3].shares == {"rand": pytest.approx(1.0 / math.tau)}
    for row in rows:
        assert row.log_p == pytest.approx(math.log(max(sum(row.shares.values()), FLOOR)), abs=1e-9)
    score = model().measure("vision", seen).log_likelihood(np.array([pose]))[0]
    assert sum(row.log_p for row in rows) == pytest.approx(score, abs=1e-6)


@each_backend
def test_a_particles_bits_do_not_depend_on_its_company(backend: Backend) -> None:
    seen = [("abc"[i % 3], -3.0 + 0.17 * i) for i in range(35)]
    score = seen_from(se3.from_planar(MOUNT), *seen, backend=backend).log_likelihood
    many = np.random.default_rng(5).uniform([-3, -3, -4], [3, 3, 4], (700, 3))
    together = score(many)
    order = np.random.default_rng(6).permutation(700)
    assert score(many[order]).tobytes() == together[order].tobytes()
    for n in (0, 255, 256, 511, 690, 699):
        assert score(many[n : n + 1])[0] == together[n]


@each_backend
def test_what_is_no_pose_has_no_score_and_spoils_no_other(backend: Backend) -> None:
    poses = POSES.copy()
    poses[3, 0], poses[11, 2], poses[17, 1] = math.nan, math.nan, math.nan
    got = seen_from(se3.from_planar(MOUNT), *SEEN, backend=backend).log_likelihood(poses)
    assert np.flatnonzero(np.isnan(got)).tolist() == [3, 11, 17]


@each_backend
@given(x=coordinates, y=coordinates, yaw=angles, bearing=angles, eps=st.floats(1e-6, 1.0), sigma=st.floats(1e-3, 1.0))
@example(x=-1.0, y=0.0, yaw=0.0, bearing=0.0, eps=0.1, sigma=0.1)  # standing on the landmark
def test_a_known_landmark_never_costs_more_than_being_an_outlier(
    x: float,
    y: float,
    yaw: float,
    bearing: float,
    eps: float,
    sigma: float,
    backend: Backend,
) -> None:
    measurement = seen_from(np.eye(4), ("a", bearing), sigma=sigma, eps=eps, backend=backend)
    score = measurement.log_likelihood(np.array([[x, y, yaw]]))[0]
    assert math.isfinite(score)
    assert score >= max(math.log(eps / math.tau), math.log(FLOOR)) - 1e-12
    assert score <= measurement.log_peak + 1e-12


def test_without_outliers_the_floor_holds() -> None:
    assert model(0.01, 0.0).log_p(np.array([3.0]))[0] == pytest.approx(math.log(1e-15), abs=1e-12)


def test_an_unknown_id_costs_the_same_everywhere_and_is_counted() -> None:
    measurement = seen_from(np.eye(4), ("nobody", 0.4))
    assert measurement.log_likelihood(POSES).tolist() == [-math.log(math.tau)] * len(POSES)
    assert (measurement.count, measurement.unknown) == (1, 1)
    assert seen_from(np.eye(4), *SEEN).unknown == 1


def test_ids_are_kept_in_their_order_known_and_unknown_apart() -> None:
    bearings = observe(sightings(0, [i for i, _ in SEEN], level(*(b for _, b in SEEN))), np.eye(4), LANDMARKS)
    assert (bearings.ids, bearings.unknown_ids) == (("a", "c", "a"), ("nobody",))


@given(st.permutations(SEEN))
def test_the_order_of_sightings_does_not_matter(order: list[tuple[str, float]]) -> None:
    mount = se3.from_planar(MOUNT)
    got, expected = (seen_from(mount, *seen).log_likelihood(POSES) for seen in (order, SEEN))
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12)


@given(st.lists(st.tuples(st.sampled_from("abc"), angles), min_size=1, max_size=4), angles)
def test_an_upside_down_camera_sees_mirrored_bearings(seen: list[tuple[str, float]], yaw: float) -> None:
    hanging = seen_from(se3.from_rpy([0.2, -0.1, 1.0], math.pi, 0.0, yaw), *seen)
    standing = seen_from(se3.from_rpy([0.2, -0.1, 1.0], 0.0, 0.0, yaw), *((name, -angle) for name, angle in seen))
    np.testing.assert_allclose(hanging.log_likelihood(POSES), standing.log_likelihood(POSES), rtol=0, atol=1e-9)


@each_backend
@given(pose=st.tuples(*[st.floats(-1e200, 1e200)] * 2, st.floats(-1e6, 1e6)), bearing=angles)
def test_every_finite_pose_has_a_finite_score(pose: tuple[float, ...], bearing: float, backend: Backend) -> None:
    measurement = seen_from(se3.from_planar(MOUNT), ("a", bearing), ("nobody", bearing), backend=backend)
    assert np.isfinite(measurement.log_likelihood(np.array([pose]))).all()


@given(error=st.floats(-math.pi, math.pi), other=st.floats(-math.pi, math.pi), alpha=st.floats(0.02, 1.0))
def test_a_smaller_error_is_never_less_likely(error: float, other: float, alpha: float) -> None:
    near, far = model().log_p(np.array(sorted([error, other], key=abs)))
    assert alpha * near >= alpha * far


@given(st.floats(-50, 50), st.floats(-50, 50), angles)
def test_moving_landmarks_and_robot_together_changes_nothing(x: float, y: float, yaw: float) -> None:
    moved_places = se2.compose([x, y, yaw], np.array([(*place, 0.0) for place in PLACES.values()]))
    moved = Landmarks(tuple(PLACES), np.column_stack([moved_places[:, :2], np.zeros(3)]))
    rays = sightings(0, [i for i, _ in SEEN], level(*(b for _, b in SEEN)))
    mount = se3.from_planar(MOUNT)
    there = model(0.5).measure("v", observe(rays, mount, moved)).log_likelihood(se2.compose([x, y, yaw], POSES))
    here = model(0.5).measure("v", observe(rays, mount, LANDMARKS)).log_likelihood(POSES)
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-7)


def test_errors_are_taken_the_short_way_round() -> None:
    pose = np.array([[0.0, 0.0, 0.0]])  # landmark a lies at bearing π
    left, right = (seen_from(np.eye(4), ("a", bearing)).log_likelihood(pose)[0] for bearing in (3.1, -3.1))
    assert left == pytest.approx(right, abs=1e-12)
    assert left > 0.0


@given(pitch=st.floats(-0.6, 0.6), roll=st.floats(-0.6, 0.6), yaw=angles)
def test_a_tilted_camera_sees_the_same_bearing_once_its_ray_is_level(pitch: float, roll: float, yaw: float) -> None:
    mount = se3.from_rpy([0.1, 0.0, 0.8], roll, pitch, yaw)
    in_base = np.array([2.0, 0.7, -0.3])  # from the camera towards the landmark, in the base's axes
    ray = mount[:3, :3].T @ in_base
    bearings = observe(sightings(0, ["a"], ray), mount, LANDMARKS)
    assert bearings.angles[0] == pytest.approx(math.atan2(0.7, 2.0), abs=1e-9)
    assert bearings.origin.tolist() == [0.1, 0.0]


def test_an_optical_frame_looks_along_z_with_x_to_the_right() -> None:
    base_from_optical = np.eye(4)
    base_from_optical[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    bearings = observe(sightings(0, ["a", "b"], [[0, 0, 1], [1, 0, 1]]), base_from_optical, LANDMARKS)
    np.testing.assert_allclose(bearings.angles, [0.0, -math.pi / 4], atol=1e-12)


def test_a_ray_straight_up_says_nothing_of_direction() -> None:
    bearings = observe(sightings(0, ["a", "b"], [[0, 0, 1], [1, 0, 5]]), np.eye(4), LANDMARKS)
    assert bearings.unknown == 1
    assert bearings.landmarks.tolist() == [[1.0, 0.5]]


def test_the_length_of_a_ray_does_not_count() -> None:
    rays = level(0.3, -2.0) * [[1e-3], [40.0]]
    got = observe(sightings(0, ["a", "b"], rays), np.eye(4), LANDMARKS)
    np.testing.assert_allclose(got.angles, [0.3, -2.0], atol=1e-12)


def test_a_standard_deviation_above_a_radian_is_refused() -> None:
    with pytest.raises(UsageError, match="sigma_bearing"):
        BearingParameters(sigma_bearing=1.1)


@pytest.mark.parametrize("eps", [-0.01, 1.01])
def test_a_share_of_outliers_is_a_share(eps: float) -> None:
    with pytest.raises(UsageError, match="eps_outlier"):
        BearingParameters(eps_outlier=eps)
