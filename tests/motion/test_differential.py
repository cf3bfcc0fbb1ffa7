"""The differential drive: exact without noise, and noise as its formula says."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mclcli.geometry import se2
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters, decompose
from tests.reference.filter import differential

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

PI = math.pi
ALPHAS = (0.1, 0.2, 0.05, 0.3)
MODEL = DifferentialMotion(DifferentialParameters(*ALPHAS, noise_scaling="step"))
QUIET = DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.0, 0.0))
metres, yaws = st.floats(-2.0, 2.0), st.floats(-PI, PI)
increments = st.tuples(metres, metres, yaws).map(np.array)
poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), yaws).map(np.array)

CASES = {
    "forward": [0.5, 0.1, 0.3],
    "backward": [-0.5, 0.05, -0.2],
    "straight back": [-0.4, 0.0, 0.0],
    "sideways": [0.0, 0.3, 0.0],
    "millimetres": [0.004, -0.006, 0.02],
    "millimetres back": [-0.006, 0.004, -0.1],
    "in place": [0.0, 0.0, 1.2],
    "half a turn": [0.0, 0.0, PI],
    "nothing": [0.0, 0.0, 0.0],
}
named = pytest.mark.parametrize("increment", [np.array(c) for c in CASES.values()], ids=CASES.keys())


@given(poses, increments)
@example(np.array([1.0, 2.0, 3.0]), np.array([-0.3, 0.0, 0.0]))
@example(np.array([1.0, 2.0, 3.0]), np.array([-1e-9, 1e-9, 0.1]))
@example(np.array([1.0, 2.0, 3.0]), np.array([-0.0, 0.0, 0.1]))
def test_without_noise_the_odometry_is_reproduced(pose: FloatArray, increment: FloatArray) -> None:
    normals = np.random.default_rng(1).standard_normal((1, 3))
    moved = QUIET.sample(pose[np.newaxis], increment, normals)[0]
    expected = se2.compose(pose, increment)
    np.testing.assert_allclose(moved[:2], expected[:2], rtol=0, atol=1e-12)
    assert abs(float(se2.wrap(moved[2] - expected[2]))) < 1e-12


@named
def test_without_motion_noise_follows_the_named_cases_too(increment: FloatArray) -> None:
    start = np.array([[0.3, -0.2, 2.9]])
    np.testing.assert_allclose(
        QUIET.sample(start, increment, np.ones((1, 3))), se2.compose(start, increment), atol=1e-12
    )


@given(poses, increments, st.tuples(*[st.floats(-3, 3)] * 3))
def test_a_sample_agrees_with_the_equation(pose: FloatArray, increment: FloatArray, normals: tuple[float, ...]) -> None:
    got = MODEL.sample(pose[np.newaxis], increment, np.array([normals]))[0]
    expected = differential(pose.tolist(), increment.tolist(), ALPHAS, normals)
    np.testing.assert_allclose(got[:2], expected[:2], rtol=0, atol=1e-9)
    assert abs(float(se2.wrap(got[2] - expected[2]))) < 1e-9


@named
def test_samples_spread_as_the_formula_says(increment: FloatArray) -> None:
    n = 40_000
    moved = MODEL.sample(np.zeros((n, 3)), increment, np.random.default_rng(4).standard_normal((n, 3)))
    std1, std_move, std2 = MODEL.noise_std(*decompose(increment))
    turned = se2.wrap(moved[:, 2] - increment[2])
    spread = math.hypot(std1, std2)
    if spread < 0.8:  # beyond, the turn wraps and its spread is no longer that of the line
        assert turned.std() == pytest.approx(spread, rel=0.03, abs=1e-12)
        assert turned.mean() == pytest.approx(0.0, abs=4.0 * spread / math.sqrt(n) + 1e-12)
    rot1, trans, _ = decompose(increment)
    along = moved[:, 0] * math.cos(rot1) + moved[:, 1] * math.sin(rot1)  # trans·cos(turning noise) on average
    assert along.mean() == pytest.approx(trans * math.exp(-(std1**2) / 2), abs=5.0 * (std_move + std1) / math.sqrt(n))
    mean_square = float(np.mean(moved[:, 0] ** 2 + moved[:, 1] ** 2))  # Var and mean of the distance driven
    assert mean_square == pytest.approx(trans**2 + std_move**2, rel=0.05, abs=1e-12)


def test_variances_of_one_move() -> None:
    rot1, trans, rot2 = math.atan2(0.3, 0.4), 0.5, 0.2
    expected = [0.1 * rot1**2 + 0.2 * 0.25, 0.05 * 0.25 + 0.3 * (rot1**2 + rot2**2), 0.1 * rot2**2 + 0.2 * 0.25]
    np.testing.assert_allclose(MODEL.noise_std(rot1, trans, rot2) ** 2, expected, rtol=1e-12)


def test_standing_still_adds_no_noise() -> None:
    np.testing.assert_array_equal(MODEL.noise_std(*decompose(np.zeros(3))), np.zeros(3))


@pytest.mark.parametrize("direction", [0.0, 1.0, 2.5, -3.0])
def test_below_a_centimetre_the_direction_of_the_move_makes_no_noise(direction: float) -> None:
    tiny = np.array([1e-4 * math.cos(direction), 1e-4 * math.sin(direction), 0.0])
    assert MODEL.noise_std(*decompose(tiny)).max() < 1e-4


def test_driving_backwards_is_as_certain_as_driving_forwards() -> None:
    ahead, back = (MODEL.noise_std(*decompose(np.array([d, 0.0, 0.0]))) for d in (0.5, -0.5))
    np.testing.assert_allclose(ahead, back, rtol=1e-12)


def test_driving_backwards_keeps_the_clouds_yaw_in_one_piece() -> None:
    cloud = np.zeros((5000, 3))
    normals = np.random.default_rng(9).standard_normal((20, 5000, 3))
    model = DifferentialMotion(DifferentialParameters(0.2, 0.01, 0.2, 0.01))
    for draw in normals:
        cloud = model.sample(cloud, np.array([-0.1, 0.002, 0.0]), draw)
    assert np.abs(cloud[:, 2]).max() < 1.0
    assert cloud[:, 0].mean() < -1.8


@given(increments, yaws)
def test_yaw_stays_within_the_turn(increment: FloatArray, yaw: float) -> None:
    normals = np.random.default_rng(2).standard_normal((50, 3)) * 5.0
    moved = MODEL.sample(np.tile([0.0, 0.0, yaw], (50, 1)), increment, normals)
    assert ((moved[:, 2] > -PI) & (moved[:, 2] <= PI)).all()


@given(increments)
@example(np.array([-0.2, 0.0, 0.0]))
def test_the_first_turn_is_at_most_a_quarter(increment: FloatArray) -> None:
    rot1, trans, rot2 = decompose(increment)
    assert abs(rot1) <= PI / 2 + 1e-12
    assert (trans < 0.0) == (increment[0] < 0.0 and trans != 0.0)
    assert -PI < rot2 <= PI


def test_noise_acts_in_the_frame_of_the_base() -> None:
    normals = np.random.default_rng(6).standard_normal((100, 3))
    start = np.array([3.0, -2.0, 1.1])
    at_origin = MODEL.sample(np.zeros((100, 3)), np.array([0.4, 0.1, 0.2]), normals)
    elsewhere = MODEL.sample(np.tile(start, (100, 1)), np.array([0.4, 0.1, 0.2]), normals)
    np.testing.assert_allclose(elsewhere, se2.compose(start, at_origin), rtol=0, atol=1e-12)


def test_the_particles_given_are_left_alone() -> None:
    given_poses = np.zeros((3, 3))
    MODEL.sample(given_poses, np.array([1.0, 0.0, 0.0]), np.ones((3, 3)))
    assert not given_poses.any()


def test_scaled_by_distance_the_noise_is_the_same_however_finely_a_move_is_cut() -> None:
    """Ten updates of 5 cm spread the particles like one of 50 cm; scaled by step they spread less."""
    spread = {}
    for scaling in ("distance", "step"):
        model = DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.2, 0.0, noise_scaling=scaling))
        for pieces in (1, 10):
            draws, moved = np.random.default_rng(6), np.zeros((20_000, 3))
            for _ in range(pieces):
                moved = model.sample(moved, np.array([0.5 / pieces, 0.0, 0.0]), draws.standard_normal(moved.shape))
            spread[scaling, pieces] = float(moved[:, 0].std())
    assert spread["distance", 10] == pytest.approx(spread["distance", 1], rel=0.03)
    assert spread["step", 10] == pytest.approx(spread["step", 1] / math.sqrt(10.0), rel=0.03)


def test_both_scalings_agree_at_the_default_gate() -> None:
    parameters = {s: DifferentialMotion(DifferentialParameters(*ALPHAS, noise_scaling=s)) for s in ("distance", "step")}
    for motion in ((0.0, 0.25, 0.2), (0.2, 0.25, 0.0)):
        by_distance, by_step = (model.noise_std(*motion) for model in parameters.values())
        np.testing.assert_allclose(by_distance, by_step, rtol=1e-12)
