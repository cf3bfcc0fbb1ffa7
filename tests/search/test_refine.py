"""From poses of the lattice to local maxima: the step, its bounds, and the covariance."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.search import refine
from mclcli.search.refine import Refinement
from mclcli.sensors.beams import BeamSelection, select
from tests.search.scenes import MOUNT, finder_for, hall, scan_at

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.likelihood_field import LikelihoodField

TRUE = np.array([1.3, 1.1, 0.7])
GRID = hall()
MODEL = finder_for(GRID).scene.model
BEAMS = select(scan_at(GRID, TRUE), MOUNT, BeamSelection(max_beams=60)).with_return()
SPACING = np.array([0.05, 0.05, 0.01])


def bilinear() -> LikelihoodField:
    return dataclasses.replace(MODEL, parameters=dataclasses.replace(MODEL.parameters, field_lookup="bilinear"))


def curvature(pose: FloatArray) -> FloatArray:
    """Σ w J Jᵀ / σ², beam by beam; the distance's slope is that over a cell to both sides."""
    p, h, model = MODEL.parameters, MODEL.field.resolution, bilinear()

    def distance(dx: float, dy: float) -> list[float]:
        moved = (pose + np.array([dx, dy, 0.0]))[np.newaxis]
        return [min(d, model.field.max_dist) for d in model.distances(BEAMS, moved)[0].tolist()]

    here, east, west, north, south = (distance(*by) for by in ((0, 0), (h, 0), (-h, 0), (0, h), (0, -h)))
    total, (c, s) = np.zeros((3, 3)), (math.cos(pose[2]), math.sin(pose[2]))
    for i, (x, y) in enumerate(BEAMS.endpoints.tolist()):
        dx, dy = (east[i] - west[i]) / (2 * h), (north[i] - south[i]) / (2 * h)
        j = np.array([dx, dy, dx * (-s * x - c * y) + dy * (c * x - s * y)])
        hit = p.z_hit * math.exp(-(here[i] ** 2) / (2 * p.sigma_hit**2))
        total += hit / (hit + p.z_rand / BEAMS.r_max) / p.sigma_hit**2 * np.outer(j, j)
    return total


@pytest.mark.parametrize("precise", [False, True])
@pytest.mark.parametrize("alpha", [1.0, 0.2])
def test_the_covariance_is_the_inverse_curvature_and_that_of_a_step(alpha: float, *, precise: bool) -> None:
    how = refine.after_drift(SPACING, alpha) if precise else refine.on_lattice(SPACING, alpha)
    poses, covariances = refine.refine(MODEL, BEAMS, TRUE[np.newaxis] + 0.01, how)
    drift = np.array([0.15, 0.15, math.radians(5.0)])
    known = np.diag(1.0 / drift**2) if precise else np.zeros((3, 3))
    expected = np.linalg.inv(alpha * curvature(poses[0]) + known) + np.diag(SPACING**2) / 12.0
    np.testing.assert_allclose(covariances[0], expected, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("off", [[0.03, -0.02, 0.008], [-0.04, 0.03, -0.01], [0.02, 0.04, 0.0]])
def test_poses_climb_towards_the_truth(off: list[float]) -> None:
    """Not all the way: the interpolated field has a crease at every border of a cell."""
    start = TRUE + np.array(off)
    (pose,), _ = refine.refine(MODEL, BEAMS, start[np.newaxis], refine.on_lattice(SPACING, 1.0))
    low, high, top = bilinear().measure("lidar", BEAMS).log_likelihood(np.array([start, pose, TRUE]))
    assert high - low > 0.15 * (top - low) > 0.0
    assert np.hypot(*(pose - TRUE)[:2]) < 0.05


def test_no_pose_leaves_its_reach() -> None:
    reach = np.array([0.02, 0.03, 0.001])
    how = Refinement(reach, SPACING, 1.0, np.zeros((3, 3)))
    starts = TRUE + np.array([[0.1, 0.1, 0.01], [-0.1, -0.08, -0.01]])
    poses, _ = refine.refine(MODEL, BEAMS, starts, how)
    moved = np.abs(poses - starts)
    assert (moved <= reach + 1e-12).all()
    assert (moved > 0.5 * reach).any(axis=1).all()


def test_what_is_known_before_holds_a_pose_back() -> None:
    start = (TRUE + np.array([0.04, 0.0, 0.0]))[np.newaxis]
    loose, tight = (
        refine.refine(MODEL, BEAMS, start, Refinement(np.full(3, 0.2), SPACING, 1.0, precision * np.eye(3)))[0][0]
        for precision in (0.0, 1e7)
    )
    assert np.abs(loose - start[0]).max() > 0.004
    assert np.abs(tight - start[0]).max() < 0.001


@pytest.mark.parametrize("precision", [0.0, 300.0, 3000.0])
@pytest.mark.parametrize("alpha", [1.0, 0.1])
def test_no_pose_becomes_less_likely_what_is_known_before_included(alpha: float, precision: float) -> None:
    starts = TRUE + np.random.default_rng(4).uniform(-1.0, 1.0, (12, 3)) * [0.06, 0.06, 0.02]
    how = Refinement(np.array([0.3, 0.3, 0.1]), SPACING, alpha, np.diag([precision, precision, 10.0 * precision]))
    poses, _ = refine.refine(MODEL, BEAMS, starts, how)
    before, after = (alpha * bilinear().measure("lidar", BEAMS).log_likelihood(some) for some in (starts, poses))
    gain = after - 0.5 * ((poses - starts) ** 2 * np.diag(how.precision)).sum(axis=1) - before
    assert (gain >= -1e-9).all()
    assert gain.max() > 1e-3


def test_steps_are_halved_and_none_is_longer_than_half_the_reach() -> None:
    starts = TRUE + np.array([[0.05, 0.04, 0.01], [-0.05, 0.0, -0.02]])
    for how in (refine.on_lattice(np.full(3, 1e-4), 1.0), refine.after_drift(SPACING, 0.05)):
        tried = refine._along_the_step(bilinear(), BEAMS, starts, starts, how, how.precision) - starts[:, np.newaxis]  # noqa: SLF001
        assert (np.abs(tried[:, 0]) <= 0.5 * how.reach * (1.0 + 1e-9)).all()
        for shorter in range(1, tried.shape[1]):
            np.testing.assert_allclose(tried[:, shorter], tried[:, 0] / 2**shorter, rtol=0, atol=1e-14)


def test_yaws_are_wrapped() -> None:
    turned = TRUE + np.array([0.0, 0.0, math.tau])
    (pose,), _ = refine.refine(MODEL, BEAMS, turned[np.newaxis], refine.on_lattice(SPACING, 1.0))
    assert pose[2] == pytest.approx(TRUE[2], abs=0.01)


def test_reaches() -> None:
    near, far = refine.on_lattice(SPACING, 0.3), refine.after_drift(SPACING, 0.3)
    np.testing.assert_array_equal(near.reach, 2.0 * SPACING)
    np.testing.assert_array_equal(near.precision, np.zeros((3, 3)))
    np.testing.assert_allclose(far.reach, [0.3, 0.3, math.radians(10.0)])
    np.testing.assert_allclose(far.precision, np.diag([0.15**-2, 0.15**-2, math.radians(5.0) ** -2]))
