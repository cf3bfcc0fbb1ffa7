"""One step of the filter: propagate, score, temper, normalise, estimate, resample."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli import rng
from mclcli.filter import weights
from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import FilterState, Localizer, initial_state
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.resampling import RESAMPLERS
from mclcli.filter.sandwich import FLOOR
from mclcli.filter.weights import uniform_log_weights
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.rng import Purpose, stream
from mclcli.sensors import Measurement

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.arrays import FloatArray

    Poses = FloatArray

AHEAD = np.array([0.3, 0.0, 0.1])
STILL = np.zeros(3)
N = 50


def localizer(seed: int = 0, resample_ess: float = 0.5, resampler: str = "systematic") -> Localizer:
    motion = DifferentialMotion(DifferentialParameters())
    parameters = FilterParameters(resample_ess=resample_ess, resampler=resampler, estimate_mean="set")
    return Localizer(motion, parameters, seed, KldParameters(N, N))


def around_zero(n: int = N) -> FilterState:
    return initial_state(np.random.default_rng(21).normal(0.0, 0.5, (n, 3)))


def sensor(log_p: Callable[[Poses], Poses], alpha: float = 1.0, name: str = "lidar", count: int = 4) -> Measurement:
    return Measurement(name, log_p, count, 0.0, alpha)


def near_one(poses: Poses) -> Poses:
    """A sensor that likes x = 1."""
    return -((poses[:, 0] - 1.0) ** 2) / 0.02


def saying(values: Sequence[float]) -> Measurement:
    return sensor(lambda _: np.array(values))


def test_a_record_holds_every_weight() -> None:
    state, first = localizer().step(around_zero(), AHEAD, [sensor(near_one, 0.5)], 17, 3)
    assert (first.step, first.stamp_ns, first.segment, state.step) == (0, 17, 3, 1)
    assert first.sensors == ("lidar",)
    assert first.alphas == (0.5,)
    assert first.beams_used == 4
    np.testing.assert_array_equal(first.log_likelihoods, [near_one(first.poses)])
    np.testing.assert_allclose(first.log_weights, -math.log(N) + 0.5 * near_one(first.poses), rtol=0, atol=1e-12)
    expected = np.exp(first.log_weights - first.log_weights.max())
    np.testing.assert_allclose(first.weights, expected / expected.sum(), rtol=1e-12)
    assert first.ess == pytest.approx(1.0 / np.sum(first.weights**2))


@given(seed=st.integers(0, 99), alpha=st.floats(0.01, 1.0), resampler=st.sampled_from(list(RESAMPLERS)))
def test_weights_sum_to_one_after_every_step(seed: int, alpha: float, resampler: str) -> None:
    state, filtered = around_zero(), localizer(seed, 0.5, resampler)
    for stamp in range(3):
        state, record = filtered.step(state, AHEAD, [sensor(near_one, alpha)], stamp)
        assert abs(math.fsum(record.weights.tolist()) - 1.0) <= 1e-12
        assert abs(math.fsum(np.exp(state.log_weights).tolist()) - 1.0) <= 1e-12


def test_evidence_is_the_untempered_mean_likelihood() -> None:
    _, record = localizer().step(around_zero(), AHEAD, [sensor(near_one, 0.1)], 0)
    assert record.log_evidence == pytest.approx(math.log(np.mean(np.exp(near_one(record.poses)))))


def test_evidence_of_several_sensors_is_that_of_their_product() -> None:
    carried, logs = np.log([0.25, 0.75]), np.log([[0.5, 0.2], [0.1, 0.4]])
    together, each = weights.evidences(carried, logs)
    assert np.exp(each) == pytest.approx([0.275, 0.325])
    assert np.exp(together) == pytest.approx(0.25 * 0.05 + 0.75 * 0.08)


def test_temperature_leaves_the_carried_weight_alone() -> None:
    carried = np.log([0.7, 0.2, 0.1])
    state = FilterState(5, np.zeros((3, 3)), carried)
    measurement = Measurement("lidar", lambda _: np.array([0.0, -2.0, -4.0]), 1, 0.0, 0.25)
    _, record = localizer(resample_ess=0.0).step(state, STILL, [measurement], 0)
    np.testing.assert_allclose(record.log_weights, np.add(carried, [0.0, -0.5, -1.0]), rtol=0, atol=1e-12)


def test_between_resamplings_weights_are_carried() -> None:
    filtered, state = localizer(resample_ess=0.0), around_zero()
    expected = uniform_log_weights(N)
    for stamp in range(3):
        state, record = filtered.step(state, STILL, [sensor(near_one)], stamp)
        assert not record.resampled
        expected = expected + near_one(record.poses)
        np.testing.assert_allclose(state.log_weights - state.log_weights[0], expected - expected[0], rtol=0, atol=1e-9)
        np.testing.assert_array_equal(state.poses, record.poses)


def test_resampling_makes_all_weights_equal_again() -> None:
    state, record = localizer().step(around_zero(), AHEAD, [sensor(near_one)], 0)
    assert record.resampled
    assert record.ess < 0.5 * N
    assert state.log_weights.tolist() == [-math.log(N)] * N
    originals = {pose.tobytes() for pose in record.poses}
    assert {pose.tobytes() for pose in state.poses} < originals
    assert near_one(state.poses).mean() > near_one(record.poses).mean()


def test_the_estimate_is_made_before_resampling() -> None:
    _, record = localizer().step(around_zero(), AHEAD, [sensor(near_one)], 0)
    np.testing.assert_allclose(record.estimate.pose[:2], record.weights @ record.poses[:, :2], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "values",
    [[math.nan, 0.0, -1.0], [math.inf, 0.0, -1.0], [-math.inf] * 3, [math.nan] * 3],
    ids=["a NaN", "an infinity", "nothing possible", "only NaN"],
)
def test_a_degenerate_measurement_is_flagged_and_ignored(values: list[float]) -> None:
    carried = np.log([0.5, 0.3, 0.2])
    state = FilterState(0, np.eye(3), carried)
    after, record = localizer().step(state, STILL, [saying(values)], 0)
    assert record.degenerate
    np.testing.assert_allclose(record.weights, [0.5, 0.3, 0.2], rtol=1e-12)
    np.testing.assert_allclose(after.log_weights, carried, rtol=0, atol=1e-12)
    assert np.isfinite(record.estimate.pose).all()
    assert np.isfinite(record.estimate.covariance).all()
    assert record.reliability == 0.0


def test_one_impossible_particle_just_weighs_nothing() -> None:
    state = FilterState(0, np.eye(3), np.log([0.5, 0.25, 0.25]))
    after, record = localizer(resample_ess=0.0).step(state, STILL, [saying([-math.inf, 0.0, 0.0])], 0)
    assert not record.degenerate
    np.testing.assert_allclose(record.weights, [0.0, 0.5, 0.5], rtol=0, atol=1e-15)
    again, record = localizer(resample_ess=0.0).step(after, STILL, [saying([5.0, 0.0, 0.0])], 1)
    assert not record.degenerate
    assert record.weights[0] == 0.0
    assert np.exp(again.log_weights).sum() == pytest.approx(1.0, abs=1e-12)


def test_the_same_seed_gives_the_same_bytes() -> None:
    def track(seed: int) -> bytes:
        state, out = around_zero(), b""
        for stamp in range(4):
            state, record = localizer(seed).step(state, AHEAD, [sensor(near_one)], stamp)
            out += record.poses.tobytes() + record.weights.tobytes()
        return out

    assert track(3) == track(3)
    assert track(3) != track(4)


def test_another_sensor_does_not_shift_the_random_numbers() -> None:
    indifferent = sensor(lambda poses: np.zeros(len(poses)), name="vision")
    alone, joined = around_zero(), around_zero()
    for stamp in range(3):
        alone, first = localizer().step(alone, AHEAD, [sensor(near_one)], stamp)
        joined, second = localizer().step(joined, AHEAD, [sensor(near_one), indifferent], stamp)
        assert first.poses.tobytes() == second.poses.tobytes()
        assert first.weights.tobytes() == second.weights.tobytes()
    assert alone.poses.tobytes() == joined.poses.tobytes()


def test_a_resampled_step_does_not_shift_the_next_steps_motion() -> None:
    kept, _ = localizer(resample_ess=0.0).step(initial_state(np.zeros((N, 3))), STILL, [sensor(near_one)], 0)
    drawn, record = localizer(resample_ess=1.0).step(
        initial_state(np.zeros((N, 3))), STILL, [saying([0.0] * 49 + [1.0])], 0
    )
    assert record.resampled
    moved = [localizer().step(state, AHEAD, [], 1)[1].poses for state in (kept, drawn)]
    assert moved[0].tobytes() == moved[1].tobytes()


def test_motion_and_resampling_draw_from_streams_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[int, Purpose, int]] = []

    def opening(seed: int, purpose: Purpose, step: int = 0) -> np.random.Generator:
        opened.append((seed, purpose, step))
        return stream(seed, purpose, step)

    monkeypatch.setattr(rng, "stream", opening)
    localizer(seed=9).step(FilterState(4, np.zeros((N, 3)), uniform_log_weights(N)), AHEAD, [sensor(near_one)], 0)
    assert opened == [(9, Purpose.MOTION, 4), (9, Purpose.RESAMPLE, 4)]


def test_each_step_draws_its_own_noise() -> None:
    state = initial_state(np.zeros((N, 3)))
    second = FilterState(1, state.poses, state.log_weights)
    first_poses, second_poses = (localizer().step(s, AHEAD, [], 0)[1].poses for s in (state, second))
    assert not np.isclose(first_poses, second_poses).all(axis=1).any()


def test_a_step_changes_nothing_it_was_given() -> None:
    state = around_zero()
    before = state.poses.tobytes(), state.log_weights.tobytes()
    localizer().step(state, AHEAD, [sensor(near_one)], 0)
    assert (state.poses.tobytes(), state.log_weights.tobytes()) == before


def test_a_perfect_fit_is_reliable_and_a_bad_one_is_not() -> None:
    state = initial_state(np.zeros((4, 3)))
    said = {log_p: replace(saying([log_p] * 4), log_floor=-10.0) for log_p in (0.0, -8.0, -11.0)}
    fits = {log_p: localizer().step(state, STILL, [each], 0)[1].reliability for log_p, each in said.items()}
    assert fits == pytest.approx({0.0: 1.0, -8.0: 0.2, -11.0: 0.0})


def test_without_any_measurement_only_the_motion_counts() -> None:
    _, record = localizer().step(around_zero(), AHEAD, [], 0)
    assert not record.degenerate
    assert record.log_likelihoods.shape == (0, N)
    np.testing.assert_allclose(record.weights, np.full(N, 1 / N), rtol=1e-12)


def test_one_particle_is_enough() -> None:
    state, record = localizer().step(initial_state(np.zeros((1, 3))), AHEAD, [sensor(near_one)], 0)
    assert record.weights.tolist() == [1.0]
    assert record.ess == 1.0
    np.testing.assert_array_equal(record.estimate.covariance, np.diag(np.square(FLOOR)))
    assert state.log_weights.tolist() == [0.0]


def test_a_run_begins_with_its_first_segment() -> None:
    assert localizer().step(around_zero(), AHEAD, [sensor(near_one)], 17)[1].segment == 0
