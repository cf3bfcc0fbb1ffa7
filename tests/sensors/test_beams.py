"""Which readings of a scan count, and where they point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.geometry import se3
from mclcli.sensors.beams import BeamSelection, maximum_range, select
from tests.support import scan_of

NAN, INF = math.nan, math.inf
ALL = BeamSelection(max_beams=0)


@pytest.mark.parametrize(
    ("of_scan", "of_user", "r_max"),
    [(8.0, -1.0, 8.0), (8.0, 5.0, 5.0), (8.0, 20.0, 8.0), (INF, 12.0, 12.0), (8.0, 0.0, 8.0), (NAN, 3.0, 3.0)],
)
def test_the_smaller_maximum_holds(of_scan: float, of_user: float, r_max: float) -> None:
    assert maximum_range(scan_of([1.0], range_max=of_scan), BeamSelection(laser_max_range=of_user)) == r_max


@pytest.mark.parametrize("range_max", [INF, NAN, 0.0, -1.0])
def test_without_any_maximum_the_error_says_what_to_set(range_max: float) -> None:
    with pytest.raises(InputError, match="--set laser_max_range"):
        select(scan_of([1.0], range_max=range_max), np.eye(4), ALL)


def test_skip_leaves_out_what_says_nothing() -> None:
    scan = scan_of([NAN, INF, -INF, -1.0, 0.0, 0.3, 0.30001, 4.0, 7.999, 8.0, 9.0], range_min=0.3)
    assert select(scan, np.eye(4), ALL).ranges.tolist() == [0.30001, 4.0, 7.999]


def test_score_clamps_every_number() -> None:
    scan = scan_of([NAN, INF, -INF, -1.0, 0.1, 4.0, 8.0, 9.0], range_min=0.3)
    selected = select(scan, np.eye(4), BeamSelection(max_beams=0, max_range="score"))
    assert selected.ranges.tolist() == [8.0, 0.0, 0.0, 0.1, 4.0, 8.0, 8.0]


def test_the_larger_minimum_holds() -> None:
    scan = scan_of([0.2, 0.4, 0.6], range_min=0.3)
    assert select(scan, np.eye(4), BeamSelection(laser_min_range=0.5)).ranges.tolist() == [0.6]
    assert select(scan, np.eye(4), BeamSelection(laser_min_range=0.1)).ranges.tolist() == [0.4, 0.6]


def test_the_users_maximum_cuts() -> None:
    selected = select(scan_of([1.0, 2.0, 3.0]), np.eye(4), BeamSelection(laser_max_range=3.0))
    assert selected.ranges.tolist() == [1.0, 2.0]
    assert selected.r_max == 3.0


@given(n=st.integers(1, 60), k=st.integers(0, 70))
def test_beams_are_chosen_evenly_with_both_ends(n: int, k: int) -> None:
    ranges = np.linspace(1.0, 2.0, n)
    got = select(scan_of(ranges), np.eye(4), BeamSelection(max_beams=k)).ranges.tolist()
    if k == 0 or k >= n:
        expected = list(range(n))
    else:
        expected = [math.ceil(i * (n - 1) / (k - 1)) for i in range(k)] if k > 1 else [0]
    assert got == ranges[expected].tolist()


def test_invalid_readings_are_dropped_before_beams_are_chosen() -> None:
    ranges = [NAN, 1.0, NAN, 2.0, 3.0, NAN, 4.0, 5.0, NAN]
    assert select(scan_of(ranges), np.eye(4), BeamSelection(max_beams=3)).ranges.tolist() == [1.0, 3.0, 5.0]


def test_a_beam_keeps_its_own_angle() -> None:
    scan = scan_of([NAN, 2.0, NAN, 3.0], angle_min=-0.5, angle_increment=0.25)
    selected = select(scan, np.eye(4), ALL)
    expected = [[2.0 * math.cos(-0.25), 2.0 * math.sin(-0.25)], [3.0 * math.cos(0.25), 3.0 * math.sin(0.25)]]
    np.testing.assert_allclose(selected.endpoints, expected, atol=1e-12)


def test_a_negative_increment_runs_clockwise() -> None:
    selected = select(scan_of([1.0, 1.0], angle_min=math.pi / 2, angle_increment=-math.pi / 2), np.eye(4), ALL)
    np.testing.assert_allclose(selected.endpoints, [[0.0, 1.0], [1.0, 0.0]], atol=1e-12)


def test_the_whole_mount_counts() -> None:
    scan = scan_of([1.0, 2.0], angle_min=0.0, angle_increment=math.pi / 2)
    yawed = select(scan, se3.from_rpy([0.5, 0.1, 0.3], 0.0, 0.0, math.pi / 2), ALL)
    np.testing.assert_allclose(yawed.endpoints, [[0.5, 1.1], [-1.5, 0.1]], atol=1e-12)
    upside_down = select(scan, se3.from_rpy([0.5, 0.1, 0.3], math.pi, 0.0, 0.0), ALL)
    np.testing.assert_allclose(upside_down.endpoints, [[1.5, 0.1], [0.5, -1.9]], atol=1e-12)
    tilted = select(scan, se3.from_rpy([0.0, 0.0, 0.3], 0.0, math.pi / 3, 0.0), ALL)
    np.testing.assert_allclose(tilted.endpoints, [[0.5, 0.0], [0.0, 2.0]], atol=1e-12)


def test_a_scan_without_a_usable_reading_has_no_beams() -> None:
    selected = select(scan_of([NAN, INF, 9.0]), np.eye(4), BeamSelection())
    assert selected.endpoints.shape == (0, 2)


def test_spreading_rand_over_a_parameter_needs_that_parameter() -> None:
    selection = BeamSelection(range_of_rand="parameter", laser_max_range=20.0)
    assert select(scan_of([1.0, 9.0]), np.eye(4), selection).r_max == 20.0
    with pytest.raises(UsageError, match=r"laser_max_range = -1: must be above 0 with range_of_rand=parameter"):
        BeamSelection(range_of_rand="parameter")
