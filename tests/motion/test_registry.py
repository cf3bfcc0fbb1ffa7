"""What every motion model keeps, and how one is chosen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli import motion
from mclcli.errors import UsageError
from mclcli.geometry import se2
from mclcli.motion import MODELS, MotionParameters
from mclcli.native.backend import NUMPY
from mclcli.parameters import described

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.motion import MotionModel

each = pytest.mark.parametrize("name", MODELS)
STEPS = [[0.3, 0.02, 0.1], [-0.3, 0.01, 0.05], [0.0, 0.2, 0.0], [-0.004, 0.001, 0.3], [0.0, 0.0, -3.0], [0.0, 0.0, 0.0]]
every_step = pytest.mark.parametrize("step", [np.array(step) for step in STEPS], ids=str)


def model_of(name: str) -> MotionModel:
    """A model with its default noise."""
    return motion.build(MotionParameters(robot_model_type=name))


def quiet(name: str) -> MotionModel:
    """A model with all its noise turned off."""
    noise = [field for field, default, _ in described(MODELS[name].parameters) if isinstance(default, float)]
    changes: dict[str, Any] = dict.fromkeys(noise, 0.0)
    return motion.build(MotionParameters(robot_model_type=name, **changes))


def cloud(n: int, seed: int = 1) -> FloatArray:
    """Poses anywhere, looking anywhere."""
    return np.random.default_rng(seed).uniform([-5, -5, -math.pi], [5, 5, math.pi], (n, 3))


def normals(n: int, seed: int = 2) -> FloatArray:
    """Standard normals (n, 3)."""
    return np.random.default_rng(seed).standard_normal((n, 3))


@each
@every_step
@pytest.mark.parametrize("n", [1, 200])
def test_poses_stay_poses(name: str, step: FloatArray, n: int) -> None:
    before = cloud(n)
    given_poses = before.copy()
    moved = model_of(name).sample(given_poses, step, 4.0 * normals(n))
    np.testing.assert_array_equal(given_poses, before)
    assert moved.shape == (n, 3)
    assert moved.dtype == np.float64
    assert np.isfinite(moved).all()
    assert ((moved[:, 2] > -math.pi) & (moved[:, 2] <= math.pi)).all()


@each
@every_step
def test_without_noise_a_robot_goes_where_the_odometry_says_or_stands(name: str, step: FloatArray) -> None:
    start = cloud(20)
    moved = quiet(name).sample(start, step, normals(20))
    error = moved - (start if name == "stationary" else se2.compose(start, step))
    np.testing.assert_allclose(error[:, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(se2.wrap(error[:, 2]), 0.0, atol=1e-12)


@each
@every_step
def test_noise_acts_in_the_frame_of_the_base(name: str, step: FloatArray) -> None:
    start = np.array([3.0, -2.0, 1.1])
    at_origin, elsewhere = (
        model_of(name).sample(np.tile(pose, (50, 1)), step, normals(50)) for pose in (np.zeros(3), start)
    )
    expected = se2.compose(start, at_origin)
    np.testing.assert_allclose(elsewhere[:, :2], expected[:, :2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(se2.wrap(elsewhere[:, 2] - expected[:, 2]), 0.0, atol=1e-12)


@each
@every_step
def test_each_particle_moves_by_its_own_normals_alone(name: str, step: FloatArray) -> None:
    start, draws = cloud(30), normals(30)
    together = model_of(name).sample(start, step, draws)
    alone = [model_of(name).sample(start[i : i + 1], step, draws[i : i + 1])[0] for i in range(30)]
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-14)


@each
def test_noise_scatters_particles_around_the_motion(name: str) -> None:
    step = np.array([0.3, 0.0, 0.1])
    moved = model_of(name).sample(np.zeros((5000, 3)), step, normals(5000))
    assert (moved.std(axis=0) > 0.01).all()
    np.testing.assert_allclose(moved.mean(axis=0), np.zeros(3) if name == "stationary" else step, atol=0.02)


def test_a_robot_that_stands_shakes_by_two_centimetres_and_two_hundredths_of_a_radian() -> None:
    moved = model_of("stationary").sample(np.zeros((20_000, 3)), np.array([5.0, 1.0, 2.0]), normals(20_000))
    np.testing.assert_allclose(moved.std(axis=0), [0.02, 0.02, 0.02], rtol=0.03)
    np.testing.assert_allclose(moved.mean(axis=0), 0.0, atol=0.001)


@each
def test_the_parameters_of_all_hold_those_of_each(name: str) -> None:
    everything = {field: (default, d.unit, d.low) for field, default, d in described(MotionParameters)}
    for field, default, description in described(MODELS[name].parameters):
        assert everything[field] == (default, description.unit, description.low)


def test_a_model_gets_its_own_values() -> None:
    for name, entry in MODELS.items():
        assert isinstance(model_of(name), type(entry.make(entry.parameters(), NUMPY)))
    alphas = {f"alpha{i}": i / 10 for i in range(1, 6)}
    chosen = MotionParameters(robot_model_type="omnidirectional", **alphas)  # type: ignore[arg-type]
    built: Any = motion.build(chosen)
    assert {name: getattr(built.parameters, name) for name in alphas} == alphas


def test_an_unknown_model_or_value_is_refused() -> None:
    with pytest.raises(UsageError, match="robot_model_type = tracked: must be one of differential, omnidirectional"):
        MotionParameters(robot_model_type="tracked")
    with pytest.raises(UsageError, match=r"alpha5 = -1\.0: must be at least 0"):
        MotionParameters(alpha5=-1.0)
