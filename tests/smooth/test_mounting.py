"""The joint step of clock and mount against the dense equations, and what it tells of drives that are off."""

from __future__ import annotations

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.smooth import chain, mounting
from mclcli.smooth.mounting import Mounting
from mclcli.smooth.odometry import Odometry, linearise
from mclcli.smooth.scans import Drive, Law, ScanFactors
from tests.smooth.example import POSES, SURFACE, scans_at

LAW = Law(0.05, 0.9)
TWISTS = np.array([[0.5, 0.0, 0.3], [0.6, 0.1, -0.5], [0.2, 0.0, 0.9], [0.4, -0.1, 0.0]])


def distances(factors: ScanFactors, off: np.ndarray) -> np.ndarray:
    """Distances (n, K) with a delay, and a lidar moved by x, y and turned about the base."""
    delay, x, y, yaw = off.tolist()
    poses = se2.compose(POSES, se2.exp(TWISTS * delay))
    c, s = np.cos(yaw), np.sin(yaw)
    ends = factors.scans.ends.astype(np.float64) @ np.array([[c, s], [-s, c]]) + [x, y]
    scans = type(factors.scans)(ends, factors.scans.directions, factors.scans.counts, 8.0)
    return ScanFactors(SURFACE, scans, factors.law, factors.alphas).residuals(poses).distances


def test_the_step_is_that_of_the_dense_equations() -> None:
    factors = ScanFactors(SURFACE, scans_at(POSES), LAW, np.array([1.0, 0.5, 0.8, 0.3]))
    increments = se2.between(POSES[:-1], POSES[1:])
    odometry = Odometry(increments, np.tile(np.diag([4e-4, 4e-4, 1e-4]), (3, 1, 1)))
    drive = Drive(factors.scans, POSES, np.array([True, False, False, False]), TWISTS, np.zeros((4, 3)))
    found = chain.minimise(POSES[np.newaxis], factors, odometry, steps=0)
    seen = factors.residuals(POSES)
    told = mounting.estimate(found, factors, seen, drive)
    h, columns = 1e-5, []
    for i in range(4):
        step = np.zeros(4)
        step[i] = h
        columns.append((distances(factors, step) - distances(factors, -step)) / (2 * h))
    by = np.stack(columns, axis=-1)
    weights = seen.shares * factors.alphas[:, np.newaxis] / LAW.sigma**2
    information = np.asarray(np.linalg.inv(odometry.covariances), dtype=np.float64)
    joined = linearise(POSES[np.newaxis], odometry, information)
    whole = np.zeros((16, 16))
    for k in range(4):
        own = slice(3 * k, 3 * k + 3)
        whole[own, own] = factors(POSES[np.newaxis]).curvatures[0, k] + joined.curvatures[0, k]
        whole[own, 12:] = np.einsum("k,ki,kj->ij", weights[k], seen.jacobians[k], by[k])
        if k < 3:
            whole[own, 3 * k + 3 : 3 * k + 6] = joined.above[0, k]
    whole = np.triu(whole) + np.triu(whole, 1).T
    whole[12:, 12:] = np.einsum("nk,nki,nkj->ij", weights, by, by) + np.diag(1 / np.square([0.2, 0.1, 0.1, 0.1]))
    gradient = np.concatenate([np.zeros(12), np.einsum("nk,nk,nkj->j", weights, seen.distances, by)])
    expected, spread = -np.linalg.solve(whole, gradient)[12:], 2 * np.sqrt(np.diag(np.linalg.inv(whole))[12:])
    for (value, deviation), v, d in zip((told.late, told.ahead, told.left), expected, spread, strict=False):
        assert value == pytest.approx(v, rel=0.05, abs=2e-4)
        assert deviation == pytest.approx(d, rel=0.02)


def test_only_what_is_sure_and_matters_is_told() -> None:
    none = (0.0, 0.001)
    assert not Mounting((0.009, 0.001), none, none).is_late
    assert not Mounting((0.02, 0.007), none, none).is_late
    assert Mounting((-0.022, 0.007), none, none).is_late
    assert not Mounting((0.1, 0.01), none, none).is_moved
    assert Mounting(none, (0.05, 0.01), none).is_moved
    assert Mounting(none, none, (-0.05, 0.01)).is_moved
