"""Functions that kernels inline, against the library's."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast

import numba as nb
import numpy as np
import pytest
from scipy import special

from mclcli.kernels._exponential import _erfc, _exp, _log
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
