"""A drive through a small hall: what is learned of it, and what its best track is."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.smooth import best_track, evidence, learning
from mclcli.smooth.scans import Drive, Law, Scans
from tests.smooth.example import POSES, SURFACE, factors, scans_at

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

N = 70


def path() -> FloatArray:
    """A curve through the hall."""
    t = np.linspace(0.0, 2.0 * np.pi, N)
    return np.column_stack([1.2 + 0.8 * np.cos(t), 1.4 + 0.5 * np.sin(t), se2.wrap(t + 0.3 * np.sin(3.0 * t))])


def driven(sweep: float = 0.0) -> Drive:
    """Its scans without noise, and odometry that is 2 % too long and a little noisy."""
    rng, true = np.random.default_rng(0), path()
    steps = se2.between(true[:-1], true[1:]) * [1.02, 1.02, 1.0] + rng.normal(0.0, 0.003, (N - 1, 3))
    odometry = [np.zeros(3)]
    for step in steps:
        odometry.append(se2.compose(odometry[-1], step))
    breaks = np.arange(N) == 0
    return Drive(scans_at(true), np.array(odometry), breaks, np.zeros((N, 3)), np.tile([sweep, 0.0, 0.0], (N, 1)))


def shaken() -> FloatArray:
    return path() + np.random.default_rng(1).normal(0.0, [0.04, 0.04, 0.02], (N, 3))


def test_poses_beams_and_odometry_are_learned_together() -> None:
    found = learning.learn(driven(), shaken(), SURFACE)
    wrong = found.poses - path()
    wrong[:, 2] = se2.wrap(wrong[:, 2])
    assert np.abs(wrong[:, :2]).max() < 0.03
    assert np.abs(wrong[:, 2]).max() < 0.02
    assert found.law.sigma < 0.02
    assert found.law.z > 0.9
    assert 0.025 < found.law.offset < 0.042  # half a cell, seen aslant
    assert found.drift.length == pytest.approx(1 / 1.02 - 1, abs=0.01)
    assert 0.0 < found.alpha <= 1.0


def test_scans_of_another_place_are_distrusted_and_do_not_pull() -> None:
    """Ten scans in the middle see what the map does not have."""
    plain = driven()
    other = np.random.default_rng(2).uniform(0.2, 0.7, (10, plain.scans.ends.shape[1], 1))
    ends = plain.scans.ends.copy()
    ends[30:40] = (other * plain.scans.directions[30:40]).astype(np.float32)
    strange = dataclasses.replace(plain, scans=dataclasses.replace(plain.scans, ends=ends))
    found = best_track.smooth(strange, shaken(), SURFACE)
    assert np.abs((found.poses - path())[:, :2]).max() < 0.1
    assert (found.reliability[30:40] < 0.8).all()
    assert (np.delete(found.reliability, np.arange(30, 40)) > 0.9).all()
    spread = np.trace(found.covariances[:, :2, :2], axis1=1, axis2=2)
    assert spread[35] > 1.5 * np.median(spread)


def test_scans_without_beams_leave_the_law_as_it_was() -> None:
    plain = driven()
    nothing = Scans(plain.scans.ends, plain.scans.directions, np.zeros(N, np.int64), 8.0)
    found = learning.learn(dataclasses.replace(plain, scans=nothing), path(), SURFACE)
    assert found.law.z == 0.9
    assert found.evidence.tau == 0.0
    assert np.abs(found.poses - path())[:, :2].max() < 0.3


def test_a_sweep_adds_the_noise_of_its_way_in_the_frame_of_the_map() -> None:
    still, swept = (best_track.smooth(driven(sweep), path(), SURFACE) for sweep in (0.0, 0.2))
    np.testing.assert_array_equal(still.poses, swept.poses)
    added = swept.covariances - still.covariances
    own = swept.learned.drift.covariances(np.array([[0.2, 0.0, 0.0]]))[0]
    for k in (0, 20, 50):
        yaw = swept.poses[k, 2]
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        np.testing.assert_allclose(added[k], turn @ own @ turn.T, atol=1e-12)


def test_keys_and_trust() -> None:
    np.testing.assert_array_equal(learning.trust(np.array([0.59, 0.6, 1.0])), [0.05, 1.0, 1.0])
    found = best_track.smooth(driven(), path(), SURFACE)
    assert found.keys[0] == 0
    assert 20 < found.keys.size < N
    assert (np.diff(found.keys) > 0).all()


def test_scores_are_derivatives_of_every_beam() -> None:
    seen = factors(Law(0.05, 0.9)).residuals(POSES + 0.01)
    known = evidence.scores_of(seen, 0.05)
    for k in range(len(POSES)):
        weights = seen.shares[k] / 0.05**2
        rows = seen.jacobians[k]
        np.testing.assert_allclose(known.scores[k], -(weights * seen.distances[k])[:, np.newaxis] * rows)
        expected = sum(w * np.outer(j, j) for w, j in zip(weights, rows, strict=True))
        np.testing.assert_allclose(known.curvatures[k], expected + 1e-3 * np.eye(3))
    assert known.sharp.all()
    few = evidence.scores_of(type(seen)(*(np.asarray(column[:, :11]) for column in seen)), 0.05)
    assert not few.sharp.any()
