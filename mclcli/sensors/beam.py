"""Beam mixture: how well each reading agrees with the range that the map makes expect.

    p(r | r*) = z_hit·p_hit + z_short·p_short + z_max·p_max + z_rand·p_rand,    log p(z | x) = Σ_i log p(r_i | r*_i)
    p_hit   = N(r; r*, σ²) / (Φ((r_max − r*)/σ) − Φ(−r*/σ))    on [0, r_max]
    p_short = λ e^{−λr} / (1 − e^{−λr*})                       on [0, r*]
    p_max   = a point mass at r_max,    p_rand = 1 / r_max     on [0, r_max]

with r* from ray casting (``mclcli.world.raycast``). The density integrates to 1 − z_max for every r*: where r* is less
than half a cell, the share of p_short goes to p_hit. p is floored at 1e-12.
Source: Thrun, Burgard, Fox 2005, *Probabilistic Robotics*, section 6.3.1, with the normalisers written out.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.native.backend import NUMPY, Backend, load
from mclcli.sensors import Measurement, beam_forms, endpoints, floored_log
from mclcli.sensors.beam_forms import BeamParameters
from mclcli.sensors.explain import COMPONENTS, Explanation
from mclcli.sensors.models import Entry
from mclcli.world.raycast import make_caster

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.sensors import Temperature
    from mclcli.sensors.beam_forms import Components
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.models import FieldMaker
    from mclcli.world.occupancy import OccupancyGrid
    from mclcli.world.raycast import RayCaster

_IN_A_ROW = 512  # beams that the kernel goes through at a time, of one pose or of several
_TAIL = 40.0  # standard deviations beyond which a Gaussian is 0 in double precision


@final
@dataclass(frozen=True, slots=True, eq=False)
class BeamModel:
    """The mixture over one map; ``threads`` share one scoring."""

    caster: RayCaster
    parameters: BeamParameters
    threads: int = 1

    def measure(self, sensor: str, beams: Beams, alpha: Temperature = 1.0) -> Measurement:
        """Measurement that scores poses against these beams, those without a return among them; NaNs are left out.

        ``log_peak`` is the value of a pose that expects every reading as it is, r* = r. It is not a bound: another r*
        may fit a little better where a reading is within some σ of 0 or r_max, or λ is large.
        """
        beams = _without_nan(beams)
        expected = (self.perfect(beams), np.zeros(beams.ranges.size))  # as read, or a wall at the sensor itself
        peak, floor = (float(self._combine(self._likelihood(beams.ranges, r_star, beams.r_max))) for r_star in expected)
        score = functools.partial(self._score, beams)
        each = functools.partial(self.each, beams)
        return Measurement(sensor, score, beams.ranges.size, peak, alpha, each, log_floor=floor)

    def expected(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Expected ranges r* (N, B) [m], up to r_max; with ``no_return=censored`` as far beyond as it matters."""
        limit = beams.r_max + (_TAIL * self.parameters.sigma_hit if self._censored else 0.0)
        return self.caster.ranges(poses, beams.origins, beams.directions, limit)

    def components(self, r: FloatArray, r_star: FloatArray, r_max: float) -> Components:
        """What each component adds to p(r | r*), shapes broadcast."""
        form = beam_forms.FORMS[self.parameters.beam_form]
        return form(self.parameters, r, r_star, r_max, 0.5 * self.caster.resolution)

    def log_p(self, r: FloatArray, r_star: FloatArray, r_max: float) -> FloatArray:
        """Log-likelihood of readings r where r* is expected, shapes broadcast, floored at log 1e-12."""
        return floored_log(self._likelihood(r, r_star, r_max), beam_forms.FLOOR)

    def each(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Log-likelihood (N, B) of each beam alone at poses (N, 3)."""
        return self.log_p(beams.ranges, self.expected(beams, poses), beams.r_max)

    @property
    def _censored(self) -> bool:
        return self.parameters.no_return == "censored" and self.parameters.beam_form == "textbook"

    def _likelihood(self, r: FloatArray, r_star: FloatArray, r_max: float) -> FloatArray:
        return self.components(r, r_star, r_max).total()

    def likelihood_of_many(self, beams: Beams) -> Callable[[FloatArray], FloatArray]:
        """p(r | r*) of expected ranges (N, B), which may be overwritten; rounded otherwise than ``_likelihood``.

        Rays are cast by compiled code, and so the mixture of such ranges always is.
        """
        p, r_max, half_cell = self.parameters, beams.r_max, 0.5 * self.caster.resolution
        if p.beam_form != "textbook":
            return lambda expected: self._likelihood(beams.ranges, expected, r_max)
        readings = np.tile(beams.ranges, max(1, _IN_A_ROW // max(1, beams.ranges.size)))
        table, rate = beam_forms.textbook_terms(p, readings, r_max)
        unseen = np.flatnonzero(readings >= r_max) if self._censored else np.empty(0, np.intp)
        kernel = load("beam_mixture").textbook

        def likelihood(expected: FloatArray) -> FloatArray:
            weights, scratch = (p.z_hit, p.z_short, p.z_max), np.empty((2, readings.size))
            kernel(table, unseen, r_max, half_cell, p.sigma_hit, rate, *weights, expected.reshape(-1), scratch)
            return expected

        return likelihood

    def _combine(self, likelihood: FloatArray) -> FloatArray:
        return beam_forms.COMBINATIONS[self.parameters.combination](likelihood)

    def _combine_many(self, likelihood: FloatArray) -> FloatArray:
        """``_combine``, rounded otherwise; see ``likelihood_of_many``."""
        if self.parameters.combination != "log":
            return self._combine(likelihood)
        out = np.zeros(likelihood.shape[0])
        load("beam_mixture").sum_log(likelihood, beam_forms.FLOOR, out)
        return out

    def perfect(self, beams: Beams) -> FloatArray:
        """Expected ranges (B,) that equal the readings; far beyond r_max where there was no return."""
        far = beams.r_max + (_TAIL * self.parameters.sigma_hit if self._censored else 0.0)
        return np.where(beams.ranges >= beams.r_max, far, np.maximum(beams.ranges, 0.0))

    def _score(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Log-likelihood (N,) of poses (N, 3) of the base in map; NaN where a pose is not finite."""
        out = np.empty(poses.shape[0])
        size = max(1, endpoints.PAIRS // max(1, beams.ranges.size))
        likelihood = self.likelihood_of_many(beams)

        def score_block(start: int) -> None:
            block = slice(start, start + size)
            out[block] = self._combine_many(likelihood(self.expected(beams, poses[block])))

        endpoints.for_each(score_block, range(0, poses.shape[0], size), self.threads)
        return out


def _without_nan(beams: Beams) -> Beams:
    there = ~np.isnan(beams.ranges)
    return beams if there.all() else beams.subset(there)


def make_beam_model(
    grid: OccupancyGrid,
    parameters: BeamParameters,
    make_field: FieldMaker | None = None,
    backend: Backend = NUMPY,
    threads: int = 1,
) -> BeamModel:
    """Beam mixture over a map; it needs no distance field, and has no loops in NumPy."""
    del make_field, backend
    caster = make_caster(grid, method=parameters.raycast, ray_unknown=parameters.ray_unknown)
    return BeamModel(caster, parameters, threads)


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


# nav2_amcl and Beluga share these defaults; they sum to 1.1.
_SHARES: dict[str, float | str] = {
    "z_hit": 0.5,
    "z_short": 0.05,
    "z_max": 0.05,
    "z_rand": 0.5,
    "weights_sum_to_1": "no",
}
BEAM = Entry(
    group="beam",
    parameters=BeamParameters,
    source="section 6.3.1",
    make=make_beam_model,
    explain=explain_beams,
    profiles={
        "textbook": {"max_range": "no_return"},
        "nav2": {
            **_SHARES,
            "combination": "one_plus_cubes",
            "beam_form": "nav2",
            "raycast": "bresenham_nav2",
            "max_range": "as_read",
        },
        "beluga": {
            **_SHARES,
            "combination": "cubes",
            "beam_form": "beluga",
            "raycast": "bresenham_beluga",
            "beam_origin": "base",
        },
    },
    compiled=True,
)
