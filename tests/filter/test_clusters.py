"""Clusters against a flood fill, and what must not change them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.filter import clusters, estimate
from mclcli.geometry import se2
from tests.reference import clusters as naive
from tests.support import each_backend

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.native.backend import Backend

poses_of = st.lists(
    st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(-math.pi, math.pi)), min_size=1, max_size=60
)
wrapped = pytest.mark.parametrize("wrap", [True, False])


def equal(n: int) -> FloatArray:
    """Equal weights."""
    return np.full(n, 1.0 / n)


def blob(x: float, y: float, yaw: float, n: int, seed: int = 0) -> FloatArray:
    """Particles close around a pose, yaw wrapped."""
    poses = np.random.default_rng(seed).normal([x, y, yaw], [0.1, 0.1, 0.05], (n, 3))
    poses[:, 2] = se2.wrap(poses[:, 2])
    return poses


@wrapped
@given(poses_of, st.integers(0, 1000))
def test_clusters_are_those_of_a_flood_fill(wrap: bool, poses: list[tuple[float, float, float]], seed: int) -> None:  # noqa: FBT001
    weights = np.random.default_rng(seed).dirichlet(np.ones(len(poses)))
    found = clusters.find(np.array(poses), weights, wrap_yaw=wrap)
    expected = naive.find(poses, weights.tolist(), wrap=wrap)
    assert found.weights.size == len(expected)
    for label, (inside, weight, mean, covariance) in enumerate(expected):
        assert np.flatnonzero(found.labels == label).tolist() == inside
        assert found.weights[label] == pytest.approx(weight, rel=1e-12)
        if found.resultants[label] > 1e-6:  # else the mean direction is noise
            np.testing.assert_allclose(found.means[label, :2], mean[:2], rtol=0, atol=1e-9)
            assert abs(float(se2.wrap(found.means[label, 2] - mean[2]))) < 1e-9
            np.testing.assert_allclose(found.covariances[label], covariance, rtol=0, atol=1e-8)


def test_a_long_winding_chain_is_one_cluster() -> None:
    angle = np.linspace(0.0, 40.0, 3000)
    spiral = np.stack([(2.0 + 2.0 * angle) * np.cos(angle), (2.0 + 2.0 * angle) * np.sin(angle), 0.0 * angle], axis=-1)
    dense = np.concatenate(
        [spiral[i] + np.linspace(0.0, 1.0, 10)[:, None] * (spiral[i + 1] - spiral[i]) for i in range(2999)]
    )
    order = np.random.default_rng(0).permutation(dense.shape[0])
    assert clusters.find(dense[order], equal(dense.shape[0])).weights.size == 1


@pytest.mark.parametrize("offset", [(1, 1, 1), (1, -1, 1), (-1, 1, -1), (0, 1, -1), (1, 0, 0), (0, 0, 1)])
def test_bins_that_touch_at_a_corner_are_one_cluster(offset: tuple[int, int, int]) -> None:
    centre = np.array([0.25, 0.25, math.radians(5.0)])
    step = np.array(offset) * [0.5, 0.5, math.radians(10.0)]
    assert clusters.find(np.stack([centre, centre + step]), equal(2)).weights.size == 1
    assert clusters.find(np.stack([centre, centre + 2 * step]), equal(2)).weights.size == 2


@pytest.mark.parametrize("offset", [(0, 0), (1, 1), (-1, 0), (1, -1)])
def test_backwards_is_one_heading_unless_told_otherwise(offset: tuple[int, int]) -> None:
    two = np.array([[0.25, 0.25, 3.1], [0.25 + 0.5 * offset[0], 0.25 + 0.5 * offset[1], -3.1]])
    assert clusters.find(two, equal(2)).weights.tolist() == [1.0]
    assert clusters.find(two, equal(2), wrap_yaw=False).weights.tolist() == [0.5, 0.5]


def test_a_cloud_looking_backwards_has_its_mean_there() -> None:
    found = clusters.find(blob(1.0, 2.0, math.pi, 500), equal(500))
    assert found.weights.size == 1
    assert abs(float(se2.wrap(found.heaviest.pose[2] - math.pi))) < 0.01
    assert found.heaviest.covariance[2, 2] == pytest.approx(0.05**2, rel=0.2)


def test_the_heaviest_comes_first_whoever_has_more_particles() -> None:
    poses = np.concatenate([blob(0, 0, 0, 90), blob(8, 0, 1, 10)])
    weights = np.concatenate([np.full(90, 0.4 / 90), np.full(10, 0.06)])
    found = clusters.find(poses, weights)
    np.testing.assert_allclose(found.weights, [0.6, 0.4], rtol=1e-12)
    assert (found.labels == np.repeat([1, 0], [90, 10])).all()
    np.testing.assert_allclose(found.heaviest.pose, [8, 0, 1], atol=0.2)
    np.testing.assert_array_equal(found.heaviest.covariance, found.covariances[0])
    assert (found.covariances[0] != found.covariances[1]).any()


@each_backend
def test_a_cluster_without_weight_beside_one_with_counts_its_particles_alike(backend: Backend) -> None:
    poses = np.array([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [8.0, 0.0, 0.0], [8.2, 0.0, 0.0]])
    found = clusters.find(poses, np.array([0.25, 0.75, 0.0, 0.0]), backend=backend)
    assert found.weights.tolist() == [1.0, 0.0]
    np.testing.assert_allclose(found.means[:, 0], [0.175, 8.1], rtol=1e-12)


def test_of_equal_clusters_the_first_particles_comes_first() -> None:
    poses = np.array([[5.0, 0, 0], [-5.0, 0, 0], [0, 0, 0], [-5.0, 0, 0], [5.0, 0, 0]])
    found = clusters.find(poses, np.array([0.25, 0.25, 0.0, 0.25, 0.25]))
    assert found.labels.tolist() == [0, 1, 2, 1, 0]


def test_one_cluster_is_the_whole_sets_estimate() -> None:
    poses, weights = blob(3, -2, 0.4, 300), np.random.default_rng(1).dirichlet(np.ones(300))
    whole, found = estimate.weighted_mean(poses, weights), clusters.find(poses, weights)
    assert found.weights.size == 1
    np.testing.assert_allclose(found.heaviest.pose, whole.pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.heaviest.covariance, whole.covariance, rtol=0, atol=1e-12)


def test_covariances_are_symmetric_and_positive() -> None:
    poses = np.random.default_rng(2).uniform(-3, 3, (400, 3))
    found = clusters.find(poses, equal(400))
    assert found.weights.size > 3
    np.testing.assert_array_equal(found.covariances, found.covariances.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(found.covariances).min() > -1e-12


def test_one_particle_is_a_cluster_without_spread() -> None:
    found = clusters.find(np.array([[1.0, 2.0, 3.0]]), np.ones(1))
    np.testing.assert_allclose(found.heaviest.pose, [1.0, 2.0, 3.0], rtol=1e-15)
    assert np.abs(found.heaviest.covariance).max() < 1e-30


def test_a_cluster_without_weight_still_has_a_place() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [9.1, 0.0, 1.0], [9.3, 0.0, 1.0]])
    found = clusters.find(poses, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(found.means[1], [9.2, 0.0, 1.0], rtol=1e-12)


def test_the_order_of_the_particles_does_not_matter() -> None:
    poses, weights = np.random.default_rng(3).uniform(-3, 3, (200, 3)), np.random.default_rng(4).dirichlet(np.ones(200))
    order = np.random.default_rng(5).permutation(200)
    one, other = clusters.find(poses, weights), clusters.find(poses[order], weights[order])
    np.testing.assert_array_equal(other.labels, one.labels[order])
    np.testing.assert_allclose(other.means, one.means, rtol=0, atol=1e-12)


def test_far_from_the_origin_the_clusters_are_the_same() -> None:
    poses = np.random.default_rng(6).uniform(-4, 4, (300, 3))
    here, there = (clusters.find(poses + np.array([far, far, 0.0]), equal(300)) for far in (0.0, 5e6))
    np.testing.assert_array_equal(here.labels, there.labels)
