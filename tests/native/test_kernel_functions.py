"""Functions that kernels inline, against the library's, and against the same in NumPy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast

import numba as nb
import numpy as np
import pytest
from scipy import special

from mclcli.geometry import exponential, trigonometry
from mclcli.kernels._exponential import _exp2
from mclcli.kernels._exponential import _log as _log_of_twins
from mclcli.kernels._fused import _erfc, _exp, _log
from mclcli.kernels.trigonometry import _unsigned_angle

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray

GENERATOR = np.random.default_rng(8)
SIZES = 10.0 ** GENERATOR.uniform(-280, 280, 20_000)


def each(function: Any, count: int = 1) -> Callable[..., FloatArray]:
    """The function of arrays, compiled as kernels are."""
    signature = nb.float64(*(nb.float64,) * count)
    one = (lambda x: function(x)) if count == 1 else (lambda x, y: function(x, y))  # noqa: PLW0108 - numba needs one
    vectorize: Any = nb.vectorize
    return cast("Callable[..., FloatArray]", vectorize([signature])(nb.njit(one)))


@pytest.fixture(scope="module")
def exp() -> Callable[..., FloatArray]:
    return each(_exp)


@pytest.fixture(scope="module")
def log() -> Callable[..., FloatArray]:
    return each(_log)


@pytest.fixture(scope="module")
def erfc() -> Callable[..., FloatArray]:
    return each(_erfc)


@pytest.fixture(scope="module")
def exp2() -> Callable[..., FloatArray]:
    return each(_exp2)


@pytest.fixture(scope="module")
def log_of_twins() -> Callable[..., FloatArray]:
    return each(_log_of_twins)


@pytest.fixture(scope="module")
def angle() -> Callable[..., FloatArray]:
    return each(_unsigned_angle, 2)


def test_exponentials_are_within_two_units_in_the_last_place(exp: Callable[..., FloatArray]) -> None:
    x = np.concatenate([GENERATOR.uniform(-700.0, 0.0, 20_000), -SIZES[SIZES < 700.0], [0.0]])
    assert (np.abs(exp(x) - np.exp(x)) <= 2 * np.spacing(np.exp(x))).all()
    assert exp(np.array([0.0, -1e300]))[0] == 1.0
    assert 0.0 <= exp(np.array([-1e300]))[0] < 1e-300


def test_logarithms_are_within_two_units_in_the_last_place(log: Callable[..., FloatArray]) -> None:
    x = np.concatenate([SIZES, GENERATOR.uniform(0.5, 2.0, 20_000), 1.0 + GENERATOR.normal(0, 1e-9, 1000)])
    assert (np.abs(log(x) - np.log(x)) <= 2 * np.spacing(np.abs(np.log(x)))).all()
    assert log(np.array([1.0])).tolist() == [0.0]
    assert np.isnan(log(np.array([math.nan]))).all()
    assert log(np.array([math.inf])).tolist() == [math.inf]


ODD = np.array([0.0, -0.0, 5e-324, -5e-324, -1e300, -1010.0, -1009.5, -0.5, math.nan, -math.inf])


@np.errstate(invalid="ignore")  # what is no number is compared with some
def test_powers_of_two_are_within_two_units_and_numpys_to_the_bit(exp2: Callable[..., FloatArray]) -> None:
    x = np.concatenate([GENERATOR.uniform(-1000.0, 0.0, 20_000), -SIZES[SIZES < 1000.0], np.arange(-1009.0, 1.0)])
    assert (np.abs(exp2(x) - np.exp2(x)) <= 2 * np.spacing(np.exp2(x))).all()
    assert exp2(np.array([0.0, -3.0])).tolist() == [1.0, 0.125]
    assert 0.0 < exp2(np.array([-math.inf]))[0] < 1e-300
    same_bits(exponential.exp2(np.concatenate([x, ODD])), exp2(np.concatenate([x, ODD])))


@np.errstate(invalid="ignore")
def test_logarithms_of_the_twins_are_within_two_units_and_alike_to_the_bit(
    log_of_twins: Callable[..., FloatArray],
) -> None:
    x = np.concatenate([SIZES, GENERATOR.uniform(0.5, 2.0, 20_000), 1.0 + GENERATOR.normal(0, 1e-9, 1000)])
    assert (np.abs(log_of_twins(x) - np.log(x)) <= 2 * np.spacing(np.abs(np.log(x)))).all()
    odd = np.array([1.0, math.nan, math.inf, 1e-300, 1e300])
    assert log_of_twins(odd)[:3].tolist()[::2] == [0.0, math.inf]
    same_bits(exponential.log(np.concatenate([x, odd])), log_of_twins(np.concatenate([x, odd])))


def same_bits(one: FloatArray, other: FloatArray) -> None:
    """Equal to the bit but for the payload of what is no number."""
    assert (np.isnan(one) == np.isnan(other)).all()
    assert one[~np.isnan(one)].tobytes() == other[~np.isnan(other)].tobytes()


def test_angles_are_numpys_to_the_bit(angle: Callable[..., FloatArray]) -> None:
    along, across = (GENERATOR.choice([-1.0, 1.0], SIZES.size) * GENERATOR.permutation(SIZES) for _ in range(2))
    odd = np.array([0.0, -0.0, 1.0, -1.0, 1e-320, -1e308])
    pairs = np.array(np.meshgrid(odd, odd)).reshape(2, -1)
    along, across = np.concatenate([along, pairs[0]]), np.concatenate([across, pairs[1]])
    with np.errstate(invalid="ignore", over="ignore"):  # 0/0, and what is too large
        same_bits(trigonometry.unsigned_angle(along, across), angle(along, across))


def test_the_error_function_is_right_to_fifteen_decimals(erfc: Callable[..., FloatArray]) -> None:
    x = np.concatenate([np.linspace(0.0, 10.0, 100_001), SIZES])
    assert np.abs(erfc(x) - special.erfc(x)).max() <= 6e-16


def test_angles_are_within_a_few_roundings_of_a_turn(angle: Callable[..., FloatArray]) -> None:
    true = GENERATOR.uniform(-math.pi, math.pi, 20_000)
    along, across = SIZES * np.cos(true), SIZES * np.sin(true)
    assert np.abs(angle(along, across) - np.abs(np.arctan2(across, along))).max() <= 6e-16
    small = angle(np.ones(SIZES.size), SIZES)
    assert np.abs(small - np.arctan(SIZES)).max() <= 3e-16


@pytest.mark.parametrize("eighths", range(9))
def test_angles_of_the_axes_are_right(angle: Callable[..., FloatArray], eighths: int) -> None:
    true = eighths * math.pi / 8
    assert abs(angle(np.array([math.cos(true)]), np.array([-math.sin(true)]))[0] - true) <= 4e-16
