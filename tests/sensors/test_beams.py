"""Which readings of a scan count, and where they point."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, get_args

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.geometry import se2, se3
from mclcli.quantity import MOST_TURNED
from mclcli.sensors.beams import (
    BeamOrigin,
    BeamSelection,
    maximum_range,
    problem_of,
    select,
)
from tests.support import scan_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.sensors.beams import BeamSubsampling, MaxRange, RangeOfRand, ShortRange

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
@example(n=7, k=1)
@example(n=7, k=2)
@example(n=7, k=6)
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


@pytest.mark.parametrize(
    ("n", "k"), [(9, 0), (9, 1), (9, 2), (9, 3), (10, 3), (11, 3), (9, 9), (9, 20), (1, 4), (2, 2)]
)
def test_which_beams_each_rule_looks_at(n: int, k: int) -> None:
    """Two readings are invalid; only the default looks for others in their place."""
    ranges = np.linspace(1.0, 2.0, n)
    ranges[[0, n // 2]] = NAN

    def indices(rule: BeamSubsampling) -> tuple[list[int], int]:
        chosen = select(scan_of(ranges), np.eye(4), BeamSelection(max_beams=k, beam_subsampling=rule))
        return chosen.indices.tolist(), chosen.slots

    def valid(indices: Iterable[int]) -> list[int]:
        return [i for i in indices if not math.isnan(ranges[i])]

    even = (
        list(range(n))
        if k in {0, n} or k > n
        else [math.ceil(i * (n - 1) / (k - 1)) for i in range(k)]
        if k > 1
        else [0]
    )
    assert indices("even") == (valid(even), len(even))
    slots = k or n
    assert indices("stride_ceil") == (valid(range(0, n, math.ceil(n / slots))), slots)
    step = max((n - 1) // (k - 1), 1) if k > 1 else n - 1 if k else 1
    assert indices("stride") == (valid(range(0, n, max(step, 1))), slots)


@pytest.mark.parametrize(("rule", "spread"), [("smaller", 5.0), ("parameter", 20.0)])
def test_what_random_readings_are_spread_over(rule: RangeOfRand, spread: float) -> None:
    selection = BeamSelection(laser_max_range=20.0, range_of_rand=rule)
    assert select(scan_of([1.0], range_max=5.0), np.eye(4), selection).r_max == spread


@pytest.mark.parametrize("roll", [0.0, math.pi])
def test_angles_as_nav2_forms_them(roll: float) -> None:
    """From the first two beams, turned; upside down they run clockwise."""
    scan = scan_of(np.ones(5), angle_min=-0.7, angle_increment=0.3)
    mount = se3.from_rpy([0.1, 0.2, 0.3], roll, 0.0, 3.0)
    got = select(scan, mount, BeamSelection(max_beams=0, beam_angles="nav2")).directions
    turn = 1.0 if roll == 0.0 else -1.0
    angles = 3.0 + turn * (-0.7 + 0.3 * np.arange(5))
    np.testing.assert_allclose(got, np.column_stack([np.cos(angles), np.sin(angles)]), atol=2e-6)
    np.testing.assert_allclose(got, select(scan, mount, ALL).directions, atol=2e-6)


@pytest.mark.parametrize(
    ("rule", "short", "expected"),
    [
        ("skip", "skip", [0.4, 7.9]),
        ("no_return", "skip", [8.0, 0.4, 7.9, 8.0, 8.0]),
        ("keep_equal", "skip", [0.3, 0.4, 7.9, 8.0]),
        ("as_read", "skip", [INF, -1.0, 0.2, 0.3, 0.4, 7.9, 8.0, 9.0]),
        ("skip", "max", [0.4, 7.9]),
        ("keep_equal", "max", [8.0] * 4 + [0.4, 7.9, 8.0]),
        ("score", "max", [8.0] * 5 + [0.4, 7.9, 8.0, 8.0]),
    ],
)
def test_which_readings_each_rule_keeps(rule: MaxRange, short: ShortRange, expected: list[float]) -> None:
    scan = scan_of([NAN, INF, -INF, -1.0, 0.2, 0.3, 0.4, 7.9, 8.0, 9.0], range_min=0.3, range_max=8.0)
    selection = BeamSelection(max_beams=0, max_range=rule, short_range=short)
    ranges = select(scan, np.eye(4), selection).ranges
    assert ranges[~np.isnan(ranges)].tolist() == expected


def test_beams_from_the_base_end_where_the_real_ones_do() -> None:
    scan, mount = scan_of([1.0, 2.5, INF]), se3.from_rpy([0.3, -0.2, 0.1], 0.0, 0.0, 0.7)
    real, virtual = (
        select(scan, mount, BeamSelection(max_beams=0, max_range="as_read", beam_origin=origin))
        for origin in get_args(BeamOrigin)
    )
    np.testing.assert_array_equal(virtual.origins, np.zeros((3, 2)))
    np.testing.assert_allclose(virtual.endpoints[:2], real.endpoints[:2], atol=1e-12)
    np.testing.assert_allclose(np.hypot(*virtual.directions.T), np.ones(3), atol=1e-12)
    np.testing.assert_allclose(virtual.ranges[:2], np.hypot(*real.endpoints[:2].T), atol=1e-12)
    assert virtual.ranges[2] == INF


@pytest.mark.parametrize(
    ("first", "step", "problem"),
    [(0.0, 0.1, False), (0.0, NAN, True), (INF, 0.1, True), (MOST_TURNED, -0.1, False), (1.1 * MOST_TURNED, 0.0, True)],
)
def test_scans_whose_beams_point_nowhere_known(first: float, step: float, *, problem: bool) -> None:
    scan = scan_of([1.0, 1.0], angle_min=first, angle_increment=step)
    assert bool(problem_of(scan)) is problem
    growing = scan_of([1.0] * 3, angle_min=0.0, angle_increment=0.6 * MOST_TURNED)
    assert problem_of(growing)


def test_beams_of_a_sweep_are_each_seen_from_a_base_of_its_own() -> None:
    scan, mount = scan_of([1.0, NAN, 2.5, 4.0]), se3.from_rpy([0.3, -0.2, 0.1], 0.0, 0.0, 0.7)
    bases = np.array([[0.1, -0.4, 0.3], [9.0, 9.0, 9.0], [0.05, 0.7, -0.2], [0.0, 0.0, 0.0]])
    still, swept = select(scan, mount, ALL), select(scan, mount, ALL, lambda chosen: bases[chosen])
    for i, base in enumerate(bases[[0, 2, 3]]):
        end = se2.compose(base, [*still.endpoints[i], 0.0])[:2]
        np.testing.assert_allclose(swept.endpoints[i], end, atol=1e-12)
        np.testing.assert_allclose(swept.origins[i], se2.compose(base, [*still.origins[i], 0.0])[:2], atol=1e-12)


@pytest.mark.parametrize("origin", ["sensor", "base"])
def test_an_offset_moves_where_beams_end_and_not_what_was_measured(origin: BeamOrigin) -> None:
    """Along the beam, by so much; models that cast rays see the same ranges."""
    scan, mount = scan_of([2.0, 3.0, INF], range_max=8.0), se3.from_planar([0.3, -0.1, 0.4])
    plain = BeamSelection(max_beams=0, max_range="as_read", beam_origin=origin)
    without, moved = (select(scan, mount, p) for p in (plain, dataclasses.replace(plain, range_offset=0.03)))
    np.testing.assert_array_equal(moved.ranges, without.ranges)
    apart = moved.with_return().endpoints - without.with_return().endpoints
    np.testing.assert_allclose(apart, 0.03 * without.with_return().directions, atol=1e-12)
    kept = moved.with_return().subset(np.array([False, True]))
    np.testing.assert_array_equal(kept.endpoints, moved.endpoints[1:2])


def test_without_an_offset_ends_are_to_the_bit_as_ever() -> None:
    chosen = select(scan_of([1.1, 2.3]), np.eye(4), ALL)
    np.testing.assert_array_equal(chosen.endpoints, chosen.origins + chosen.ranges[:, np.newaxis] * chosen.directions)
