"""Rows of the table about scoring poses: likelihood field, beam mixture, bearings, threads."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.drive import MAP
from benchmarks.measure import alternate, timed
from mclcli.io.maps.map_yaml import load_map
from mclcli.sensors.beam import BeamModel
from mclcli.sensors.beam_forms import BeamParameters
from mclcli.sensors.beams import Beams
from mclcli.sensors.bearing import BearingModel, BearingParameters, Bearings
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world.distance_field import DistanceField
from mclcli.world.raycast import CastMethod, make_caster

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.measure import Row
    from mclcli.arrays import FloatArray


@dataclass(frozen=True)
class Job:
    """Poses and beams over a field of random codes: the least that caches can do."""

    field: DistanceField
    beams: Beams
    poses: FloatArray

    def score(self, *, threads: int = 1, **parameters: Any) -> Callable[[], FloatArray]:  # noqa: ANN401
        """Scores all poses."""
        settings = LikelihoodFieldParameters(**parameters)
        model = LikelihoodField(self.field, settings, job_size=np.inf, threads=threads)
        log_likelihood = model.measure("lidar", self.beams).log_likelihood
        return lambda: log_likelihood(self.poses)

    @property
    def pairs(self) -> int:
        """Poses × beams."""
        return len(self.poses) * self.beams.ranges.size


def concentrated(particles: int, count: int) -> Job:
    """A tracking filter's cloud in a map of 600 × 600."""
    rng = np.random.default_rng(0)
    poses = np.column_stack([15 + rng.normal(0, 0.2, (particles, 2)), rng.normal(0, 0.05, particles)])
    return Job(_field(600), _beams(count), poses)


def uniform(particles: int, count: int, side: int = 2000) -> Job:
    """Poses all over a map."""
    rng = np.random.default_rng(0)
    place = rng.uniform(0, side * 0.05, (particles, 2))
    return Job(_field(side), _beams(count), np.column_stack([place, rng.uniform(-3, 3, particles)]))


def _field(side: int) -> DistanceField:
    codes = np.random.default_rng(1).integers(0, 1600, (side, side)).astype(np.uint16)
    levels = np.append(np.sqrt(np.arange(1600)) * 0.05, 2.0)
    codes.flags.writeable = levels.flags.writeable = False
    return DistanceField(codes, levels, 0.05, np.zeros(3))


def _beams(count: int) -> Beams:
    angles, ranges = np.linspace(-2.0, 2.0, count), np.random.default_rng(2).uniform(0.5, 10.0, count)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return Beams(np.zeros((count, 2)), directions, ranges, 12.0, slots=count)


def straightforward(job: Job) -> FloatArray:
    """The likelihood field as one would write it in NumPy: all endpoints at once, distances in metres."""
    field, beams, poses, metres = job.field, job.beams, job.poses, job.field.metres()
    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, 0, None] + c * beams.endpoints[:, 0] - s * beams.endpoints[:, 1]
    y = poses[:, 1, None] + s * beams.endpoints[:, 0] + c * beams.endpoints[:, 1]
    column = np.floor((x - field.origin[0]) / field.resolution).astype(int)
    row = np.floor((y - field.origin[1]) / field.resolution).astype(int)
    inside = (column >= 0) & (column < metres.shape[1]) & (row >= 0) & (row < metres.shape[0])
    d = np.where(inside, metres[row.clip(0, metres.shape[0] - 1), column.clip(0, metres.shape[1] - 1)], field.max_dist)
    p = 0.5 * np.exp(-0.5 * (d / 0.2) ** 2) + 0.5 / beams.r_max
    return np.asarray(np.log(p).sum(axis=1))


