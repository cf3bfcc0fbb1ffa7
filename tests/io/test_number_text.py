"""Numbers as compiled code writes them against Python's own formatting."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.io.traces import trace_csv
from tests.support import BACKENDS

GENERATOR = np.random.default_rng(5)
fixed = st.one_of(st.floats(-1e7, 1e7), st.floats(-1e-8, 1e-8), st.integers(-(10**12), 10**12).map(lambda n: n / 2e9))
weights = st.one_of(st.floats(0.0, 1.0), st.integers(-300, 0).map(lambda e: 10.0**e), st.floats(0.0, 1e-4))


def by_both(block: np.ndarray) -> list[str]:
    return [trace_csv.rows_text("12,1700000000.000000001,", 995, block, backend) for backend in BACKENDS]


@given(rows=st.lists(st.tuples(fixed, fixed, weights), min_size=1, max_size=20))
def test_any_numbers_are_written_alike(rows: list[tuple[float, ...]]) -> None:
    text, compiled_text = by_both(np.array(rows))
    assert compiled_text == text


def test_many_numbers_are_written_alike() -> None:
    scales = 10.0 ** GENERATOR.uniform(-12, 6, 20_000)
    block = np.column_stack(
        [
            GENERATOR.normal(0, 1, 20_000) * scales,
            np.round(GENERATOR.normal(0, 5, 20_000), 3),
            10.0 ** GENERATOR.uniform(-250, 0, 20_000),
        ]
    )
    text, compiled_text = by_both(block)
    assert compiled_text == text


@pytest.mark.parametrize(
    "value", [0.0, -0.0, 1.0, 0.1, 1e-4, 9.9999999949e-5, 9.99999999951e-5, 0.99999999949, 0.9999999996, 5e-324, 1e-300]
)
def test_turning_points_of_weights(value: float) -> None:
    block = np.array([[1.5, value], [-0.0, abs(value)]])
    text, compiled_text = by_both(block)
    assert compiled_text == text


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 8e6, -1e300, 0.5e-9, 1.5e-9, -2.5e-9, 0.1234567895])
def test_turning_points_of_fixed_numbers(value: float) -> None:
    block = np.array([[1.25, value, 0.5], [value, -1.25, 0.25]])
    text, compiled_text = by_both(block)
    assert compiled_text == text
