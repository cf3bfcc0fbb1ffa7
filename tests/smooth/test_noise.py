"""Noise of odometry: what it grows with, and that it is found again."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.smooth import noise
from mclcli.smooth.noise import Drift

TRUE = Drift(0.02**2, 0.01**2, 0.012**2, 0.02**2, -0.01, 0.02, -0.004)


def test_variances_grow_with_the_way() -> None:
    increments = np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.4]])
    found = TRUE.covariances(increments) - Drift(0.0, 0.0, 0.0, 0.0).covariances(increments)
    along, yaw = 0.5 * 0.02**2, 0.5 * 0.012**2
    ahead = np.array([[along, 0.0, 0.0], [0.0, yaw * 0.25 / 3.0, yaw * 0.25], [0.0, yaw * 0.25, yaw]])
    np.testing.assert_allclose(found[0], ahead, atol=1e-15)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(found[1], turn @ ahead @ turn.T, atol=1e-15)
    assert found[2][2, 2] == pytest.approx(0.4 * 0.02**2)
    assert np.trace(found[2][:2, :2]) == pytest.approx(0.4 * 0.01**2)


def test_a_way_is_as_uncertain_in_one_increment_as_in_many() -> None:
    """Forty small increments ahead, chained, against one of their sum; without the floors."""
    small = np.tile([0.05, 0.0, 0.0], (40, 1))
    each = TRUE.covariances(small) - Drift(0.0, 0.0, 0.0, 0.0).covariances(small)
    total = np.zeros((3, 3))
    for covariance in each:
        step = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.05], [0.0, 0.0, 1.0]])
        total = step @ total @ step.T + covariance
    whole = np.array([[2.0, 0.0, 0.0]])
    expected = TRUE.covariances(whole) - Drift(0.0, 0.0, 0.0, 0.0).covariances(whole)
    np.testing.assert_allclose(total, expected[0], rtol=1e-9, atol=1e-15)


def test_covariances_are_positive_even_at_rest() -> None:
    found = Drift(0.0, 0.0, 0.0, 0.0).covariances(np.zeros((1, 3)))
    assert (np.linalg.eigvalsh(found[0]) > 0.0).all()


def test_corrections_are_undone() -> None:
    found = TRUE.corrected(np.array([[0.3, -0.4, 0.1]]))
    np.testing.assert_allclose(found, [[0.99 * 0.3, -0.99 * 0.4, 1.02 * 0.1 - 0.004 * 0.5]])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_is_found_again(seed: int) -> None:
    """From exact poses: variances to a fifth, what all increments are off by to its own uncertainty."""
    rng = np.random.default_rng(seed)
    n = 4000
    stated = np.column_stack([rng.uniform(0.0, 0.5, n), np.zeros(n), rng.normal(0.0, 0.3, n)])
    driven = TRUE.corrected(stated)
    roots = np.linalg.cholesky(TRUE.covariances(stated))
    driven += np.einsum("nij,nj->ni", roots, rng.normal(size=(n, 3)))
    poses = [np.zeros(3)]
    for step in driven:
        poses.append(se2.compose(poses[-1], step))
    known, crossed = np.zeros((n + 1, 3, 3)), np.zeros((n, 3, 3))
    found = Drift()
    for _ in range(4):
        found = noise.fit(np.array(poses), known, crossed, stated, found, np.ones(n, np.bool_))
    assert math.sqrt(found.along_by_move) == pytest.approx(0.02, rel=0.1)
    assert math.sqrt(found.yaw_by_move) == pytest.approx(0.012, rel=0.15)
    assert math.sqrt(found.yaw_by_turn) == pytest.approx(0.02, rel=0.1)
    assert found.length == pytest.approx(-0.01, abs=0.003)
    assert found.turn == pytest.approx(0.02, abs=0.002)
    assert found.pull == pytest.approx(-0.004, abs=0.002)


def test_what_poses_leave_open_counts_as_noise() -> None:
    """E eeᵀ = eeᵀ + the spread of the increment: smoothed poses move less than the robot did."""
    n, sigma = 500, 0.01
    stated = np.tile([0.25, 0.0, 0.0], (n, 1))
    poses = np.column_stack([0.25 * np.arange(n + 1), np.zeros(n + 1), np.zeros(n + 1)])
    known = np.tile(np.diag([sigma**2, 0.0, 0.0]), (n + 1, 1, 1))
    crossed = np.tile(np.diag([0.5 * sigma**2, 0.0, 0.0]), (n, 1, 1))
    found = noise.fit(poses, known, crossed, stated, Drift(), np.ones(n, np.bool_))
    floor = 0.002**2 + 2e-4**2
    assert found.along_by_move * 0.25 + floor == pytest.approx(2 * sigma**2 - 2 * 0.5 * sigma**2, rel=1e-6)
