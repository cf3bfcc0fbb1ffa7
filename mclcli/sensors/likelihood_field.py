"""Likelihood field: how near to an obstacle each beam ends.

    p(r_i | x) = z_hit · exp(−d² / 2σ²) + z_rand / r_max,    log p(z | x) = Σ_i log p(r_i | x)

with d the distance of the endpoint's cell to the nearest occupied cell. Unnormalised on purpose: not a density in r.
Source: Thrun, Burgard, Fox 2005, *Probabilistic Robotics*, table 6.3. The switches reproduce what nav2_amcl and Beluga
make of it; see docs/models.md.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final, get_args

import numpy as np

from mclcli.geometry.exponential import LOG2_E
from mclcli.native.backend import NUMPY, Backend
from mclcli.parameters import YesNo, parameter, validate
from mclcli.sensors import Measurement, endpoints, floored_log
from mclcli.sensors.beam_skipping import BeamSkipping, kept_beams
from mclcli.sensors.endpoints import Anchoring
from mclcli.sensors.explain import Explanation
from mclcli.sensors.interpolated_field import Law, sum_interpolated
from mclcli.sensors.models import Entry
from mclcli.world import FieldMethod

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors import Temperature
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.models import FieldMaker
    from mclcli.world.distance_field import Codes, DistanceField
    from mclcli.world.occupancy import OccupancyGrid

FLOOR = 1e-12
_MOST_LOOKED_UP = 2**25  # codes of poses·beams


FieldLookup = Literal["nearest", "bilinear"]
FieldCombination = Literal["log", "one_plus_cubes"]
OffMap = Literal["max_dist", "uniform"]
FieldUnknown = Literal["free", "uniform"]
Obstacles = Literal["occupied", "boundary"]
FieldAnchor = Literal["corner", "half_cell"]
OriginYaw = Literal["use", "ignore"]
FieldPrecision = Literal["double", "single_distance", "single_likelihood"]


@final
@dataclass(frozen=True, slots=True)
class LikelihoodFieldParameters:
    """Parameters of the likelihood field."""

    z_hit: float = parameter(0.5, "weight of the hit component", low=0.0, in_nav2=True)
    z_rand: float = parameter(0.5, "weight of the uniform component over [0, r_max]", low=0.0, in_nav2=True)
    sigma_hit: float = parameter(0.2, "standard deviation of the hit component", unit="m", above=0.0, in_nav2=True)
    laser_likelihood_max_dist: float = parameter(
        2.0, "distances to obstacles are clamped here", unit="m", above=0.0, in_nav2=True
    )
    field_method: FieldMethod = parameter(
        "exact", "Euclidean distances, or shortest 8-neighbour paths", choices=get_args(FieldMethod)
    )
    field_lookup: FieldLookup = parameter(
        "nearest",
        "distance of the cell that contains the endpoint, or interpolated between cells",
        choices=get_args(FieldLookup),
    )
    combination: FieldCombination = parameter(
        "log", "beams combine as Σ log p, or as log(1 + Σ p³)", choices=get_args(FieldCombination)
    )
    hit_normalised: YesNo = parameter("no", "divide the hit component by σ√2π", choices=get_args(YesNo))
    off_map: OffMap = parameter(
        "max_dist", "an endpoint off the map has the greatest distance, or p = 1/r_max", choices=get_args(OffMap)
    )
    field_unknown: FieldUnknown = parameter(
        "free", "an unknown cell has its distance like a free one, or p = 1/r_max", choices=get_args(FieldUnknown)
    )
    obstacles: Obstacles = parameter(
        "occupied",
        "distances are to all occupied cells, or to those beside a free one",
        choices=get_args(Obstacles),
    )
    field_anchor: FieldAnchor = parameter(
        "corner", "cells begin at the origin, or half a cell before it", choices=get_args(FieldAnchor)
    )
    origin_yaw: OriginYaw = parameter("use", "the yaw of the map's origin", choices=get_args(OriginYaw))
    field_precision: FieldPrecision = parameter(
        "double",
        "double throughout; distances, or likelihoods, rounded to single precision",
        choices=get_args(FieldPrecision),
    )
    do_beamskip: bool = parameter(False, "leave out beams that most particles find no obstacle for", in_nav2=True)
    beam_skip_distance: float = parameter(
        0.5, "a beam agrees with a particle if it ends within this of an obstacle", unit="m", above=0.0, in_nav2=True
    )
    beam_skip_threshold: float = parameter(
        0.3, "share of the particles that must agree for a beam to count", low=0.0, high=1.0, in_nav2=True
    )
    beam_skip_error_threshold: float = parameter(
        0.9, "share of skipped beams from which on all count again", low=0.0, high=1.0, in_nav2=True
    )

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True, eq=False)
class LikelihoodField:
    """The model over one distance field; ``backend`` runs its loops, ``threads`` share one scoring."""

    field: DistanceField
    parameters: LikelihoodFieldParameters
    backend: Backend = NUMPY
    threads: int = 1
    _tables: dict[float, FloatArray] = dataclasses.field(default_factory=dict, init=False, repr=False)

    def measure(self, sensor: str, beams: Beams, alpha: Temperature = 1.0) -> Measurement:
        """Measurement that scores poses against these beams; those without an end are left out."""
        beams = beams.with_return()
        table = self.table(beams.r_max)
        peak, floor = (float(term) * beams.ranges.size for term in (table[0], table.min()))
        if self._cubes:
            peak, floor = math.log1p(peak), math.log1p(floor)
        score = functools.partial(self._score, beams)
        each = functools.partial(self.each, beams)
        return Measurement(sensor, score, beams.ranges.size, peak, alpha, each, log_floor=floor)

    def likelihood(self, distance: FloatArray, r_max: float) -> FloatArray:
        """p of readings that end at these distances [m] from an obstacle, any shape.

        +inf stands for off the map, NaN for an unknown cell that is not to be judged by its distance.
        """
        p = self.parameters
        square = np.minimum(distance, self.field.max_dist) ** 2
        square = np.where(np.isnan(square), self._square_of_uniform(r_max), square)
        likelihood = self._hit(square) + p.z_rand / r_max
        if p.off_map == "uniform":
            likelihood = np.where(np.isinf(distance), 1.0 / r_max, likelihood)
        return _single(likelihood) if p.field_precision == "single_likelihood" else likelihood

    def _hit(self, square: FloatArray) -> FloatArray:
        """z_hit · exp(−d² / 2σ²) of squared distances, divided by σ√2π where it is to be a density."""
        p = self.parameters
        if p.field_precision == "single_distance":
            square = _single(np.sqrt(square)) ** 2
        if p.field_precision == "single_likelihood":
            square = _single(square)
        return self._amplitude * np.exp(-square / (2.0 * p.sigma_hit * p.sigma_hit))

    def _square_of_uniform(self, r_max: float) -> float:
        """Squared distance at which p = 1/r_max, as Beluga gives to unknown cells; at most that of the clamp."""
        p = self.parameters
        share = (1.0 - p.z_rand) / r_max / self._amplitude if self._amplitude > 0.0 else 0.0
        limit = self.field.max_dist**2
        return min(limit, -2.0 * p.sigma_hit**2 * math.log(share)) if share > 0.0 else limit

    @property
    def _amplitude(self) -> float:
        p = self.parameters
        return p.z_hit / (p.sigma_hit * math.sqrt(2.0 * math.pi)) if p.hit_normalised == "yes" else p.z_hit

    def _law(self, r_max: float) -> Law:
        """``likelihood`` of interpolated distances, in double precision."""
        p = self.parameters
        return Law(
            factor=max(-0.5 * LOG2_E / p.sigma_hit / p.sigma_hit, -1e300),
            amplitude=self._amplitude,
            rest=p.z_rand / r_max,
            off_map=float(self.likelihood(np.array([np.inf]), r_max)[0]),
            unknown=self._square_of_uniform(r_max),
            furthest=self.field.max_dist,
            floor=FLOOR,
            cubes=self._cubes,
        )

    def term(self, likelihood: FloatArray) -> FloatArray:
        """What a beam adds to the sum: log p, or p³."""
        return likelihood**3 if self._cubes else floored_log(likelihood, FLOOR)

    def table(self, r_max: float) -> FloatArray:
        """Term (L + 1,) of a reading that ends at each level of the field, and of one that ends off the map."""
        if r_max not in self._tables:  # all scans of a lidar have the same, so keep the last one
            table = self.term(self.likelihood(np.append(self.field.levels, np.inf), r_max))
            table.flags.writeable = False
            self._tables.clear()
            self._tables[r_max] = table
        return self._tables[r_max]

    def distances(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Distance (N, B) [m] at each endpoint; +inf off the map."""
        bilinear = self.parameters.field_lookup == "bilinear"
        return endpoints.distances(self.field, beams.endpoints, poses, bilinear=bilinear, anchoring=self._anchoring)

    def each(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Log-likelihood (N, B) of each beam alone at poses (N, 3)."""
        nearest = self.parameters.field_lookup == "nearest"
        kernels = endpoints.kernels_over(self.field, self.backend, "likelihood_field")
        if nearest and not self._cubes and kernels is not None:  # NumPy takes all beams at once, to the same bits
            return self.table(beams.r_max)[self._look_up(beams, poses)].T
        return floored_log(self.likelihood(self.distances(beams, poses), beams.r_max), FLOOR)

    @property
    def _cubes(self) -> bool:
        return self.parameters.combination == "one_plus_cubes"

    @property
    def _anchoring(self) -> Anchoring:
        return Anchoring(self.parameters.field_anchor == "half_cell", self.parameters.origin_yaw == "use")

    def _score(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Log-likelihood (N,) of poses (N, 3) of the base in map."""
        if self.parameters.do_beamskip:
            return self._score_skipping(beams, poses)
        return self._score_all(beams, poses)

    def _score_all(self, beams: Beams, poses: FloatArray) -> FloatArray:
        if self.parameters.field_lookup == "bilinear":
            total = self._sum_bilinear(beams, poses)
        else:
            total = endpoints.sum_table(
                self.field,
                self.table(beams.r_max),
                beams.endpoints,
                poses,
                anchoring=self._anchoring,
                backend=self.backend,
                threads=self.threads,
            )
        return np.log1p(total) if self._cubes else total

    def _sum_bilinear(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Sum (N,) over beams of log p or p³."""
        if self.parameters.field_precision == "double":
            return sum_interpolated(
                self.field,
                self._law(beams.r_max),
                beams.endpoints,
                poses,
                anchoring=self._anchoring,
                backend=self.backend,
                threads=self.threads,
            )
        out = np.empty(poses.shape[0])
        size = max(1, endpoints.PAIRS // max(1, beams.ranges.size))

        def sum_block(start: int) -> None:
            block = slice(start, start + size)
            likelihood = self.likelihood(self.distances(beams, poses[block]), beams.r_max)
            out[block] = self.term(likelihood).sum(axis=1)

        endpoints.for_each(sum_block, range(0, poses.shape[0], size), self.threads)
        return out

    def _score_skipping(self, beams: Beams, poses: FloatArray) -> FloatArray:
        """Log-likelihood (N,) by the beams that count (see ``beam_skipping``); −inf if no pose is possible.

        Codes that were looked up to choose the beams serve again for the sum, where they are not too many to keep.
        """
        p = self.parameters
        rule = BeamSkipping(p.beam_skip_distance, p.beam_skip_threshold, p.beam_skip_error_threshold)
        keeps = p.field_lookup == "nearest" and poses.shape[0] * beams.ranges.size <= _MOST_LOOKED_UP
        found = self._look_up(beams, poses) if keeps else None
        kept = kept_beams(rule, self.field, beams, poses, self._anchoring, found, self.backend)
        if kept is None:
            return np.full(poses.shape[0], -np.inf)
        if found is None:
            return self._score_all(beams.subset(kept), poses)
        found = found if kept.all() else found[kept]
        total = endpoints.sum_looked_up(found, self.table(beams.r_max), self.backend)
        return np.log1p(total) if self._cubes else total

    def _look_up(self, beams: Beams, poses: FloatArray) -> Codes:
        return endpoints.look_up(self.field, beams.endpoints, poses, anchoring=self._anchoring, backend=self.backend)


def _single(values: FloatArray) -> FloatArray:
    """Values rounded to single precision."""
    return values.astype(np.float32).astype(np.float64)


def make_field_model(
    grid: OccupancyGrid,
    parameters: LikelihoodFieldParameters,
    make_field: FieldMaker,
    backend: Backend = NUMPY,
    threads: int = 1,
) -> LikelihoodField:
    """Likelihood field over a map; ``make_field`` computes, or finds, the distance field."""
    field = make_field(
        grid,
        parameters.field_method,
        parameters.laser_likelihood_max_dist,
        boundary_only=parameters.obstacles == "boundary",
        mark_unknown=parameters.field_unknown == "uniform",
    )
    return LikelihoodField(field, parameters, backend, threads)


def explain_field(model: LikelihoodField, beams: Beams, pose: FloatArray) -> list[Explanation]:
    """Every beam of a likelihood field that ends somewhere, at one pose (3,)."""
    beams = beams.with_return()
    distance = model.distances(beams, pose[np.newaxis])[0]
    p = model.likelihood(distance, beams.r_max)
    distance = np.minimum(distance, model.field.max_dist)
    rand = model.parameters.z_rand / beams.r_max
    log_p = np.log(np.maximum(p, FLOOR))
    angles = np.arctan2(beams.directions[:, 1], beams.directions[:, 0])
    rows = zip(beams.indices, angles, beams.ranges, distance, p, log_p, strict=True)
    return [
        Explanation(str(i), float(a), float(r), None, float(d), {"hit": float(q) - rand, "rand": rand}, float(lp))
        for i, a, r, d, q, lp in rows
    ]


_CUBES = {"combination": "one_plus_cubes"}
FIELD = Entry(
    group="likelihood_field",
    parameters=LikelihoodFieldParameters,
    source="table 6.3; nav2_amcl",
    make=make_field_model,
    explain=explain_field,
    profiles={"nav2": _CUBES, "beluga": _CUBES},
)
PROB = dataclasses.replace(
    FIELD, profiles={"nav2": {"beam_subsampling": "stride_ceil"}, "beluga": {"obstacles": "occupied"}}
)
