"""The chain's minimum, its normal equations, its covariances, and how far off a start may be."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.smooth import chain, odometry
from mclcli.smooth.chain import Smoothed, Unary
from mclcli.smooth.odometry import Jumps, Odometry
from tests.reference import chain as reference

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

N = 7


def factors_at(points: FloatArray, information: FloatArray) -> chain.UnaryFactors:
    """Poses known by themselves: points (n, 3) with an information (n, 3, 3) that may be singular."""

    def known(poses: FloatArray) -> Unary:
        off = poses - points
        off[..., 2] = se2.wrap(off[..., 2])
        gradients = np.einsum("nij,mnj->mni", information, off)
        curvatures = np.broadcast_to(information, (len(poses), *information.shape)).copy()
        return Unary(0.5 * (gradients * off).sum(axis=-1), gradients, curvatures)

    return known


def drive(seed: int = 3) -> tuple[FloatArray, Odometry, FloatArray, FloatArray]:
    """Poses (N, 3) of a drive through yaw = π, noisy odometry of it, points (N, 3) near it and their information."""
    rng = np.random.default_rng(seed)
    steps = rng.normal([0.4, 0.02, 0.3], [0.1, 0.05, 0.2], (N - 1, 3))
    poses = [np.array([1.0, -2.0, 2.6])]
    for step in steps:
        poses.append(se2.compose(poses[-1], step))
    true = np.array(poses)
    mixed = rng.normal(0.0, 0.03, (N - 1, 3, 3))
    covariances = mixed @ mixed.transpose(0, 2, 1) + np.diag([1e-3, 5e-4, 2e-4])
    increments = steps + np.einsum("nij,nj->ni", np.linalg.cholesky(covariances), rng.normal(size=(N - 1, 3)))
    roots = rng.normal(0.0, 20.0, (N, 3, 3))
    roots[1, 1:], roots[3] = 0.0, 0.0  # the one is known along a line only, of the other nothing is known
    points = true + rng.normal(0.0, 0.02, (N, 3))
    return true, Odometry(increments, covariances), points, roots


def of_reference(poses: FloatArray, joined: Odometry, points: FloatArray, roots: FloatArray) -> tuple[FloatArray, ...]:
    known = [[(p, r)] for p, r in zip(points.tolist(), roots.tolist(), strict=True)]
    information = np.linalg.inv(joined.covariances)
    whitened = np.linalg.cholesky(information).transpose(0, 2, 1)
    h, g = reference.normal_equations(poses.tolist(), known, joined.increments.tolist(), whitened.tolist())
    return np.array(h), np.array(g)


def smoothed(seed: int = 3, chains: int = 1, spread: float = 0.0, jumps: Jumps | None = None) -> Smoothed:
    true, joined, points, roots = drive(seed)
    starts = true + np.random.default_rng(1).normal(0.0, 1.0, (chains, N, 3)) * spread
    information = roots.transpose(0, 2, 1) @ roots
    joined = Odometry(joined.increments, joined.covariances, jumps)
    return chain.minimise(starts, factors_at(points, information), joined)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_minimum_has_no_gradient_in_the_dense_equations(seed: int) -> None:
    found = smoothed(seed)
    _, joined, points, roots = drive(seed)
    hessian, gradient = of_reference(found.poses[0], joined, points, roots)
    assert found.converged.all()
    assert np.abs(np.linalg.solve(hessian, gradient)).max() < 2e-6  # how far the dense step would still go
    assert np.abs(found.poses[0] - drive(seed)[0]).max() > 1e-3  # it is not where it began


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_covariances_and_determinant_are_those_of_the_dense_inverse(seed: int) -> None:
    found = smoothed(seed)
    _, joined, points, roots = drive(seed)
    hessian, _ = of_reference(found.poses[0], joined, points, roots)
    inverse = np.linalg.inv(hessian)
    expected = np.array([inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(N)])
    np.testing.assert_allclose(found.covariances()[0], expected, rtol=1e-5, atol=1e-10)
    assert found.log_determinants[0] == pytest.approx(np.linalg.slogdet(hessian)[1], abs=1e-5)


def test_costs_are_those_of_the_residuals() -> None:
    found = smoothed()
    _, joined, points, roots = drive()
    known = [[(p, r)] for p, r in zip(points.tolist(), roots.tolist(), strict=True)]
    whitened = np.linalg.cholesky(np.linalg.inv(joined.covariances)).transpose(0, 2, 1)
    residuals = reference.residuals(found.poses[0].tolist(), known, joined.increments.tolist(), whitened.tolist())
    squares = 0.5 * np.square(residuals)
    np.testing.assert_allclose(found.unary_costs[0], squares[: 3 * N].reshape(N, 3).sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(found.odometry_costs[0], squares[3 * N :].reshape(-1, 3).sum(axis=1), atol=1e-12)
    assert found.costs[0] == pytest.approx(squares.sum())


def test_starts_well_off_come_to_the_same_minimum() -> None:
    there, found = smoothed(), smoothed(chains=20, spread=0.4)
    assert found.converged.all()
    apart = found.poses - there.poses
    apart[..., 2] = se2.wrap(apart[..., 2])
    assert np.abs(apart).max() < 1e-5
    assert (np.abs(found.poses[..., 2]) <= math.pi).all()


def test_a_chain_gets_the_bits_that_it_gets_alone() -> None:
    found = smoothed(chains=5, spread=0.3)
    true, joined, points, roots = drive()
    starts = true + np.random.default_rng(1).normal(0.0, 1.0, (5, N, 3)) * 0.3
    known = factors_at(points, roots.transpose(0, 2, 1) @ roots)
    for k, start in enumerate(starts):
        alone = chain.minimise(start[np.newaxis], known, joined)
        np.testing.assert_array_equal(alone.poses[0], found.poses[k])
        np.testing.assert_array_equal(alone.covariances()[0], found.covariances()[k])


def test_a_single_pose_is_a_chain() -> None:
    point, information = np.array([[1.0, 2.0, 3.0]]), np.diag([4.0, 9.0, 25.0])[np.newaxis]
    none = Odometry(np.zeros((0, 3)), np.zeros((0, 3, 3)))
    found = chain.minimise(point[np.newaxis] + 0.2, factors_at(point, information), none)
    np.testing.assert_allclose(found.poses[0], point, atol=1e-8)
    np.testing.assert_allclose(found.covariances()[0, 0], np.diag([1 / 4, 1 / 9, 1 / 25]), rtol=1e-6)


def test_what_nothing_but_odometry_tells_keeps_its_place_and_gets_less_sure() -> None:
    """The first pose alone is known: the others follow from increments, and their covariances grow."""
    true, joined, points, _ = drive()
    information = np.zeros((N, 3, 3))
    information[0] = np.diag([1e6, 1e6, 1e6])
    found = chain.minimise(true[np.newaxis], factors_at(points, information), joined)
    expected = [points[0]]
    for increment in joined.increments:
        expected.append(se2.compose(expected[-1], increment))
    np.testing.assert_allclose(found.poses[0], expected, atol=1e-6)
    volumes = np.linalg.det(found.covariances()[0])
    assert (np.diff(volumes) > 0.0).all()


@pytest.mark.parametrize("square", [0.0, 0.5, 4.0, 30.0, 300.0])
def test_rare_jumps_cost_and_weigh_as_the_mixture_does(square: float) -> None:
    increments, information = np.zeros((1, 3)), np.eye(3)[np.newaxis]
    joined = Odometry(increments, information, Jumps(0.02, 8.0))
    poses = np.array([[[0.0, 0.0, 0.0], [math.sqrt(square), 0.0, 0.0]]])
    found = odometry.linearise(poses, joined, information)
    assert found.costs[0, 0] == pytest.approx(reference.robust_cost(square, 0.02, 8.0), rel=1e-9)
    weight = reference.robust_weight(square, 0.02, 8.0)
    assert found.gradients[0, 1, 0] == pytest.approx(weight * math.sqrt(square), rel=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(found.curvatures[0, 1]), [weight] * 3, rtol=1e-5)


def test_a_jump_of_odometry_does_not_bend_the_rest() -> None:
    """One increment is 40 standard deviations off: poses known to centimetres hold against it."""
    true, _, points, _ = drive()
    exact = np.array([se2.between(true[k], true[k + 1]) for k in range(N - 1)])
    exact[3] += [0.0, 0.0, 0.8]
    information = np.tile(np.diag([2e3, 2e3, 2e3]), (N, 1, 1))
    covariances = np.tile(np.diag([4e-4, 4e-4, 4e-4]), (N - 1, 1, 1))
    worst = []
    for jumps in (None, Jumps(0.01, 30.0)):
        known = factors_at(true, information)
        found = chain.minimise(points[np.newaxis], known, Odometry(exact, covariances, jumps))
        worst.append(np.abs(se2.wrap(found.poses[0, :, 2] - true[:, 2])).max())
    assert worst[0] > 0.1
    assert worst[1] < 0.01


def test_steps_that_run_out_are_told() -> None:
    true, joined, points, roots = drive()
    known = factors_at(points, roots.transpose(0, 2, 1) @ roots)
    assert not chain.minimise(true[np.newaxis] + 0.3, known, joined, steps=1).converged.any()
