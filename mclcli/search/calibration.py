"""Constants of the posterior over places, fitted on simulated buildings; docs/locate.md says how well they hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Law:
    """``ends`` and ``rays``: what the measured temperatures of the field and of the beam model are multiplied by.

    ``rates``: shares of the beams of a scan that may end anywhere; each is ``changed`` nats less probable than the one
    before where places are compared. Where the question is whether the robot is on this map at all, ``beams`` beams of
    a scan count, and it is ``fitting`` nats if it is and ``strange`` nats if it is not. ``outliers`` is the rate for
    which poses are refined. ``worst`` [nats] is what a wall in the way costs a beam at most. ``length`` [m] is how far
    the errors of a map reach. ``doubt`` [nats] is the log odds of not being on this map where ``off_map_prior`` is
    0.05; ``unlisted`` [nats] is added to the mass of places that the searches left out.
    """

    ends: float
    rays: float
    rates: tuple[float, ...]
    changed: float
    fitting: float
    strange: float
    beams: float
    outliers: float
    worst: float
    length: float
    doubt: float
    unlisted: float


LAW = Law(
    ends=0.95,
    rays=0.25,
    rates=(0.01, 0.03, 0.1, 0.3, 0.6),
    changed=0.55,
    fitting=0.1,
    strange=-0.04,
    beams=27.0,
    outliers=0.1,
    worst=1.0,
    length=2.0,
    doubt=-2.66,
    unlisted=-1.0,
)
