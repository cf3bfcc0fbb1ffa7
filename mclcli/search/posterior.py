"""One posterior over distinct places, "not on this map", and the places that were not listed: it sums to 1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.search.calibration import LAW, Law

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.evidence import Evidence

_USUAL = 0.05  # ``off_map_prior`` for which ``LAW.doubt`` was fitted


@final
@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Places by share: ``order`` (M,) numbers of places, the most probable first, and their ``shares`` (M,).

    ``elsewhere`` is the share of not being on this map, ``unlisted`` that of places on it that were not looked at.
    ``low`` and ``high`` (M,) hold the shares for any mass of those that the searches allow.
    """

    order: IntArray
    shares: FloatArray
    elsewhere: float
    unlisted: float
    low: FloatArray
    high: FloatArray


def posterior(evidence: Evidence, left_out: float, off_map_prior: float, law: Law = LAW) -> Posterior:
    """Shares of places, from their evidence and from what the searches for them left out, over what they list."""
    here = evidence.here
    top = float(here.max())
    mass = np.exp(here - top)
    inside = float(mass.sum())
    most = inside * left_out
    missed = math.exp(law.unlisted) * most
    strange = 0.0
    if off_map_prior > 0.0:
        prior = math.log(off_map_prior / (1.0 - off_map_prior)) - math.log(_USUAL / (1.0 - _USUAL)) + law.doubt
        strange = math.exp(min(prior + float(np.logaddexp.reduce(evidence.not_here)) - top, 700.0))
        strange *= 1.0 + missed / inside  # what was not listed may be resembled as well
    order = np.argsort(-here, kind="stable")
    whole = inside + strange + missed
    share = mass[order]
    return Posterior(
        order=order,
        shares=share / whole,
        elsewhere=strange / whole,
        unlisted=missed / whole,
        low=share / (inside + strange + max(most, missed)),
        high=share / (inside + strange),
    )
