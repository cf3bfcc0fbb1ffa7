"""The omnidirectional drive: exact without noise, and noise as its formula says."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mclcli.geometry import se2
from mclcli.motion.omnidirectional import OmnidirectionalMotion, OmnidirectionalParameters
from tests.reference.motion_omni import omnidirectional

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.motion.noise import Scaling

PI = math.pi
ALPHAS = (0.1, 0.25, 0.3, 0.45, 0.6)
MODEL = OmnidirectionalMotion(OmnidirectionalParameters(*ALPHAS, noise_scaling="step"))
QUIET = OmnidirectionalMotion(OmnidirectionalParameters(0.0, 0.0, 0.0, 0.0, 0.0))
metres, yaws = st.floats(-2.0, 2.0), st.floats(-PI, PI)
increments = st.tuples(metres, metres, yaws).map(np.array)
poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), yaws).map(np.array)


@given(poses, increments)
@example(np.array([1.0, 2.0, 3.0]), np.array([-0.006, 0.0, 0.0]))
def test_without_noise_the_odometry_is_reproduced_exactly(pose: FloatArray, increment: FloatArray) -> None:
    normals = np.random.default_rng(1).standard_normal((1, 3))
    moved = QUIET.sample(pose[np.newaxis], increment, normals)
    np.testing.assert_array_equal(moved[0], se2.compose(pose, increment))


@given(poses, increments, st.tuples(*[st.floats(-3, 3)] * 3))
def test_a_sample_agrees_with_the_equation(pose: FloatArray, increment: FloatArray, normals: tuple[float, ...]) -> None:
    got = MODEL.sample(pose[np.newaxis], increment, np.array([normals]))[0]
    expected = omnidirectional(pose.tolist(), increment.tolist(), ALPHAS, normals)
    np.testing.assert_allclose(got[:2], expected[:2], rtol=0, atol=1e-9)
    assert abs(float(se2.wrap(got[2] - expected[2]))) < 1e-9


@pytest.mark.parametrize(
    "increment", [[0.5, 0.1, 0.3], [-0.4, 0.0, -0.2], [0.0, 0.3, 0.0], [-0.003, 0.004, 0.1], [0.0, 0.0, 0.8], [0, 0, 0]]
)
def test_samples_spread_as_the_formula_says(increment: list[float]) -> None:
    n, step = 40_000, np.array(increment, dtype=np.float64)
    moved = MODEL.sample(np.zeros((n, 3)), step, np.random.default_rng(4).standard_normal((n, 3))) - step
    distance, turn = math.hypot(step[0], step[1]), abs(step[2])
    bearing = math.atan2(step[1], step[0])
    c, s = math.cos(bearing), math.sin(bearing)
    spread = np.stack([c * moved[:, 0] + s * moved[:, 1], moved[:, 2], s * moved[:, 0] - c * moved[:, 1]])
    expected = [
        0.3 * distance**2 + 0.45 * turn**2,
        0.1 * turn**2 + 0.25 * distance**2,
        0.6 * distance**2 + 0.45 * turn**2,
    ]
    np.testing.assert_allclose(np.cov(spread), np.diag(expected), rtol=0.05, atol=0.02 * max(expected))
    np.testing.assert_allclose(spread.mean(axis=1), 0.0, atol=4.5 * math.sqrt(max(expected) / n))


def test_variances_of_one_move() -> None:
    found = MODEL.noise_std(np.array([0.3, -0.4, 0.2])) ** 2
    np.testing.assert_allclose(found, [0.075 + 0.018, 0.004 + 0.0625, 0.15 + 0.018], rtol=1e-12)


def test_driving_backwards_keeps_the_clouds_yaw_in_one_piece() -> None:
    cloud = np.zeros((5000, 3))
    model = OmnidirectionalMotion(OmnidirectionalParameters(0.2, 0.01, 0.2, 0.01, 0.2))
    for draw in np.random.default_rng(9).standard_normal((20, 5000, 3)):
        cloud = model.sample(cloud, np.array([-0.1, 0.002, 0.0]), draw)
    assert np.abs(cloud[:, 2]).max() < 1.0
    assert cloud[:, 0].mean() < -1.8


def test_every_direction_of_driving_is_as_certain() -> None:
    angles = np.linspace(-PI, PI, 17)
    found = [MODEL.noise_std(np.array([0.4 * math.cos(a), 0.4 * math.sin(a), 0.1])) for a in angles]
    np.testing.assert_allclose(found, np.broadcast_to(found[0], (17, 3)), rtol=1e-12)


def test_scaled_by_distance_the_noise_is_the_same_however_finely_a_move_is_cut() -> None:
    ratios: dict[Scaling, float] = {"distance": 1.0, "step": 10.0}
    for scaling, ratio in ratios.items():
        model = OmnidirectionalMotion(OmnidirectionalParameters(*ALPHAS, noise_scaling=scaling))
        whole, tenth = (model.noise_std(np.array([0.3, 0.4, 0.2]) / pieces) ** 2 for pieces in (1, 10))
        np.testing.assert_allclose(whole, 10.0 * tenth * ratio, rtol=1e-12)
