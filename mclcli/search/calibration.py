"""From the figures of a search to the probability that its best place is right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Figures:
    """What a search says of its own answer.

    ``log_odds`` of the best place against all others, "not on this map" and what is around none of them, after the beam
    model has looked; ``log_odds_field`` the same before it. ``misfit`` and ``misfit_rays`` [nats a beam]: how far below
    a perfect fit the best pose is, by the field and by the beam model. ``log_beams`` of the effective number of beams.
    """

    log_odds: float
    log_odds_field: float
    misfit: float
    misfit_rays: float
    log_beams: float

    @property
    def strain(self) -> float:
        """``misfit_rays``, as far as the field agrees: no returns where the map has walls are not yet another place."""
        return min(self.misfit_rays, 0.3 + 4.0 * self.misfit)


@final
@dataclass(frozen=True, slots=True)
class Term:
    """What a figure adds to the log odds: ``weight`` times the figure, clipped to ``low`` … ``high``."""

    figure: str
    low: float
    high: float
    weight: float


# Fitted by
#   python -m benchmarks.locate_worlds --layouts 0:8 -o worlds.csv && python -m benchmarks.locate_calibration worlds.csv
# on the layouts with even seeds; docs/locate.md shows how it does on the others, and on real logs.
CONSTANT = 0.467
TERMS = (
    Term("log_odds", -5.0, 12.0, 0.28),
    Term("strain", 0.0, 3.0, -1.539),
)
LEAST, MOST = 0.0005, 0.9995  # a fit on some hundreds of cases cannot tell certainty


def logit(figures: Figures) -> float:
    """Log odds that the best place is right, by the fit."""
    total = CONSTANT
    for term in TERMS:
        total += term.weight * min(max(getattr(figures, term.figure), term.low), term.high)
    return total


def probability(figures: Figures) -> float:
    """Probability that the best place is right, (0, 1); monotone in every figure."""
    return min(max(1.0 / (1.0 + math.exp(-logit(figures))), LEAST), MOST)
