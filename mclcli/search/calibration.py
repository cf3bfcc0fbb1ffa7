"""From the figures of a search to the probability that its best place is right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, final


@final
@dataclass(frozen=True, slots=True)
class Figures:
    """What a search says of its own answer.

    ``log_odds`` of the best place against all others, "not on this map" and what is around none of them, after the beam
    model has looked; ``log_odds_field`` the same before it. ``misfit`` and ``misfit_rays`` [nats a beam]: how far below
    a perfect fit the best pose is, by the field and by the beam model.
    """

    log_odds: float
    log_odds_field: float
    misfit: float
    misfit_rays: float

    @property
    def agreed(self) -> float:
        """The odds that both models grant."""
        return min(self.log_odds, self.log_odds_field)

    @property
    def strain(self) -> float:
        """``misfit_rays``, limited by ``misfit``.

        Beams that have no return where the map has a wall do not by themselves mean that the robot is elsewhere.
        """
        return min(self.misfit_rays, 0.3 + 4.0 * self.misfit)

    @property
    def passed(self) -> float:
        """Misfit that only walls on the way explain: of beams that end well, but would have passed through a wall."""
        return self.misfit_rays - 3.0 * self.misfit


@final
@dataclass(frozen=True, slots=True)
class Term:
    """What a figure adds to the log odds: ``weight`` times the figure, clipped to ``low`` … ``high``."""

    figure: Literal["log_odds", "agreed", "passed", "strain"]
    low: float
    high: float
    weight: float


# Fitted by
#   python -m benchmarks.locate_worlds -o worlds.csv && python -m benchmarks.locate_calibration worlds.csv
# on the layouts with even seeds; docs/locate.md shows how it does on the others, and on real logs.
CONSTANT = 4.171
TERMS = (
    Term("log_odds", -2.0, 4.0, 0.247),
    Term("log_odds", 4.0, 30.0, 0.081),
    Term("agreed", -4.0, 2.0, 0.515),
    Term("agreed", 2.0, 12.0, 0.245),
    Term("passed", -1.0, 0.0, -4.334),
    Term("passed", 0.3, 1.0, -4.434),
    Term("strain", 0.5, 1.0, -4.576),
    Term("strain", 1.0, 5.0, -1.267),
)
LEAST, MOST = 0.0005, 0.9995  # a fit on some thousands of cases cannot tell certainty


def logit(figures: Figures) -> float:
    """Log odds that the best place is right, by the fit."""
    total = CONSTANT
    for term in TERMS:
        total += term.weight * min(max(getattr(figures, term.figure), term.low), term.high)
    return total


def probability(figures: Figures) -> float:
    """Probability that the best place is right, (0, 1); monotone in every figure."""
    return min(max(1.0 / (1.0 + math.exp(-logit(figures))), LEAST), MOST)
