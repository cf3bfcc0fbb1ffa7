"""The covariance of the estimate's error, where the likelihood is not how readings are distributed."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.filter import sandwich
from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import Localizer, initial_state
from mclcli.filter.parameters import CovarianceOf, FilterParameters
from mclcli.filter.sandwich import FLOOR, Moments
from mclcli.geometry import se2
from mclcli.geometry.symmetric import Symmetric
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.sensors import Measurement
from tests.filter.test_localizer_policies import QUIET, STILL

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.records import StepRecord

BEAMS = 90
ANGLES = np.linspace(0.0, 2.0 * math.pi, BEAMS, endpoint=False)
STATED = 0.2  # [m] of a beam, whatever its noise is
# d(range) / d(x, y, yaw) of the robot, in its axes: walls all around, the lidar half a metre ahead
DESIGN = np.stack([np.cos(ANGLES), np.sin(ANGLES), 0.5 * np.sin(3.0 * ANGLES)], axis=1)


def beams(errors: FloatArray, about: FloatArray, poses: FloatArray) -> FloatArray:
    """Log p (N, B) of beams that were wrong by ``errors`` (B,), for a robot that is at ``about`` (3,)."""
    off = se2.between(about, poses)
    return np.asarray(-0.5 * ((errors - off @ DESIGN.T) / STATED) ** 2)


def reading(errors: FloatArray, about: FloatArray, sweep: float = 0.0) -> Measurement:
    each = functools.partial(beams, errors, about)
    return Measurement(
        "lidar", lambda poses: each(poses).sum(axis=1), BEAMS, 0.0, 1.0, each, log_floor=-1e9, sweep=sweep
    )


def noise(draws: np.random.Generator, sigma: float, together: int) -> FloatArray:
    """Errors (B,) of beams of which so many neighbours err alike."""
    return np.repeat(draws.normal(0.0, sigma, BEAMS // together), together)


def kalman(seed: int, sigma: float, together: int, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Errors (T, 3) of a Kalman filter that believes in STATED, and the covariances (T, 3, 3) stated of them."""
    draws, information = np.random.default_rng(seed), DESIGN.T @ DESIGN / STATED**2
    belief, error, last = np.diag([0.1, 0.1, 0.05]) ** 2, draws.normal(0.0, [0.1, 0.1, 0.05]), None
    errors, covariances = [], []
    for step in range(60):
        before = belief + np.diag(motion)
        error = error + draws.normal(0.0, np.sqrt(motion))
        belief = np.linalg.inv(np.linalg.inv(before) + information)
        wrong = noise(draws, sigma, together)
        error = error + belief @ DESIGN.T @ (wrong - DESIGN @ error) / STATED**2
        # at the estimate the robot seems to be off by what is wrong with it
        moments = Moments(step, np.zeros(3), Symmetric.of(before), Symmetric.of(belief), 0.0)
        last = sandwich.update(last, moments, [reading(wrong - DESIGN @ error, np.zeros(3))])
        assert last is not None
        errors.append(error)
        covariances.append(last.covariance.matrix())
    return np.array(errors[20:]), np.array(covariances[20:])


@pytest.mark.parametrize(("sigma", "together"), [(0.2, 1), (0.05, 1), (0.05, 3), (0.2, 3)])
def test_errors_are_as_large_as_stated_whatever_the_likelihood_believes(sigma: float, together: int) -> None:
    """ANEES/3 of a filter whose variance is a third to sixteen times the truth: without correction 0.06 to 3."""
    motion = np.square([0.03, 0.03, 0.01])
    values = []
    for seed in range(12):
        errors, covariances = kalman(seed, sigma, together, motion)
        values.append(np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors).mean() / 3.0)
    assert 0.6 < np.mean(values) < 1.7


def test_what_the_reading_says_nothing_of_is_as_uncertain_as_odometry_leaves_it() -> None:
    """Beams that see nothing along x: the error there is that of the motion alone, whatever c is."""
    flat = Measurement(
        "lidar",
        lambda poses: np.zeros(len(poses)),
        BEAMS,
        0.0,
        1.0,
        lambda poses: -0.5 * ((0.01 * np.sin(7.0 * ANGLES) - poses[:, 1:2] * np.sin(ANGLES)) / STATED) ** 2,
    )
    before = Symmetric(0.04, 0.0, 0.0, 0.04, 0.0, 0.01)
    after = Symmetric(0.04, 0.0, 0.0, 0.0004, 0.0, 0.01)
    found = sandwich.update(None, Moments(0, np.zeros(3), before, after, 0.0), [flat])
    assert found is not None
    assert found.covariance.xx == pytest.approx(0.04, rel=1e-3)
    assert found.covariance.yy < 0.0002


FAR = Measurement("lidar", lambda at: np.zeros(len(at)), BEAMS, 0.0)  # says nothing of where the robot is


