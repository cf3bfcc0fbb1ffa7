"""Several tracks of the same drive, of several seeds say, as one answer: median, mean, and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import rng

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.evaluate.evaluation import Evaluation

    Getter = Callable[[Evaluation], float | None]

_RESAMPLES = 2000

# name: (unit, what it is of one evaluation; None where it has no such number)
FIGURES: dict[str, tuple[str, Getter]] = {
    "ape_rmse": ("m", lambda e: e.translation.rmse),
    "ape_mean": ("m", lambda e: e.translation.mean),
    "ape_median": ("m", lambda e: e.translation.median),
    "ape_max": ("m", lambda e: e.translation.max),
    "yaw_rmse": ("rad", lambda e: e.yaw.rmse),
    "yaw_max": ("rad", lambda e: e.yaw.max),
    "rpe_per_metre_rmse": ("m/m", lambda e: e.rpe_metre.rmse if e.rpe_metre else None),
    "rpe_per_second_rmse": ("m/s", lambda e: e.rpe_second.rmse if e.rpe_second else None),
    "within_0.05": ("", lambda e: e.within[0.05]),
    "within_0.1": ("", lambda e: e.within[0.1]),
    "within_0.2": ("", lambda e: e.within[0.2]),
    "within_0.5": ("", lambda e: e.within[0.5]),
    "converged_after": ("s", lambda e: e.converged_after),
    "losses": ("", lambda e: float(len(e.losses))),
    "recoveries": ("", lambda e: float(e.recoveries)),
    "lost_seconds": ("s", lambda e: e.lost_seconds),
    "anees": ("", lambda e: e.consistency.anees if e.consistency else None),
    "median_nees": ("", lambda e: e.consistency.median_nees if e.consistency else None),
    "ellipse": ("", lambda e: e.consistency.ellipse if e.consistency else None),
    "ellipse_xy": ("", lambda e: e.consistency.ellipse_xy if e.consistency else None),
    "coverage": ("", lambda e: e.coverage),
}


@final
@dataclass(frozen=True, slots=True)
class Spread:
    """A figure over the ``count`` tracks that have it.

    ``median_band`` and ``mean_band``: 5th and 95th percentile of the bootstrap's medians and means.
    """

    median: float
    median_band: tuple[float, float]
    mean: float
    mean_band: tuple[float, float]
    min: float
    max: float
    count: int


def spread(values: Sequence[float], seed: int = 0) -> Spread | None:
    """Median and mean with their bootstrap bands; None of no value.

    Percentile bootstrap over whole tracks (Efron and Tibshirani 1993, chapter 13), 2,000 resamples, seeded: the same
    values give the same bands.
    """
    found = np.array(values, dtype=np.float64)
    if not found.size:
        return None
    draws = rng.stream(seed, rng.Purpose.BOOTSTRAP)
    resampled = found[draws.integers(0, found.size, (_RESAMPLES, found.size))]
    return Spread(
        median=float(np.median(found)),
        median_band=_band(np.median(resampled, axis=1)),
        mean=float(found.mean()),
        mean_band=_band(resampled.mean(axis=1)),
        min=float(found.min()),
        max=float(found.max()),
        count=found.size,
    )


def spreads(evaluations: Sequence[Evaluation], seed: int = 0) -> dict[str, Spread]:
    """Spread of every figure of ``FIGURES`` that some track has, over the tracks that have it."""
    result: dict[str, Spread] = {}
    for name, (_, figure) in FIGURES.items():
        values = [value for e in evaluations if (value := figure(e)) is not None]
        found = spread(values, seed)
        if found is not None:
            result[name] = found
    return result


def _band(values: FloatArray) -> tuple[float, float]:
    low, high = np.percentile(values, [5.0, 95.0]).tolist()
    return low, high
