"""Where the robot may be: the global maximum, the places that compete with it, and how sure one can be.

Shares are masses. With ℓ the log-likelihood and α its temperature, a place has the mass Σ e^{αℓ} over the poses of the
lattice around its peak. All poses within some nats of the best are enumerated; branch and bound bounds what the others
can have, so that the share of a place is known to lie in an interval. "Not on this map" is a place of its own, where
every beam ends in any known cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.search import branching, lattice, refine
from mclcli.search.branching import Found
from mclcli.search.calibration import probability
from mclcli.search.posterior import find_peaks, weigh
from mclcli.search.scene import sightings_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.search.branching import Search
    from mclcli.search.calibration import Figures
    from mclcli.search.parameters import SearchParameters
    from mclcli.search.posterior import Peaks, Weighing
    from mclcli.search.scene import Scene, View

    Temper = Callable[[FloatArray], float]

ROOM = 60_000  # leaves that are enumerated at most
_SHALLOWEST = 0.05  # nats
_DEEPEST = 25.0  # nats, untempered: no leaf further below the best is enumerated, or flat scores would take minutes


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A place where the robot may be.

    ``pose`` (3,) of the base in map with ``covariance`` (3, 3), refined from ``node`` (3,), the best pose of the
    lattice there, whose log-likelihood is ``log_likelihood``. ``log_beam`` is that of the beam model. ``share`` is the
    probability of this place; ``low`` and ``high`` bound its share of the mass under the likelihood field alone.
    """

    pose: FloatArray
    covariance: FloatArray
    node: FloatArray
    log_likelihood: float
    log_beam: float
    share: float
    low: float
    high: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class Location:
    """Places, the most probable first; ``elsewhere`` is the share of not being on this map.

    ``maximum`` is the greatest log-likelihood of any pose of the lattice of ``poses`` poses, cells of ``cell`` [m] and
    angles ``angle`` [rad] apart. ``alpha`` is the temperature, ``nats`` how far below the best (tempered) every pose
    was enumerated, ``beams`` how many beams and sightings were scored.
    """

    modes: tuple[Mode, ...]
    elsewhere: float
    maximum: float
    cell: float
    angle: float
    poses: int
    alpha: float
    nats: float
    leaves: int
    beams: int
    figures: Figures


def locate(scene: Scene, view: View, parameters: SearchParameters, k: int, temper: Temper) -> Location | None:
    """Find the robot; None if no pose is allowed. ``temper`` gives α from the log p (B,) of beams at the best pose."""
    field = scene.model.field
    turned = field.origin[2] if scene.anchoring.yaw else 0.0
    about = (scene.about[0] - turned, scene.about[1])
    grid = lattice.build(view.beams.endpoints / field.resolution, scene.places, about)
    seen = sightings_of(scene, view.bearings, view.bearing_model)
    search = branching.prepare(field, scene.pyramid, grid, scene.model.table(view.beams.r_max), seen)
    best, key = search.maximum()
    if key < 0:
        return None
    top = scene.to_map(grid.poses(np.array([key])))[0]
    alpha = temper(scene.model.each(view.beams, top[np.newaxis])[0]) if view.beams.ranges.size > 1 else 1.0
    found, nats = _enumerate(search, best, key, alpha, parameters.leaf_nats)
    peaks = find_peaks(found, grid, alpha, parameters.mode_distance / field.resolution, parameters.mode_angle)
    weighed = weigh(scene, view, search, found, peaks, alpha, parameters.off_map_prior)
    return Location(
        modes=_judge(scene, view, search, found, peaks, weighed, alpha, k),
        elsewhere=calibrated(weighed)[1],
        maximum=best,
        cell=field.resolution,
        angle=grid.step,
        poses=grid.size,
        alpha=alpha,
        nats=nats,
        leaves=found.keys.size,
        beams=view.beams.ranges.size + len(seen.marks),
        figures=weighed.figures,
    )


def _enumerate(search: Search, best: float, key: int, alpha: float, nats: float) -> tuple[Found, float]:
    """All leaves within ``nats`` of the best, or within less if they are too many; the best alone if all are alike."""
    nats = min(nats, _DEEPEST * alpha)
    while nats > _SHALLOWEST:
        found = search.near(best, key, nats / alpha, alpha, ROOM)
        if found is not None:
            return found, nats
        nats *= 0.5
    alone = Found(best, key, np.array([key]), np.array([best]), float(search.lattice.size - 1))
    return alone, 0.0


def _judge(
    scene: Scene, view: View, search: Search, found: Found, peaks: Peaks, weighed: Weighing, alpha: float, k: int
) -> tuple[Mode, ...]:
    """The foremost places, each refined and with its share, once calibrated."""
    nodes = scene.to_map(search.lattice.poses(peaks.keys))
    cell = scene.model.field.resolution
    spacing = np.array([cell, cell, search.lattice.step])
    total = float(peaks.masses.sum()) + peaks.rest + found.pruned
    shares = calibrated(weighed)[0]
    foremost = weighed.order[:k]
    poses, covariances = refine.refine(scene.model, view.beams, nodes[foremost], refine.on_lattice(spacing, alpha))
    for later in view.later:
        poses, covariances = refine.refine(scene.model, later, poses, refine.after_drift(spacing, alpha))
    return tuple(
        Mode(
            pose=poses[rank],
            covariance=covariances[rank],
            node=nodes[number],
            log_likelihood=float(peaks.values[number]),
            log_beam=float(weighed.log_beam[number]) if number < weighed.log_beam.size else math.nan,
            share=float(shares[rank]),
            low=float(peaks.masses[number]) / total,
            high=(float(peaks.masses[number]) + found.pruned) / total,
        )
        for rank, number in enumerate(foremost.tolist())
    )


def calibrated(weighed: Weighing) -> tuple[FloatArray, float]:
    """Shares (M,) and that of being elsewhere, once the best has the probability that its figures stand for."""
    best = probability(weighed.figures)
    doubt = 1.0 - float(weighed.shares[0])
    if not doubt > 0.0:  # the models have none left: what the calibration doubts is whether it is this map
        return np.concatenate([[best], weighed.shares[1:]]), 1.0 - best
    scale = (1.0 - best) / doubt
    return np.concatenate([[best], weighed.shares[1:] * scale]), weighed.elsewhere * scale
