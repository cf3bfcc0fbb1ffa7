"""Planar poses: a group, its exponential, and the way between two poses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mclcli.geometry import se2
from tests.reference import filter as naive

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

PI = math.pi
metres = st.floats(-100.0, 100.0)
angles = st.floats(-20.0, 20.0)
poses = st.tuples(metres, metres, angles).map(np.array)


def same(a: FloatArray, b: FloatArray, tolerance: float = 1e-9) -> bool:
    difference = np.asarray(a) - np.asarray(b)
    difference[..., 2] = np.angle(np.exp(1j * difference[..., 2]))
    return bool(np.abs(difference).max() < tolerance)


@given(st.floats(-1e6, 1e6))
@example(np.nextafter(PI, 4.0))
@example(np.nextafter(-PI, -4.0))
@example(-PI)
@example(3 * PI)
def test_wrapped_angles_lie_above_minus_pi_and_point_the_same_way(angle: float) -> None:
    wrapped = float(se2.wrap(angle))
    assert -PI < wrapped <= PI
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(st.floats(-PI, PI, exclude_min=True))
def test_an_angle_within_the_turn_keeps_every_bit(angle: float) -> None:
    assert float(se2.wrap(angle)).hex() == angle.hex()


def test_half_a_turn_is_plus_pi() -> None:
    assert se2.wrap([PI, -PI, 3 * PI, -5 * PI]).tolist() == [PI, PI, PI, PI]


@given(poses, poses)
def test_chaining_agrees_with_the_equations(a: FloatArray, b: FloatArray) -> None:
    assert same(se2.compose(a, b), np.array(naive.compose(list(a), list(b))), 1e-12)


@given(poses, poses, poses)
def test_poses_form_a_group(a: FloatArray, b: FloatArray, c: FloatArray) -> None:
    assert same(se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c)))
    assert same(se2.compose(a, se2.inverse(a)), np.zeros(3))
    assert same(se2.compose(se2.inverse(a), a), np.zeros(3))
    assert same(se2.compose(a, np.zeros(3)), a)


@given(poses, poses)
def test_between_leads_from_one_pose_to_the_other(a: FloatArray, b: FloatArray) -> None:
    assert same(se2.compose(a, se2.between(a, b)), b)


@given(st.tuples(metres, metres, st.floats(-3.1, 3.1)).map(np.array))
@example(np.array([1.0, 2.0, 0.0]))
@example(np.array([1.0, 2.0, 1e-12]))
def test_log_inverts_exp(twist: FloatArray) -> None:
    np.testing.assert_allclose(se2.log(se2.exp(twist)), twist, rtol=0, atol=1e-9)


@given(poses)
def test_exp_inverts_log(pose: FloatArray) -> None:
    assert same(se2.exp(se2.log(pose)), pose)


def test_a_quarter_circle_of_radius_one() -> None:
    np.testing.assert_allclose(se2.exp([PI / 2, 0.0, PI / 2]), [1.0, 1.0, PI / 2], atol=1e-15)


@given(poses, poses)
def test_interpolation_meets_both_ends(a: FloatArray, b: FloatArray) -> None:
    assert same(se2.interpolate(a, b, 0.0), a)
    assert same(se2.interpolate(a, b, 1.0), b)


@given(poses, st.tuples(metres, metres, st.floats(-3.0, 3.0)).map(np.array))
def test_interpolation_holds_one_twist(start: FloatArray, twist: FloatArray) -> None:
    end = se2.compose(start, se2.exp(twist))
    quarters = se2.interpolate(start, end, np.array([0.25, 0.5, 0.75]))
    assert quarters.shape == (3, 3)
    steps = se2.between(np.vstack([start, quarters]), np.vstack([quarters, end]))
    assert same(steps, np.broadcast_to(se2.exp(twist / 4), (4, 3)))


def test_arrays_of_poses_broadcast() -> None:
    many = np.arange(12.0).reshape(4, 3)
    moved = se2.compose(many, [1.0, 2.0, 0.5])
    assert moved.shape == (4, 3)
    assert same(moved[2], se2.compose(many[2], [1.0, 2.0, 0.5]))
