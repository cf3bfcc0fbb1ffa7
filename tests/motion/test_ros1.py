"""Noise of the four motion models of ROS 1's amcl: against the formula, and against numbers worked out by hand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.motion.differential import DifferentialMotion, DifferentialParameters, decompose
from mclcli.motion.omnidirectional import OmnidirectionalMotion, OmnidirectionalParameters
from tests.reference import motion_ros1

if TYPE_CHECKING:
    from mclcli.motion.noise import Expression

ALPHAS = (0.1, 0.25, 0.3, 0.45, 0.6)
metres = st.one_of(st.just(0.0), st.floats(-2.0, 2.0))
increments = st.tuples(metres, metres, st.floats(-math.pi, math.pi))


def of_diff(increment: tuple[float, ...], expression: Expression) -> list[float]:
    """Standard deviations of first turn, move and second turn."""
    parameters = DifferentialParameters(*ALPHAS[:4], "folded", "step", expression)
    std: list[float] = DifferentialMotion(parameters).noise_std(*decompose(np.array(increment))).tolist()
    return std


def of_omni(increment: tuple[float, ...], expression: Expression) -> list[float]:
    """Standard deviations along the move, in yaw and across the move."""
    std: list[float] = (
        OmnidirectionalMotion(OmnidirectionalParameters(*ALPHAS, "step", expression)).noise_std(np.array(increment))
    ).tolist()
    return std


@given(increments)
def test_every_model_agrees_with_the_formula(increment: tuple[float, float, float]) -> None:
    for ours, theirs in (
        (of_diff(increment, "deviation"), motion_ros1.diff),
        (of_diff(increment, "variance"), motion_ros1.diff_corrected),
        (of_omni(increment, "deviation"), motion_ros1.omni),
        (of_omni(increment, "variance"), motion_ros1.omni_corrected),
    ):
        np.testing.assert_allclose(ours, theirs(increment, ALPHAS), rtol=1e-7, atol=1e-12)


# d = 0.5 m ahead, then a turn of 0.2 rad: d² = 0.25, φ² = 0.04.
@pytest.mark.parametrize(
    ("found", "sums"),
    [
        (of_diff((0.5, 0.0, 0.2), "deviation"), [0.0625, 0.075 + 0.018, 0.004 + 0.0625]),
        (of_omni((0.5, 0.0, 0.2), "deviation"), [0.075 + 0.004, 0.018 + 0.0625, 0.004 + 0.15]),
        (np.square(of_diff((0.5, 0.0, 0.2), "variance")), [0.0625, 0.075 + 0.018, 0.004 + 0.0625]),
        (np.square(of_omni((0.5, 0.0, 0.2), "variance")), [0.075 + 0.018, 0.004 + 0.0625, 0.018 + 0.15]),
    ],
    ids=["diff", "omni", "diff-corrected", "omni-corrected"],
)
def test_numbers_worked_out_by_hand(found: list[float], sums: list[float]) -> None:
    np.testing.assert_allclose(found, sums, rtol=1e-12)
