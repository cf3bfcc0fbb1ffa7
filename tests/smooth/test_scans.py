"""Distances and slopes between cells, and scans as factors: against one beam at a time, and against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mclcli.smooth.scans import Law, ScanFactors
from tests.reference import smoothing as reference
from tests.smooth.example import POSES, SURFACE, factors

CELLS = SURFACE.field.metres().tolist()
ORIGIN = SURFACE.field.origin.tolist()
OFF = POSES + np.array([0.02, -0.03, 0.01])
FAR = POSES + np.array([0.7, 0.5, 1.0])
LAW = Law(0.05, 0.8, 0.03)


def distance(x: float, y: float) -> float:
    return reference.interpolated(CELLS, SURFACE.field.resolution, ORIGIN, SURFACE.field.max_dist, x, y)


def beams(k: int, pose: list[float]) -> list[float]:
    """Distances of the real beams of a scan at a pose."""
    scans = factors(LAW).scans
    rows = zip(scans.ends[k].tolist(), scans.directions[k].tolist(), range(scans.counts[k]), strict=False)
    return [distance(*reference.endpoint(pose, tuple(end), tuple(ahead), LAW.offset)) for end, ahead, _ in rows]


def test_distances_are_interpolated_between_cells_and_have_their_slopes() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-3.0, 6.0, 2000), rng.uniform(-2.0, 6.0, 2000)
    found = SURFACE.look(x, y)
    expected = [distance(*point) for point in zip(x.tolist(), y.tolist(), strict=True)]
    np.testing.assert_allclose(found.distance, expected, atol=1e-6)
    inside = np.array(expected) < SURFACE.field.max_dist
    assert 200 < inside.sum() < 1800
    h = 1e-6
    by_x = [(distance(a + h, b) - distance(a - h, b)) / (2 * h) for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    by_y = [(distance(a, b + h) - distance(a, b - h)) / (2 * h) for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    near = np.abs(np.stack([found.slope_x - by_x, found.slope_y - by_y])) < 1e-3
    assert near.mean() > 0.995  # but at the creases between cells


def test_a_scan_costs_what_its_beams_cost_one_by_one() -> None:
    alphas = np.array([1.0, 0.5, 0.3, 2.0])
    found = factors(LAW, alphas)(OFF[np.newaxis])
    for k, pose in enumerate(OFF.tolist()):
        p = [reference.density(d, LAW.sigma, LAW.z, SURFACE.field.max_dist) for d in beams(k, pose)]
        assert found.costs[0, k] == pytest.approx(-alphas[k] * sum(map(math.log, p)), rel=1e-5)


def test_gradients_are_derivatives_of_costs() -> None:
    alphas, h = np.array([1.0, 0.5, 0.3, 2.0]), 1e-6
    found = factors(LAW, alphas)(OFF[np.newaxis])
    for i in range(3):
        step = np.zeros(3)
        step[i] = h
        ahead, back = (factors(LAW, alphas)((OFF + s * step)[np.newaxis]).costs[0] for s in (1.0, -1.0))
        np.testing.assert_allclose(found.gradients[0, :, i], (ahead - back) / (2 * h), rtol=1e-3, atol=0.3)


def test_curvatures_are_sums_over_beams() -> None:
    """Σ ρ J Jᵀ / σ², J by differences of the interpolated distance."""
    found, h = factors(LAW)(OFF[np.newaxis]).curvatures[0], 1e-6
    for k, pose in enumerate(OFF.tolist()):
        here = beams(k, pose)
        sides = []
        for i in range(3):
            ahead, back = list(pose), list(pose)
            ahead[i] += h
            back[i] -= h
            sides.append([(a - b) / (2 * h) for a, b in zip(beams(k, ahead), beams(k, back), strict=True)])
        weights = [reference.hit_share(d, LAW.sigma, LAW.z, SURFACE.field.max_dist) / LAW.sigma**2 for d in here]
        expected = [[sum(w * a * b for w, a, b in zip(weights, p, q, strict=True)) for q in sides] for p in sides]
        np.testing.assert_allclose(found[k], expected, rtol=2e-3, atol=2.0)
        assert (np.linalg.eigvalsh(found[k]) > 0.0).all()


def test_residuals_are_those_of_the_beams_that_there_are() -> None:
    found, h = factors(LAW).residuals(OFF), 1e-4
    other = ScanFactors(SURFACE, factors(LAW).scans, Law(LAW.sigma, LAW.z, LAW.offset + h), np.ones(4)).residuals(OFF)
    np.testing.assert_allclose(found.along, (other.distances - found.distances) / h, atol=0.02)
    for k, pose in enumerate(OFF.tolist()):
        expected = beams(k, pose)
        np.testing.assert_allclose(found.distances[k, : len(expected)], expected, atol=1e-6)
        shares = [reference.hit_share(d, LAW.sigma, LAW.z, SURFACE.field.max_dist) for d in expected]
        np.testing.assert_allclose(found.shares[k, : len(expected)], shares, rtol=1e-4, atol=1e-12)
    absent = ~factors(LAW).scans.real()
    assert absent.any()
    assert not found.distances[absent].any()
    assert not found.shares[absent].any()
    assert not found.jacobians[absent].any()


def test_a_scan_is_explained_where_it_was_taken_and_nowhere_else() -> None:
    here, there = factors(LAW).explained(POSES), factors(LAW).explained(FAR)
    assert (here > 0.9).all()
    assert (there < 0.5).all()
    here, there = factors(LAW).reliability(POSES), factors(LAW).reliability(FAR)
    assert (here > 0.95).all()
    assert (there < 0.8).all()


def test_several_chains_are_as_good_as_one() -> None:
    both = factors(LAW)(np.stack([POSES, OFF]))
    alone = factors(LAW)(OFF[np.newaxis])
    for together, single in zip(both, alone, strict=True):
        np.testing.assert_array_equal(together[1], single[0])