def likelihood_field() -> list[Row]:
    """Concentrated and uniform clouds against straightforward NumPy, and variants against the plain field."""
    rows = []
    for what, job, target in (
        ("likelihood field, 2,000 × 60, concentrated", concentrated(2000, 60), "≤ 1.0 ns"),
        ("likelihood field, 2,000 × 360, concentrated", concentrated(2000, 360), "≤ 1.0 ns"),
        ("likelihood field, 100,000 × 60, concentrated", concentrated(100_000, 60), "≤ 1.0 ns"),
        ("likelihood field, 20,000 × 60, all over 2000²", uniform(20_000, 60), "≤ 3 ns"),
    ):
        score = job.score()
        assert np.allclose(score(), straightforward(job), rtol=1e-12)  # noqa: S101
        pair = alternate(timed(score, 5), timed(partial(straightforward, job)), 9)
        rows.append((what, f"{pair.a / job.pairs * 1e9:.2f} ns", target, f"plain NumPy ÷ {1 / pair.ratio:.0f}"))
    return rows + [_variant(name, parameters) for name, parameters in VARIANTS.items()]


VARIANTS: dict[str, dict[str, Any]] = {
    "likelihood_field_prob, no beam skipped": {"do_beamskip": True, "beam_skip_threshold": 0.0},
    "sum of cubes": {"combination": "one_plus_cubes"},
    "interpolated between cells": {"field_lookup": "bilinear"},
}


def _variant(name: str, parameters: dict[str, Any]) -> Row:
    job = concentrated(2000, 360)
    pair = alternate(timed(job.score(**parameters), 5), timed(job.score(), 5), 15)
    return name, f"{pair.a / job.pairs * 1e9:.2f} ns", "≤ 1.5 × plain", f"{pair.ratio:.2f} × the plain field"


def threads() -> Row:
    """Two threads against one, the same bytes."""
    job = concentrated(200_000, 60)
    two, one = job.score(threads=2), job.score()
    assert two().tobytes() == one().tobytes()  # noqa: S101
    wall = time.perf_counter
    pair = alternate(timed(one, clock=wall), timed(two, clock=wall), 15)
    return "two threads, 200,000 × 60", f"{pair.b * 1e3:.0f} ms", "≥ 1.7 ×", f"{pair.ratio:.2f} × as fast as one"


def beam_mixture() -> list[Row]:
    """Rays cast in the office map, and the mixture over them; the partner is the mixture alone, in NumPy."""
    rng, grid = np.random.default_rng(0), load_map(MAP)
    poses = np.array([-7.2, 1.2, 0.0]) + rng.normal(0, 0.1, (2000, 3))
    angles = np.linspace(-3.0, 3.0, 60)
    directions, origins = np.stack([np.cos(angles), np.sin(angles)], axis=-1), np.zeros((60, 2))
    rows = []
    targets: dict[CastMethod, str] = {"exact": "≤ 120 ns", "approximate": "≤ 40 ns"}
    for method, target in targets.items():
        caster = make_caster(grid, method=method)
        beams = Beams(origins, directions, caster.ranges(poses[:1], origins, directions, 12.0)[0], 12.0)
        score = BeamModel(caster, BeamParameters(raycast=method)).measure("lidar", beams).log_likelihood
        cast = partial(caster.ranges, poses, origins, directions, 12.0)
        pair = alternate(timed(partial(score, poses)), timed(cast), 15)
        each = 1e9 / (2000 * 60)
        against = f"of it casting {pair.b * each:.0f} ns"
        rows.append((f"beam mixture, rays {method}", f"{pair.a * each:.0f} ns", target, against))
    return rows


def bearings() -> Row:
    """Bearings to landmarks, against as many beams of a field."""
    rng, job = np.random.default_rng(0), concentrated(2000, 60)
    seen = Bearings(np.zeros(2), rng.uniform(-3, 3, 60), rng.uniform(0, 30, (60, 2)), 0)
    score = BearingModel(BearingParameters(), np.inf).measure("vision", seen).log_likelihood
    pair = alternate(timed(lambda: score(job.poses)), timed(job.score(), 5), 9)
    return (
        "bearings, 2,000 × 60",
        f"{pair.a / job.pairs * 1e9:.1f} ns",
        "≤ 1.5 × plain",
        f"{pair.ratio:.0f} × the field",
    )
