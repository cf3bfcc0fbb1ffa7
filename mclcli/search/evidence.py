"""Evidence of places and of what is not on the map, beam by beam, at refined poses.

With d the distance of a beam's end from the nearest wall, a beam has the likelihood p = (1 − ε)·exp(−d²/2σ²) + ε
where a share ε of the beams ends anywhere: at what has changed since the map was made. ε is not known, and another one
for every scan: a scan has the likelihood Σ_ε π(ε)·Π p^α. "Not on this map" is its own hypothesis: surroundings that
resemble some place of the map, as buildings do, with larger ε. Places are weighed against each other with the measured
correlation of the beams, α; how probable it is that a scan fits at all is a matter of a fixed number of independent
beams: α is measured where the scan fits best, and what does not fit would make itself count less. Scans near each other
count less than one each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.search.calibration import LAW, Law

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.candidates import Temper
    from mclcli.search.places import Places
    from mclcli.search.scene import Scene, View
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.likelihood_field import LikelihoodField

RESCORED = 16  # places that the beam model looks at


@final
@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """What was measured at M places, of n scans, before it is weighed.

    ``by_rate`` (G, n, M): Σ log p over the ``beams`` (n,) of a scan, for each of the law's ``rates``; ``lost`` (n, M)
    what the beam model takes, ≤ 0. ``alphas`` (n,) and ``ray_alpha`` are their temperatures; ``ways`` (n − 1,) [m] lie
    between the scans. ``bearings``, ``odometry`` and ``volume`` (M,) are log densities, ``directions`` counts bearings.
    """

    by_rate: FloatArray
    beams: FloatArray
    lost: FloatArray
    alphas: FloatArray
    ray_alpha: float
    ways: FloatArray
    bearings: FloatArray
    odometry: FloatArray
    volume: FloatArray
    directions: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Logarithms (M,) of what speaks for each place, up to a constant that all share.

    ``ends`` of beams on the field, ``rays`` by the beam model, ``bearings`` of landmarks, ``odometry``, and ``volume``
    of the mode. ``strange`` is what stands for ``ends`` and ``bearings`` if the robot is not on this map but somewhere
    that resembles the place.
    """

    ends: FloatArray
    rays: FloatArray
    bearings: FloatArray
    odometry: FloatArray
    volume: FloatArray
    strange: FloatArray

    @property
    def here(self) -> FloatArray:
        """Log evidence (M,) of the places."""
        return np.asarray(self.ends + self.rays + self.bearings + self.odometry + self.volume)

    @property
    def not_here(self) -> FloatArray:
        """Log evidence (M,) of not being on this map, but where it resembles the place."""
        return np.asarray(self.strange + self.rays + self.odometry + self.volume)


def look(scene: Scene, view: View, places: Places, temper: Temper) -> Looked:
    """Look at every place with all scans, and with the beam model at the foremost."""
    by_rate = np.empty((len(LAW.rates), len(view.sights), len(places.paths)))
    for k, sight in enumerate(view.sights):
        hit = _hits(places.ends.models[k], sight.beams, places.paths[:, k])
        by_rate[:, k] = [np.log((1.0 - rate) * hit + rate).sum(axis=1) for rate in LAW.rates]
    bearings, directions = np.zeros(len(places.paths)), 0
    for one in view.bearings:
        assert view.bearing_model is not None  # noqa: S101 - bearings come with it
        bearings += view.bearing_model.measure("camera", one).log_likelihood(places.poses)
        directions += one.angles.size + one.unknown
    foremost = np.argsort(-_roughly(by_rate, places) - bearings, kind="stable")[:RESCORED]
    lost = [_lost(scene, sight.rays, places, k, foremost) for k, sight in enumerate(view.sights)]
    alphas = [temper(each[0]) if each.shape[1] > 1 else 1.0 for each in lost]
    taken = np.stack([each.sum(axis=1) for each in lost])
    everywhere = np.repeat(taken.min(axis=1, keepdims=True), len(places.paths), axis=1)
    everywhere[:, foremost] = taken
    return Looked(
        by_rate=by_rate,
        beams=np.array([sight.beams.ranges.size for sight in view.sights], np.float64),
        lost=everywhere,
        alphas=places.ends.alphas,
        ray_alpha=float(np.mean(alphas)),
        ways=view.ways,
        bearings=bearings,
        odometry=-places.odometry,
        volume=places.log_volumes,
        directions=directions,
    )


