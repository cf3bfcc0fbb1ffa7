"""Cosine and sine of our own against the library's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.geometry.trigonometry import cos_sin
from mclcli.native.backend import COMPILED


@given(st.floats(-1e6, 1e6))
def test_they_are_within_two_units_in_the_last_place(angle: float) -> None:
    c, s = (values[0] for values in cos_sin(np.array([angle])))
    assert abs(c - math.cos(angle)) <= 2 * math.ulp(math.cos(angle))
    assert abs(s - math.sin(angle)) <= 2 * math.ulp(math.sin(angle))


def test_compiled_code_gives_the_same_bits() -> None:
    angles = np.concatenate([np.random.default_rng(1).uniform(-1e6, 1e6, 10_000), np.arange(-40, 41) * math.pi / 8])
    for found, expected in zip(cos_sin(angles, COMPILED), cos_sin(angles), strict=True):
        assert found.tobytes() == expected.tobytes()


def test_for_a_yaw_they_are_within_one_unit() -> None:
    angles = np.random.default_rng(0).uniform(-7.0, 7.0, 100_000)
    for found, true in zip(cos_sin(angles), (np.cos(angles), np.sin(angles)), strict=True):
        assert (np.abs(found - true) <= np.spacing(np.abs(true))).all()


@pytest.mark.parametrize("quarters", range(-4, 5))
def test_right_angles_are_as_sharp_as_the_librarys(quarters: int) -> None:
    angle = quarters * math.pi / 2
    c, s = cos_sin(np.array([angle]))
    assert (c[0], s[0]) == (math.cos(angle), math.sin(angle))


def test_what_is_no_angle_has_no_cosine() -> None:
    with np.errstate(invalid="ignore"):
        assert all(np.isnan(values).all() for values in cos_sin(np.array([math.nan, math.inf, -math.inf])))
