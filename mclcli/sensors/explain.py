"""Why a pose scores what it scores: a row of a beam or a landmark, and those of landmarks.

The rows of beams are made beside each lidar model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.sensors import bearing

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.bearing import BearingModel, Bearings

COMPONENTS = ("hit", "short", "max", "rand")


@final
@dataclass(frozen=True, slots=True)
class Explanation:
    """One beam or sighting at one pose.

    ``name`` is the beam's number in the scan or the landmark's id, ``angle`` [rad] its direction from the base,
    ``measured`` the range [m] or bearing [rad]. ``expected`` is what the map says, None where the model does not ask.
    ``error`` is the distance to the nearest obstacle [m], measured − expected [m], or the bearing's error [rad]; None
    for unknown ids. ``shares`` are the mixture's components, weighted; ``log_p`` the logarithm of their sum, floored.
    """

    name: str
    angle: float
    measured: float
    expected: float | None
    error: float | None
    shares: dict[str, float]
    log_p: float


def explain_bearings(model: BearingModel, bearings: Bearings, pose: FloatArray) -> list[Explanation]:
    """Every sighting, known ids first, at one pose (3,)."""
    p = model.parameters
    expected = bearing.expected_angles(bearings, pose)
    error = se2.wrap(bearings.angles - expected)
    hit = (1.0 - p.eps_outlier) * np.exp(-0.5 * (error / p.sigma_bearing) ** 2) / (p.sigma_bearing * math.sqrt(se2.TAU))
    rand = p.eps_outlier / se2.TAU
    rows = zip(bearings.ids, bearings.angles, expected, error, hit, model.log_p(error), strict=True)
    known = [
        Explanation(name, float(a), float(a), float(b), float(e), {"hit": float(h), "rand": rand}, float(lp))
        for name, a, b, e, h, lp in rows
    ]
    nothing = -math.log(se2.TAU)
    unknown = [
        Explanation(name, math.nan, math.nan, None, None, {"rand": 1.0 / se2.TAU}, nothing)
        for name in bearings.unknown_ids
    ]
    return known + unknown
