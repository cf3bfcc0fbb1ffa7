"""A stretch of scans that stands aside comes back where odometry leads, and nothing else moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.smooth import aside, chain
from mclcli.smooth.odometry import Jumps, Odometry
from mclcli.smooth.scans import Law, ScanFactors
from tests.smooth.example import SURFACE, scans_at

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

LAW = Law(0.02, 0.9)


def drive() -> FloatArray:
    """Eighteen poses through the hall."""
    steps = np.linspace(0.0, 1.0, 18)
    return np.column_stack([0.4 + 1.6 * steps, 0.9 + 0.8 * steps, 0.5 + 0.6 * steps])


@pytest.mark.parametrize("shift", [[0.4, 0.0], [0.5, 0.5]])
def test_a_stretch_beside_its_place_is_brought_back(shift: list[float]) -> None:
    """Steps alone end where the stretch is held by other walls; from where odometry leads they come to the truth."""
    true = drive()
    factors = ScanFactors(SURFACE, scans_at(true), LAW, np.full(18, 0.3))
    odometry = Odometry(se2.between(true[:-1], true[1:]), np.tile(1e-4 * np.eye(3), (17, 1, 1)), Jumps(0.001, 10.0))
    start = true.copy()
    start[7:11, :2] += shift
    held = chain.minimise(start[np.newaxis], factors, odometry)
    assert np.abs(held.poses[0] - true).max() > 0.07
    kept = held.poses[0].copy()
    beside = aside.better(held.poses[0], held.odometry_costs[0], factors, odometry)
    found = chain.minimise(beside[np.newaxis], factors, odometry)
    assert np.abs(found.poses[0] - true).max() < 0.02
    assert found.costs[0] < held.costs[0]
    np.testing.assert_array_equal(held.poses[0], kept)


def test_what_stands_where_it_should_stays_to_the_bit() -> None:
    true = drive()
    factors = ScanFactors(SURFACE, scans_at(true), LAW, np.full(18, 0.3))
    odometry = Odometry(se2.between(true[:-1], true[1:]), np.tile(1e-4 * np.eye(3), (17, 1, 1)))
    np.testing.assert_array_equal(aside.better(true, np.zeros(17), factors, odometry), true)


def test_a_place_that_odometry_alone_speaks_against_is_kept() -> None:
    """Scans that fit where they are outweigh increments that are off: no stretch is moved to where it fits worse."""
    true = drive()
    factors = ScanFactors(SURFACE, scans_at(true), LAW, np.full(18, 0.3))
    increments = se2.between(true[:-1], true[1:])
    increments[[6, 10], 0] += [0.12, -0.12]
    odometry = Odometry(increments, np.tile(np.diag([4e-5, 4e-5, 4e-5]), (17, 1, 1)), Jumps(0.001, 10.0))
    costs = chain.minimise(true[np.newaxis], factors, odometry, steps=0).odometry_costs[0]
    assert (costs[[6, 10]] > 8.0).all()
    found = aside.better(true, costs, factors, odometry)
    assert np.abs(found - true).max() < 0.01
