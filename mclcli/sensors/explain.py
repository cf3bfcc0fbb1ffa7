"""Why a pose scores what it scores: beam by beam and landmark by landmark."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.sensors import bearing, likelihood_field

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.beam import BeamModel
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.bearing import BearingModel, Bearings
    from mclcli.sensors.likelihood_field import LikelihoodField

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


def explain_field(model: LikelihoodField, beams: Beams, pose: FloatArray) -> list[Explanation]:
    """Every beam of a likelihood field that ends somewhere, at one pose (3,)."""
    beams = beams.with_return()
    distance = model.distances(beams, pose[np.newaxis])[0]
    p = model.likelihood(distance, beams.r_max)
    distance = np.minimum(distance, model.field.max_dist)
    rand = model.parameters.z_rand / beams.r_max
    log_p = np.log(np.maximum(p, likelihood_field.FLOOR))
    angles = np.arctan2(beams.directions[:, 1], beams.directions[:, 0])
    rows = zip(beams.indices, angles, beams.ranges, distance, p, log_p, strict=True)
    return [
        Explanation(str(i), float(a), float(r), None, float(d), {"hit": float(q) - rand, "rand": rand}, float(lp))
        for i, a, r, d, q, lp in rows
    ]


def explain_beams(model: BeamModel, beams: Beams, pose: FloatArray) -> list[Explanation]:
    """Every beam of a beam mixture, at one pose (3,)."""
    expected = model.expected(beams, pose[np.newaxis])[0]
    parts = model.components(beams.ranges, expected, beams.r_max)
    log_p = model.log_p(beams.ranges, expected, beams.r_max)
    angles = np.arctan2(beams.directions[:, 1], beams.directions[:, 0])
    shares = np.broadcast_arrays(parts.hit, parts.short, parts.max, parts.rand, expected)[:4]
    rows = zip(beams.indices, angles, beams.ranges, expected, np.transpose(shares), log_p, strict=True)
    return [
        Explanation(
            str(i),
            float(a),
            float(r),
            float(e),
            float(r - e),
            dict(zip(COMPONENTS, s.tolist(), strict=True)),
            float(lp),
        )
        for i, a, r, e, s, lp in rows
    ]


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
