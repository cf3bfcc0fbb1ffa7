"""Rigid transforms in space, with SciPy's rotations as an independent witness."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from mclcli.geometry import se3

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

components = st.floats(-1.0, 1.0)
angles = st.floats(-3.1, 3.1)
translations = st.tuples(*[st.floats(-50.0, 50.0)] * 3)
turns = st.tuples(angles, st.floats(-1.5, 1.5), angles)


def unit(quaternion: tuple[float, ...]) -> FloatArray:
    q = np.array(quaternion)
    assume(np.linalg.norm(q) > 0.1)
    return np.asarray(q / np.linalg.norm(q))


@given(translations, st.tuples(*[components] * 4))
def test_quaternions_turn_as_scipys_do(translation: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
    q = unit(quaternion)
    matrix = se3.from_quaternion(translation, q)
    assert se3.planar_from_quaternion(translation, q).tobytes() == se3.to_planar(matrix).tobytes()
    np.testing.assert_allclose(matrix[:3, :3], Rotation.from_quat(q).as_matrix(), atol=1e-12)
    assert matrix[:3, 3].tolist() == list(translation)
    assert matrix[3].tolist() == [0.0, 0.0, 0.0, 1.0]


@given(translations, turns)
def test_roll_pitch_yaw_are_about_fixed_axes(translation: tuple[float, ...], rpy: tuple[float, ...]) -> None:
    matrix = se3.from_rpy(translation, *rpy)
    np.testing.assert_allclose(matrix[:3, :3], Rotation.from_euler("xyz", rpy).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(se3.to_rpy(matrix), [*translation, *rpy], atol=1e-9)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_looking_straight_up_or_down_still_gives_the_same_transform(pitch: float) -> None:
    matrix = se3.from_rpy([1.0, 2.0, 3.0], 0.3, pitch, 1.1)
    x, y, z, roll, pitch_again, yaw = se3.to_rpy(matrix)
    np.testing.assert_allclose(se3.from_rpy([x, y, z], roll, pitch_again, yaw), matrix, atol=1e-9)


@given(translations, turns)
def test_inverse(translation: tuple[float, ...], rpy: tuple[float, ...]) -> None:
    matrix = se3.from_rpy(translation, *rpy)
    np.testing.assert_allclose(se3.inverse(matrix) @ matrix, np.eye(4), atol=1e-12)


@given(turns, turns, st.floats(0.0, 1.0))
def test_interpolation_turns_at_a_constant_rate(
    first: tuple[float, ...], last: tuple[float, ...], fraction: float
) -> None:
    a, b = se3.from_rpy([0, 0, 0], *first), se3.from_rpy([4, -2, 1], *last)
    pair = Rotation.from_matrix(np.stack([a[:3, :3], b[:3, :3]]))
    assume((pair[0].inv() * pair[1]).magnitude() < 3.1)
    got = se3.interpolate(a, b, fraction)
    np.testing.assert_allclose(got[:3, :3], Slerp([0.0, 1.0], pair)(fraction).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(got[:3, 3], fraction * np.array([4, -2, 1]), atol=1e-12)


@pytest.mark.parametrize("scale", [0.991, 1.009])
def test_a_nearly_unit_quaternion_is_normalised(scale: float) -> None:
    q = np.array([0.1, -0.2, 0.3, 0.9])
    q /= np.linalg.norm(q)
    np.testing.assert_allclose(se3.from_quaternion([0, 0, 0], scale * q), se3.from_quaternion([0, 0, 0], q), atol=1e-12)


@pytest.mark.parametrize(
    ("translation", "quaternion"),
    [
        ([0, 0, 0], [0, 0, 0, 0.98]),
        ([0, 0, 0], [0, 0, 0, 1.02]),
        ([0, 0, 0], [0, 0, 0, 0]),
        ([0, 0, 0], [0, 0, 0, math.nan]),
        ([0, math.inf, 0], [0, 0, 0, 1]),
    ],
)
def test_what_is_no_rigid_transform_is_refused(translation: list[float], quaternion: list[float]) -> None:
    with pytest.raises(ValueError, match="not a rigid transform"):
        se3.from_quaternion(translation, quaternion)
    with pytest.raises(ValueError, match="not a rigid transform"):
        se3.planar_from_quaternion(translation, quaternion)


def test_planar_poses_survive_the_way_through_space() -> None:
    pose = np.array([1.5, -2.5, -3.0])
    np.testing.assert_allclose(se3.to_planar(se3.from_planar(pose)), pose, atol=1e-12)


def test_the_heading_of_an_upside_down_sensor_is_where_its_x_axis_points() -> None:
    upside_down = se3.from_rpy([0.1, 0.2, 0.3], math.pi, 0.0, 0.7)
    np.testing.assert_allclose(se3.to_planar(upside_down), [0.1, 0.2, 0.7], atol=1e-12)
