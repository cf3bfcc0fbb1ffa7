"""From particles to a pose and its covariance."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter import clusters, estimate
from mclcli.filter.localizer import is_depleted
from mclcli.geometry import se2
from tests.reference import filter as naive

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

PI = math.pi
rows = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-PI, PI), st.floats(0.001, 1.0))
clouds = st.lists(rows, min_size=1, max_size=30).map(np.array)


def halves(cloud: FloatArray) -> tuple[FloatArray, FloatArray]:
    return cloud[:, :3], cloud[:, 3] / cloud[:, 3].sum()


@given(clouds)
def test_covariance_is_symmetric_and_has_no_negative_direction(cloud: FloatArray) -> None:
    covariance = estimate.weighted_mean(*halves(cloud)).covariance
    assert (covariance == covariance.T).all()
    assert np.linalg.eigvalsh(covariance).min() >= -1e-9 * max(1.0, np.trace(covariance))
    assert (np.diag(covariance) >= 0.0).all()


@pytest.mark.parametrize("yaw_spread", [0.1, 2.0])
def test_mean_and_covariance_agree_with_the_equation(yaw_spread: float) -> None:
    generator = np.random.default_rng(5)
    poses = generator.normal([3.0, -2.0, 3.0], [0.5, 0.2, yaw_spread], (200, 3))
    poses[:, 2] = se2.wrap(poses[:, 2])
    weights = generator.dirichlet(np.ones(200))
    got = estimate.weighted_mean(poses, weights)
    mean, covariance = naive.mean_and_covariance(poses.tolist(), weights.tolist())
    np.testing.assert_allclose(got.pose, mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.covariance, covariance, rtol=0, atol=1e-9)


@given(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-3.14, 3.14)).map(np.array))
def test_one_particle_is_the_estimate_and_knows_no_doubt(pose: FloatArray) -> None:
    got = estimate.weighted_mean(pose[np.newaxis], np.ones(1))
    np.testing.assert_allclose(got.pose, pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.covariance, np.zeros((3, 3)), rtol=0, atol=1e-24)


def test_headings_on_both_sides_of_pi_meet_at_pi() -> None:
    poses = np.array([[0.0, 0.0, PI - 0.1], [0.0, 0.0, -PI + 0.3]])
    got = estimate.weighted_mean(poses, np.array([0.5, 0.5]))
    assert got.pose[2] == pytest.approx(-PI + 0.1, abs=1e-12)
    assert got.covariance[2, 2] == pytest.approx(0.04, abs=1e-12)


def test_weight_pulls_the_mean() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.2]])
    got = estimate.weighted_mean(poses, np.array([0.75, 0.25]))
    np.testing.assert_allclose(got.pose[:2], [0.25, 0.5])
    assert got.covariance[0, 1] == pytest.approx(0.75 * 0.25 * 2.0)


@given(clouds, st.tuples(st.floats(-50, 50), st.floats(-50, 50)), st.floats(-PI, PI))
def test_moving_all_particles_moves_the_estimate(cloud: FloatArray, shift: tuple[float, float], yaw: float) -> None:
    poses, weights = halves(cloud)
    if abs(np.sum(weights * np.exp(1j * poses[:, 2]))) < 0.1:
        return  # headings that cancel have no mean
    turn = np.array([*shift, yaw])
    here, there = estimate.weighted_mean(poses, weights), estimate.weighted_mean(se2.compose(turn, poses), weights)
    difference = there.pose - se2.compose(turn, here.pose)
    assert np.abs(difference[:2]).max() < 1e-9
    assert abs(float(se2.wrap(difference[2]))) < 1e-9


def test_far_origins_cost_the_covariance_nothing() -> None:
    poses = np.random.default_rng(1).normal(0.0, 0.01, (500, 3))
    weights = np.full(500, 1 / 500)
    near = estimate.weighted_mean(poses, weights).covariance
    far = estimate.weighted_mean(np.add(poses, [5e6, 5e6, 0.0]), weights).covariance
    np.testing.assert_allclose(far, near, rtol=1e-4)


def test_a_cloud_has_converged_once_nearly_all_are_within_half_a_metre() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 2.0], [0.0, -0.4, 1.0]])
    centre = estimate.weighted_mean(poses, np.array([1.0, 0.0, 0.0]))
    assert estimate.has_converged(poses, centre)
    assert not estimate.has_converged(np.vstack([poses, [[0.0, 0.6, 0.0]]]), centre)
    assert estimate.has_converged(np.vstack([poses] * 19 + [[[0.0, 9.0, 0.0]] * 3]), centre)
    assert not estimate.has_converged(np.vstack([poses] * 19 + [[[0.0, 9.0, 0.0]] * 4]), centre)


def test_the_heaviest_clusters_are_the_hypotheses() -> None:
    near = np.random.default_rng(5).normal(0.0, 0.01, (100, 3))
    centres = np.repeat([[0.25, 0.25, 0.1], [5.25, 0.25, 0.1], [0.25, 7.25, -3.1]], [100, 30, 60], axis=0)
    poses = np.vstack([near, near[:30], near[:60]]) + centres
    weights = np.concatenate([np.full(100, 0.002), np.full(30, 0.01), np.full(60, 0.5 / 60)])
    found = estimate.report(poses, weights / weights.sum(), most=2)[1]()
    assert [h.weight for h in found] == pytest.approx([0.5, 0.3], abs=1e-9)
    np.testing.assert_allclose([h.estimate.pose for h in found], [[0.25, 7.25, -3.1], [5.25, 0.25, 0.1]], atol=0.01)
    assert estimate.report(poses, weights / weights.sum())[1]() == ()


def test_clusters_are_found_once_and_only_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    find = clusters.find

    def counting(poses: FloatArray, weights: FloatArray, **how: Any) -> clusters.Clusters:
        calls.append(weights.size)
        return find(poses, weights, **how)

    monkeypatch.setattr(clusters, "find", counting)
    _, hypotheses = estimate.report(np.zeros((9, 3)), np.full(9, 1.0 / 9.0), most=2)
    assert not calls
    assert hypotheses() is hypotheses()
    assert calls == [9]


def test_of_a_large_set_hypotheses_are_those_of_an_even_choice() -> None:
    rng = np.random.default_rng(6)
    poses = np.vstack([rng.normal(0.25, 0.01, (30_000, 3)), rng.normal(9.25, 0.01, (10_000, 3))])
    poses[:, 2] = 0.1
    weights = np.concatenate([np.full(30_000, 0.4 / 30_000), np.full(10_000, 0.6 / 10_000)])
    first, second = estimate.report(poses, weights, most=5)[1]()
    assert (first.weight, second.weight) == pytest.approx((0.6, 0.4), abs=1e-3)
    np.testing.assert_allclose(first.estimate.pose, [9.25, 9.25, 0.1], atol=1e-3)


@pytest.mark.parametrize(("extra", "counted"), [(0.3, 1000), (0.7, 1001), (-0.3, 1000), (-0.7, 999)])
def test_each_of_the_2000_chosen_stands_for_its_share_of_the_weight(extra: float, counted: int) -> None:
    """Each is the one at the middle of its 2,000th: of two heaps each has its share, rounded to the nearest."""
    share = 0.5 + extra / 2000
    poses = np.repeat([[0.25, 0.25, 0.1], [9.25, 0.25, 0.1]], [900, 1101], axis=0)
    weights = np.repeat([share / 900, (1.0 - share) / 1101], [900, 1101])
    found = estimate.report(poses, weights, most=2)[1]()
    by_place = {round(float(h.estimate.pose[0]), 2): h.weight for h in found}
    assert by_place == pytest.approx({0.25: counted / 2000, 9.25: 1 - counted / 2000})


def test_of_2000_particles_none_is_left_out() -> None:
    poses = np.repeat([[0.25, 0.25, 0.1], [9.25, 0.25, 0.1]], 1000, axis=0)
    weights = np.repeat([0.50037 / 1000, 0.49963 / 1000], 1000)
    assert [h.weight for h in estimate.report(poses, weights, most=2)[1]()] == pytest.approx([0.50037, 0.49963])


def test_the_last_particle_takes_what_rounding_leaves() -> None:
    """Weights may sum to a little less than 1; the last of the 2,000 then lies beyond them all."""
    poses, weights = np.zeros((2001, 3)), np.full(2001, 0.9 / 2001)
    (found,) = estimate.report(poses, weights, most=2)[1]()
    np.testing.assert_allclose(found.estimate.pose, np.zeros(3), atol=1e-12)


def test_few_effective_particles_call_for_resampling() -> None:
    assert is_depleted(49.9, 100, 0.5)
    assert not is_depleted(50.0, 100, 0.5)
