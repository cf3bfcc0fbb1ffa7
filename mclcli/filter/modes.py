"""Places that a start has found, each kept alive until the readings have chosen one of them.

Resampling draws copies in proportion to weight, so the particles of a place that fits a little worse for a while are
soon gone. Here every place keeps some, whose weights say how probable it is: stratified sampling, with a place as a
stratum (Douc, Cappé, Moulines 2005, section 2.3, with strata of unequal sampling fractions).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.filter.resampling import Resampler
    from mclcli.native.backend import Backend

_CHOSEN = 0.99  # weight of one place from which on the others are in doubt
_WAY = 2.0  # [m] for which it has to keep that weight, or
_UPDATES = 10
_LEAST = 50  # particles of a place, where there are enough
_LOWEST = 1e-6  # weight below which a place is given up


@final
@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """The place ``labels`` (N,) of every particle, and for how long [m], updates one of them has nearly all weight."""

    labels: IntArray
    way: float = 0.0
    updates: int = 0

    @property
    def count(self) -> int:
        """How many places have particles."""
        return np.unique(self.labels).size

    def weighed(self, weights: FloatArray, increment: FloatArray) -> Modes | None:
        """These after an update, from the particles' weights (N,) and the motion (3,); None once one is chosen."""
        if np.bincount(self.labels, weights).max() < _CHOSEN:
            return dataclasses.replace(self, way=0.0, updates=0)
        way, updates = self.way + math.hypot(increment[0], increment[1]), self.updates + 1
        if way >= _WAY or updates >= _UPDATES or self.count == 1:
            return None
        return dataclasses.replace(self, way=way, updates=updates)

    def resample(
        self, weights: FloatArray, n: int, resampler: Resampler, draws: np.random.Generator, backend: Backend
    ) -> tuple[IntArray, FloatArray, Modes]:
        """Ancestors (n,) of each place in turn, their log-weights (n,), and their places; ``weights`` (N,) sum to 1."""
        total = np.bincount(self.labels, weights).astype(np.float64)
        counts = _allot(total, n)
        ancestors, log_weights = [], []
        for place in np.flatnonzero(counts).tolist():
            members = np.flatnonzero(self.labels == place)
            chosen = resampler(weights[members] / total[place], int(counts[place]), draws, backend)
            ancestors.append(members[chosen])
            log_weights.append(np.full(counts[place], math.log(total[place] / counts[place])))
        log_weight = np.concatenate(log_weights)
        kept = total[counts > 0].sum()
        labels = np.repeat(np.arange(counts.size), counts)
        return np.concatenate(ancestors), log_weight - math.log(kept), dataclasses.replace(self, labels=labels)


def _allot(total: FloatArray, n: int) -> IntArray:
    """Particles (M,) for places with these weights (M,): the least for each, the rest by weight; n in all."""
    alive = total > _LOWEST * total.max()
    places = int(np.count_nonzero(alive))
    least = _LEAST if 2 * places * _LEAST <= n else n // (2 * places)
    total = np.where(alive, total, 0.0)
    edges = np.round((n - least * places) * np.cumsum(total) / total.sum()).astype(np.int64)
    counts: IntArray = np.diff(edges, prepend=0) + least * alive
    return counts