def run(covariance: CovarianceOf, poses: FloatArray, sweep: float = 0.0, *, blind: bool = False) -> list[StepRecord]:
    """Two updates of a robot that moves 0.5 m in half a second; it may see nothing."""
    localizer = Localizer(QUIET, FilterParameters(covariance=covariance), 0, KldParameters(len(poses), len(poses)))
    state, records = initial_state(poses), []
    draws = np.random.default_rng(3)
    for step, increment in enumerate([STILL, np.array([0.5, 0.0, 0.0])]):
        seen = reading(noise(draws, 0.02, 1), np.array([0.5 * step, 0.0, 0.0]), sweep)
        measurement = FAR if blind else seen
        state, record = localizer.step(state, increment, [measurement], step * 5 * 10**8)
        records.append(record)
    return records


def cloud(n: int, spread: float = 0.1) -> FloatArray:
    return np.random.default_rng(1).normal(0.0, [spread, spread, 0.3 * spread], (n, 3))


def test_poses_and_weights_are_not_touched() -> None:
    for own, corrected in zip(run("sample", cloud(400)), run("sandwich", cloud(400)), strict=True):
        np.testing.assert_array_equal(own.estimate.pose, corrected.estimate.pose)
        np.testing.assert_array_equal(own.weights, corrected.weights)
        assert np.trace(corrected.estimate.covariance) < np.trace(own.estimate.covariance)


ON_ONE_LINE = np.repeat([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0]], 25, axis=0)


@pytest.mark.parametrize("poses", [np.zeros((50, 3)), np.zeros((1, 3)), ON_ONE_LINE], ids=["one place", "one", "apart"])
def test_nothing_stated_is_below_the_floor(poses: FloatArray) -> None:
    """Particles that are all at one place, or a single one, or two places of no width, whatever a reading says."""
    for record in [*run("sandwich", poses), *run("sandwich", poses, blind=True)]:
        assert (np.linalg.eigvalsh(record.estimate.covariance - np.diag(np.square(FLOOR))) >= -1e-15).all()


def test_a_weight_that_is_all_on_one_particle_makes_nothing_certain() -> None:
    """Three particles, one of which takes it all: as uncertain as before the reading, at least."""
    poses = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [-0.3, 0.0, -0.1]])
    first, _ = run("sandwich", poses)
    assert first.ess < 1.01
    assert math.sqrt(first.estimate.covariance[0, 0]) > 0.2


@pytest.mark.parametrize("seed", range(200))
def test_few_particles_whatever_their_shape_state_a_covariance(seed: int) -> None:
    """In a point, a line, a plane or anywhere, from picometres to decimetres wide, for readings dull to sharp."""
    draws = np.random.default_rng(seed)
    n, along = int(draws.choice([2, 3, 4, 6, 30])), draws.normal(size=3)
    shape = [np.zeros((n, 3)), draws.normal(size=(n, 1)) * along, draws.normal(size=(n, 3))][seed % 3]
    poses = shape * [1.0, 1.0, 0.3] * 10.0 ** draws.uniform(-12.0, -0.6) + [draws.normal(0.0, 1e3), -70.0, 3.0]
    noise_of = DifferentialParameters(*[10.0 ** draws.uniform(-8.0, 0.0)] * 4)
    localizer = Localizer(DifferentialMotion(noise_of), FilterParameters(), seed, KldParameters(n, n))
    sharpness, state = 10.0 ** draws.uniform(-6.0, 8.0), initial_state(poses)

    def each(at: FloatArray) -> FloatArray:
        off = (at - poses.mean(axis=0)) @ DESIGN.T
        return np.asarray(-0.5 * sharpness * off**2)

    seen = Measurement("lidar", lambda at: np.asarray(each(at).sum(axis=1)), BEAMS, 0.0, 1.0, each, log_floor=-1e9)
    for step in range(4):
        state, record = localizer.step(state, draws.normal(size=3) * 0.1, [seen], step * 10**8)
        own = record.estimate.covariance
        least = np.linalg.eigvalsh(own - np.diag(np.square(FLOOR)))[0]
        assert least >= -1e-9 * np.trace(own)


def test_places_apart_keep_the_distance_between_them() -> None:
    poses = cloud(400)
    poses[200:, 0] += 30.0
    own, same = (
        Localizer(QUIET, FilterParameters(covariance=covariance), 0, KldParameters(400, 400)).step(
            initial_state(poses), STILL, [FAR], 0
        )[1]
        for covariance in ("sample", "sandwich")
    )
    np.testing.assert_array_equal(own.estimate.covariance + np.diag(np.square(FLOOR)), same.estimate.covariance)
    assert own.estimate.covariance[0, 0] > 200.0


def test_a_sweep_is_half_a_way_of_doubt() -> None:
    """0.5 m in 0.5 s, beams within 0.1 s: 5 cm ahead, and nothing across."""
    quick, slow = (run("sandwich", cloud(400), sweep=sweep)[1].estimate for sweep in (0.0, 0.1))
    added = slow.covariance - quick.covariance
    c, s = math.cos(slow.pose[2]), math.sin(slow.pose[2])
    np.testing.assert_allclose(added[:2, :2], 0.0025 * np.array([[c * c, c * s], [c * s, s * s]]), atol=1e-12)
    endless = run("sandwich", cloud(400), sweep=1e300)[1].estimate.covariance - quick.covariance
    assert endless[0, 0] == pytest.approx(0.0625, rel=0.05)
