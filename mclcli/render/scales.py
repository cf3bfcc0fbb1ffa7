"""Round numbers for axes, bars and lines: 1, 2 or 5 times a power of ten."""

from __future__ import annotations

import math

import numpy as np


def round_up(value: float) -> float:
    """Smallest 1-2-5 number that is at least ``value`` > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(m * decade for m in (1.0, 2.0, 5.0, 10.0) if m * decade >= value * (1.0 - 1e-9))


def round_down(value: float) -> float:
    """Largest 1-2-5 number that is at most ``value`` > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(m * decade for m in (10.0, 5.0, 2.0, 1.0) if m * decade <= value * (1.0 + 1e-9))


def ticks(low: float, high: float, step: float) -> list[float]:
    """Multiples of ``step`` from low to high, both included."""
    first, last = math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6)
    return [float(i * step) for i in range(first, last + 1)]


def label(value: float, step: float) -> str:
    """Text of a multiple of ``step`` with no more decimals than the step has."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def span_of(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> tuple[float, float]:
    """Least and greatest of the finite values; (0, 1) if there are none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
