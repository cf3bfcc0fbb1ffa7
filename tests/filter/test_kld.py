"""KLD sampling against its formula, and against visiting one particle after the other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mclcli.errors import UsageError
from mclcli.filter import kld
from mclcli.filter.kld import KldParameters
from tests.reference import kld as naive

if TYPE_CHECKING:
    from mclcli.arrays import IntArray

errors, probabilities = st.floats(0.005, 0.5), st.floats(0.01, 0.999)


class InOrder:
    """A generator that leaves everything where it is."""

    def permutation(self, n: int) -> IntArray:
        return np.arange(n)


@given(st.integers(0, 100_000), errors, probabilities)
@example(2, 0.05, 1e-4)  # the bracket is negative
def test_the_number_is_foxs(k: int, err: float, probability: float) -> None:
    z = naive.quantile(probability)
    exact = naive.required(k, err, z)
    found = float(kld.required(k, err, z))
    assert exact - 1e-9 * exact <= found < exact * (1 + 1e-9) + 1.0
    assert found == int(found)


@pytest.mark.parametrize("probability", [0.001, 0.05, 0.5, 0.9, 0.99, 0.9999])
def test_the_quantile_of_a_probability(probability: float) -> None:
    found = KldParameters(pf_z=probability).z
    assert found == pytest.approx(naive.quantile(probability), rel=1e-9, abs=1e-12)


def test_a_worked_example() -> None:
    # 1 − 2/81 + sqrt(2/81)·2.3263479 = 1.3408639; cubed, times 9/0.1: 216.97 for 10 bins at 99 %
    assert KldParameters().z == pytest.approx(2.3263478740408408, rel=1e-12)
    assert kld.required(10, 0.05, 2.3263478740408408) == 217.0


@given(errors, probabilities, st.sampled_from([0, 1, 2]))
def test_from_two_bins_on_more_bins_never_need_fewer_particles(err: float, probability: float, unlimited: int) -> None:
    parameters = KldParameters(1, 10**9, err, max(probability, 0.5), kld_unlimited_bins=unlimited)
    assert (np.diff(kld.limit(np.arange(unlimited + 1, 3000), parameters)) >= 0).all()


@given(errors, st.integers(2, 5000))
def test_more_certainty_and_less_error_need_more_particles(err: float, k: int) -> None:
    assert kld.required(k, err, 2.0) >= kld.required(k, err, 1.0)
    assert kld.required(k, err / 2.0, 1.0) >= kld.required(k, err, 1.0)


def test_sizes_stay_between_the_smallest_and_the_largest() -> None:
    limits = kld.limit(np.arange(1000), KldParameters(300, 700))
    assert limits.min() == limits[0] == limits[1] == 300
    assert limits.max() == limits[-1] == 700


@pytest.mark.parametrize(
    ("unlimited", "expected"),
    [(0, [100, 100, 100, 134]), (1, [5000, 5000, 100, 134]), (2, [5000, 5000, 5000, 134])],
)
def test_few_bins_mean_the_least_or_the_most(unlimited: int, expected: list[int]) -> None:
    parameters = KldParameters(100, 5000, 0.01, 0.99, "z", unlimited)
    found: list[int] = kld.limit(np.array([0, 1, 2, 5]), parameters).tolist()
    assert found[:3] == expected[:3]
    assert found[3] == math.ceil(naive.required(5, 0.01, 0.99)) > 100


@given(
    st.lists(st.tuples(*[st.floats(-4.0, 4.0)] * 2, st.floats(-9.0, 9.0)), min_size=1, max_size=120),
    st.integers(1, 20),
    errors,
)
def test_the_size_is_that_of_visiting_one_after_the_other(
    poses: list[tuple[float, float, float]], least: int, err: float
) -> None:
    parameters = KldParameters(least, 200, err)

    def limit(k: int) -> int:
        return int(min(max(math.ceil(naive.required(k, err, parameters.z)), least), 200))

    found = kld.kld_size(np.array(poses), parameters, InOrder())  # type: ignore[arg-type]
    assert found == naive.enough(poses, limit)


def test_the_order_of_the_visit_is_drawn() -> None:
    wide = np.random.default_rng(3).uniform(-20.0, 20.0, (1000, 3))
    drawn = np.concatenate([np.zeros((1000, 3)), wide])  # ancestors come sorted: visited so, the first all look alike
    sizes = [kld.kld_size(drawn, KldParameters(50), np.random.default_rng(seed)) for seed in (0, 1, 2, 0)]
    assert kld.kld_size(drawn, KldParameters(50), InOrder()) == 50  # type: ignore[arg-type]
    assert min(sizes) > 500
    assert sizes[0] == sizes[3]


def test_one_heap_needs_the_least_and_a_wide_cloud_everything() -> None:
    heap = np.random.default_rng(1).normal([0.25, 0.25, 0.09], 0.01, (2000, 3))
    wide = np.random.default_rng(2).uniform(-50.0, 50.0, (2000, 3))
    assert kld.kld_size(heap, KldParameters(500, 2000), np.random.default_rng(0)) == 500
    assert kld.kld_size(wide, KldParameters(), np.random.default_rng(0)) == 2000


def test_fewer_particles_than_wanted_are_all_kept() -> None:
    assert kld.kld_size(np.zeros((3, 3)), KldParameters(), np.random.default_rng(0)) == 3


def test_far_from_the_origin_the_size_is_the_same() -> None:
    drawn = np.random.default_rng(4).normal(0.1, [0.4, 0.4, 0.1], (2000, 3))
    places = (drawn + np.array([far, -far, 0.0]) for far in (0.0, 5e6, -5e6))
    sizes = {kld.kld_size(there, KldParameters(50), np.random.default_rng(0)) for there in places}
    assert len(sizes) == 1
    assert 50 < min(sizes) < 2000


@given(st.floats(-math.pi, math.pi), st.integers(-3, 3))
def test_bins_know_no_whole_turns(yaw: float, turns: int) -> None:
    place = yaw / kld.BIN_YAW
    if abs(place - round(place)) > 1e-9:  # on an edge, the rounding of a whole turn may fall to either side
        here, there = kld.bins(np.array([[1.2, -3.4, yaw], [1.2, -3.4, yaw + turns * math.tau]]))
        assert here.tolist() == there.tolist()
        assert here[:2].tolist() == [2, -7]


def test_the_half_turn_has_one_bin_from_either_side() -> None:
    yaws = np.array([math.pi, -math.pi, np.nextafter(math.pi, 0.0) - 1e-9, -math.pi + 1e-9])
    poses = np.stack([np.zeros(4), np.zeros(4), yaws], axis=-1)
    assert kld.bins(poses)[:, 2].tolist() == [-18, -18, 17, -18]
    assert kld.bins(poses, wrap_yaw=False)[:, 2].tolist() == [18, -18, 17, -18]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"min_particles": 900, "max_particles": 800}, "min_particles = 900: must be at most max_particles = 800"),
        ({"pf_z": 2.33}, "pf_z = 2.33: must be a probability below 1; where it is meant as a quantile"),
        ({"pf_z": 0.0}, "pf_z = 0.0: must be greater than 0"),
        ({"pf_err": 0.0}, "pf_err = 0.0: must be greater than 0"),
        ({"kld_unlimited_bins": 3}, "must be at most 2"),
    ],
)
def test_what_makes_no_sense_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        KldParameters(**values)


def test_a_quantile_may_be_beyond_one() -> None:
    assert KldParameters(pf_z=3.0, kld_quantile="z").z == 3.0
