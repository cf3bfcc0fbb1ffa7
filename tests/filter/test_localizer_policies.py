"""When the filter resamples, to how many particles, and whose mean it states."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli import rng
from mclcli.filter.kld import KldParameters, limit
from mclcli.filter.localizer import Localizer, initial_state
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.recovery import Averages, Proposed, RecoveryParameters
from mclcli.filter.rivals import Rivals
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.sensors import Measurement
from tests.reference import kld as naive

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.filter.parameters import Degenerate
    from mclcli.records import StepRecord

QUIET = DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.0, 0.0))
STILL = np.zeros(3)
N = 40


def steps(increments: list[FloatArray], poses: FloatArray, size: KldParameters, **parameters: Any) -> list[StepRecord]:
    """Steps with a sensor that likes the first particle's place."""
    localizer = Localizer(QUIET, FilterParameters(**parameters), 0, size)
    state, records = initial_state(poses), []
    for stamp, increment in enumerate(increments):
        liked = Measurement("lidar", lambda p: -np.abs(p[:, 0] - poses[0, 0]) * 30.0, 1, 0.0)
        state, record = localizer.step(state, increment, [liked], stamp)
        records.append(record)
    return records


def spread(n: int = N) -> FloatArray:
    return np.column_stack([np.linspace(0.0, 3.0, n), np.zeros(n), np.zeros(n)])


@pytest.mark.parametrize("interval", [1, 2, 3, 7])
def test_resampling_waits_for_its_turn(interval: int) -> None:
    records = steps([STILL] * 9, spread(), KldParameters(N, N), resample_interval=interval, resample_ess=1.0)
    assert [record.resampled for record in records] == [(i + 1) % interval == 0 for i in range(9)]


def test_policies_compose() -> None:
    """Even where it is a step's turn, weights must have become uneven."""
    same = np.zeros((N, 3))
    records = steps([STILL] * 6, same, KldParameters(N, N), resample_interval=2, resample_ess=0.5)
    assert not any(record.resampled for record in records)
    records = steps([STILL] * 6, same, KldParameters(N, N), resample_interval=2, resample_ess=1.0)
    assert [record.resampled for record in records] == [False, True] * 3


def test_resampling_may_wait_for_the_way_since_the_last_time() -> None:
    moves = [STILL, np.array([0.06, 0, 0]), np.array([-0.06, 0, 0]), STILL, np.array([0.0, 0.0, -0.11])]
    records = steps(moves, spread(), KldParameters(N, N), resample_moved=True, resample_ess=1.0)
    assert [record.resampled for record in records] == [False, False, True, False, True]


def test_kld_sampling_draws_as_many_particles_as_the_belief_has_bins() -> None:
    size = KldParameters(20, 3000, pf_err=0.05)
    rng = np.random.default_rng(3)
    wide = np.column_stack([rng.uniform(0, 10, (3000, 2)), np.zeros(3000)])
    records = steps([STILL] * 3, wide, size, resample_ess=1.0)
    first, last = len(records[0].weights), len(records[-1].weights)
    bins = len({naive.bin_of(pose) for pose in records[-1].poses})
    assert first == 3000
    assert last < 1000
    assert last >= limit(bins, size) * 0.9
    assert last < limit(bins + 3, size)


def test_a_fixed_number_stays_whatever_the_belief() -> None:
    records = steps([STILL] * 3, spread(), KldParameters(N, N), resample_ess=1.0)
    assert [len(record.weights) for record in records] == [N] * 3


def two_heaps() -> FloatArray:
    """60 particles around (0, 0), which the sensor likes as much as 40 around (0, 9)."""
    near = np.random.default_rng(4).normal(0.0, 0.02, (100, 3))
    near[60:, 1] += 9.0
    near[:, 0] = 0.0
    return near


@pytest.mark.parametrize("estimate", ["before", "after"])
def test_whose_mean_and_whose_covariance(estimate: str) -> None:
    def reported(mean: str, covariance: str) -> tuple[float, float]:
        options = {"estimate_mean": mean, "estimate_covariance": covariance, "estimate": estimate}
        options["covariance"] = "sample"
        belief = steps([STILL], two_heaps(), KldParameters(100, 100), resample_ess=1.0, **options)[0].estimate
        return float(belief.pose[1]), math.sqrt(belief.covariance[1, 1])

    assert reported("set", "set") == pytest.approx((3.6, math.sqrt(0.24) * 9), abs=0.05)
    assert reported("heaviest", "set") == pytest.approx((0.0, math.sqrt(0.24) * 9), abs=0.05)
    assert reported("heaviest", "heaviest") == pytest.approx((0.0, 0.02), abs=0.01)
    assert reported("heaviest_if_apart", "set") == pytest.approx((0.0, math.sqrt(0.4) * 9), abs=0.05)
    assert reported("heaviest_if_apart", "heaviest") == pytest.approx((0.0, 0.02), abs=0.01)


def test_a_set_in_one_place_is_averaged_whole() -> None:
    """Though some of its particles are a cluster of their own."""
    poses = np.random.default_rng(4).normal(0.0, 0.02, (100, 3))
    poses[:4, 0] += 1.5
    whole, some = (
        steps([STILL], poses, KldParameters(100, 100), estimate_mean=mean)[0].estimate
        for mean in ("set", "heaviest_if_apart")
    )
    np.testing.assert_array_equal(whole.pose, some.pose)
    np.testing.assert_array_equal(whole.covariance, some.covariance)


@pytest.mark.parametrize(("choice", "expected"), [("carry", [0.75, 0.25]), ("uniform", [0.5, 0.5])])
def test_what_remains_where_no_weight_is_left(choice: Degenerate, expected: list[float]) -> None:
    localizer = Localizer(QUIET, FilterParameters(resample_ess=0.0, degenerate=choice), 0, KldParameters(2, 2))
    liked = Measurement("lidar", lambda _: np.log([0.75, 0.25]), 1, 0.0)
    nothing = Measurement("lidar", lambda _: np.full(2, -np.inf), 1, 0.0)
    state, _ = localizer.step(initial_state(np.zeros((2, 3))), STILL, [liked], 0)
    _, record = localizer.step(state, STILL, [nothing], 1)
    assert record.degenerate
    np.testing.assert_allclose(record.weights, expected, rtol=1e-12)


def test_every_draw_is_of_the_seed_the_step_and_a_purpose_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, rng.Purpose, int]] = []
    stream = rng.stream

    def noting(seed: int, purpose: rng.Purpose, step: int) -> np.random.Generator:
        asked.append((seed, purpose, step))
        return stream(seed, purpose, step)

    monkeypatch.setattr(rng, "stream", noting)
    localizer = Localizer(QUIET, FilterParameters(), 77, KldParameters(20, 200), RecoveryParameters("uniform"))
    rivals = Rivals(np.zeros((1, 3)), np.array([9]), np.zeros(1))
    start = dataclasses.replace(initial_state(spread(200), step=5), averages=Averages(0.0, -2.0), rivals=rivals)
    poor = Measurement("lidar", lambda p: np.where(p[:, 0] == 0.0, 0.0, -2.0), 1, 0.0, log_floor=-4.0)
    localizer.step(start, STILL, [poor], 0, propose=lambda _, n, __: Proposed.blindly(np.zeros((n, 3))))
    purpose = rng.Purpose
    drawn = [purpose.MOTION, purpose.RIVALS, purpose.LOT, purpose.RECOVERY, purpose.KLD, purpose.RESAMPLE]
    assert asked == [(77, name, 5) for name in drawn]
