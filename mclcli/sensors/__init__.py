"""Observation likelihoods p(z | x, m): a file a model, all in log domain.

A model is built once for a map; what it says of one observation is a ``Measurement``, which is all the filter knows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, final

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray

# What new log-likelihoods are multiplied with: a number in (0, 1], or how it is measured; see ``filter.temperature``.
Temperature = float | Literal["auto", "ess"]


@final
@dataclass(frozen=True, slots=True)
class Measurement:
    """One observation, ready to score poses of the base in map at the update's stamp.

    ``log_likelihood`` maps poses (N, 3) to log p(z | x) (N,), untempered; ``count`` beams or sightings are in it, each
    at most ``log_peak``/``count`` high on average, so that ``log_peak`` is the log p of a perfect fit; ``log_floor`` is
    that of a reading that has nothing to do with the map.
    ``alpha`` in (0, 1], ``auto`` or ``ess``, is the temperature that its logarithm is multiplied with. ``each`` gives
    log p (N, count) of every beam or sighting at poses (N, 3), neighbours next to each other; None where that means
    nothing. ``sweep`` [s] passed while the beams were measured that count as measured at one moment. ``unknown`` of the
    sightings name no landmark of the map. ``check`` is the same reading by a model that can tell how well it fits,
    where this one cannot.
    """

    sensor: str
    log_likelihood: Callable[[FloatArray], FloatArray]
    count: int
    log_peak: float
    log_floor: float = field(default=-math.inf, kw_only=True)
    alpha: Temperature = 1.0
    each: Callable[[FloatArray], FloatArray] | None = None
    unknown: int = 0
    check: Measurement | None = None
    sweep: float = 0.0


def floored_log(p: FloatArray, floor: float) -> FloatArray:
    """log max(p, floor): keeps one impossible reading from ruling out a pose."""
    import numpy as np  # here, so that the names of the models cost nothing

    return np.log(np.maximum(p, floor))