def weigh(looked: Looked, law: Law = LAW) -> Evidence:
    """Evidence of every place."""
    count = shares_of(looked.ways, law)[:, np.newaxis]
    ends = _mixed(law.ends * looked.alphas[:, np.newaxis] * count * looked.by_rate, law.changed)
    few = law.beams / np.maximum(looked.beams, law.beams)[:, np.newaxis] * count * looked.by_rate
    return Evidence(
        ends=ends,
        rays=law.rays * looked.ray_alpha * (count * looked.lost).sum(axis=0),
        bearings=looked.bearings,
        odometry=looked.odometry,
        volume=looked.volume,
        strange=ends
        + _mixed(few, law.strange)
        - _mixed(few, law.fitting)
        - math.log(2.0 * math.pi) * looked.directions,
    )


def _roughly(by_rate: FloatArray, places: Places) -> FloatArray:
    """Log evidence (M,) by the field at one rate."""
    ends = np.einsum("n,nm->m", places.ends.alphas, by_rate[len(LAW.rates) // 2])
    return np.asarray(ends - places.odometry + places.log_volumes)


def _hits(model: LikelihoodField, beams: Beams, poses: FloatArray) -> FloatArray:
    """exp(−d²/2σ²) (M, B) of every beam's end; the wall may be anywhere in its cell."""
    d = model.distances(beams, poses)
    furthest = model.field.max_dist
    d = np.clip(np.where(np.isnan(d), furthest, d) - 0.5 * model.field.resolution, 0.0, furthest)
    return np.asarray(np.exp(-0.5 * (d / model.parameters.sigma_hit) ** 2))


def _mixed(tempered: FloatArray, rarer: float) -> FloatArray:
    """Σ over scans of log Σ π·exp (M,) of log-likelihoods (G, n, M), each rate ``rarer`` [nats] than the one before."""
    log_prior = -rarer * np.arange(len(tempered))
    log_prior -= np.logaddexp.reduce(log_prior)
    total = np.logaddexp.reduce(tempered + log_prior[:, np.newaxis, np.newaxis], axis=0)
    return np.asarray(total.sum(axis=0), np.float64)


def shares_of(ways: FloatArray, law: Law = LAW) -> FloatArray:
    """How much each of n scans counts (n,), with ``ways`` (n − 1,) [m] between them.

    The error of a map is that of its surroundings: scans a way s apart share exp(−s/L) of it. The sum is that of as
    many independent scans as say the same, 1 + Σ (1 − ρ)/(1 + ρ), as of an autoregressive sequence.
    """
    new = np.tanh(0.5 * ways / law.length)  # (1 − ρ)/(1 + ρ)
    return np.asarray(0.5 * (np.append(1.0, new) + np.append(new, 1.0)))


def _lost(scene: Scene, rays: Beams, places: Places, k: int, foremost: IntArray) -> FloatArray:
    """What every ray loses at the foremost places (F, B), −``LAW.worst`` to 0: walls that it would have had to pass.

    Nothing that the field took already is taken again.
    """
    judge, poses = scene.rays, places.paths[foremost, k]
    found = judge.log_p(rays.ranges, judge.expected(rays, poses), rays.r_max)
    by_rays = np.maximum(found - judge.log_p(rays.ranges, judge.perfect(rays), rays.r_max), -LAW.worst)
    hit = _hits(places.ends.models[k], rays, poses)
    by_field = np.where(rays.ranges < rays.r_max, np.log((1.0 - LAW.outliers) * hit + LAW.outliers), 0.0)
    return np.asarray(np.clip(by_rays - np.maximum(by_field, -LAW.worst), -LAW.worst, 0.0))
