"""Where the robot may be: the global maximum, the places that compete, and how probable each is.

Exact searches over the map, of all scans joined and of stretches of the way, find candidates; those are refined,
followed through the window and merged (``places``), and weighed against each other and against not being on this map at
all (``evidence``, ``posterior``). The formula is in docs/locate.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.search import candidates, evidence
from mclcli.search.places import find_places
from mclcli.search.posterior import posterior
from mclcli.search.scene import sightings_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.arrays import FloatArray
    from mclcli.search.candidates import Candidates, Temper
    from mclcli.search.evidence import Evidence, Looked
    from mclcli.search.parameters import SearchParameters
    from mclcli.search.places import Places
    from mclcli.search.posterior import Posterior
    from mclcli.search.scene import Scene, View
    from mclcli.sensors.beams import Beams


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A place where the robot may be.

    ``pose`` (3,) of the base in map with ``covariance`` (3, 3); ``began`` (3,) and ``spread`` (3, 3) the same at the
    first scan of a window. ``log_likelihood`` is that of the scans at the poses of this place, by the field as it is
    searched, ``log_beam`` that of the beam model. ``share`` is the probability of this place; ``low`` and ``high`` hold
    it, whatever mass the places have that were not looked at. ``terms`` are those of its evidence; it is ``number`` of
    those that were looked at.
    """

    pose: FloatArray
    covariance: FloatArray
    began: FloatArray
    spread: FloatArray
    log_likelihood: float
    log_beam: float
    share: float
    low: float
    high: float
    terms: Mapping[str, float]
    number: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Location:
    """Places, the most probable first.

    ``elsewhere`` is the share of not being on this map, ``unlisted`` that of places on it which were not looked at;
    with the shares of all places they sum to 1. ``maximum`` is the greatest log-likelihood of any pose of the lattice
    of ``poses`` poses, cells of ``cell`` [m] and angles ``angle`` [rad] apart. ``alpha`` is the temperature, ``nats``
    how far below the best (tempered) every pose was enumerated, ``beams`` how many beams and sightings were scored.
    ``looked`` is what all places were weighed by, and ``left_out`` the mass that the searches left out, over theirs.
    """

    modes: tuple[Mode, ...]
    elsewhere: float
    unlisted: float
    maximum: float
    cell: float
    angle: float
    poses: int
    alpha: float
    nats: float
    leaves: int
    beams: int
    looked: Looked
    left_out: float


def locate(scene: Scene, view: View, parameters: SearchParameters, k: int, temper: Temper) -> Location | None:
    """Find the robot; None if no pose is allowed. ``temper`` gives α from the log p (B,) of beams at the best pose."""
    seen = sightings_of(scene, view.bearings, view.bearing_model)
    whole = candidates.look_for(scene, view.beams, parameters, temper, seen)
    if whole is None:
        return None
    found: list[tuple[Candidates, int, Beams]] = [(whole, len(view.sights) - 1, view.beams)]
    for stretch in view.stretches:
        of_stretch = candidates.look_for(scene, stretch.beams, parameters, temper)
        if of_stretch is not None:
            found.append((of_stretch, stretch.last, stretch.beams))
    places = find_places(scene, view, found, parameters, temper)
    looked = evidence.look(scene, view, places, temper)
    weighed = evidence.weigh(looked)
    left_out = min(one.missed + one.pruned for one, _, _ in found)
    shares = posterior(weighed, left_out, parameters.off_map_prior)
    return Location(
        modes=_modes(scene, view, places, weighed, shares, k),
        elsewhere=shares.elsewhere,
        unlisted=shares.unlisted,
        maximum=whole.maximum,
        cell=scene.model.field.resolution,
        angle=whole.spacing,
        poses=whole.lattice.size,
        alpha=float(places.ends.alphas.mean()),
        nats=whole.nats,
        leaves=whole.leaves,
        beams=view.beams.ranges.size + len(seen.marks),
        looked=looked,
        left_out=left_out,
    )


def _modes(scene: Scene, view: View, places: Places, weighed: Evidence, shares: Posterior, k: int) -> tuple[Mode, ...]:
    """The foremost places."""
    foremost = shares.order[:k]
    log_likelihood, log_beam = weighed.bearings[foremost], np.zeros(len(foremost))
    for n, sight in enumerate(view.sights):
        poses = np.ascontiguousarray(places.paths[foremost, n])
        log_likelihood = log_likelihood + scene.model.measure("lidar", sight.beams).log_likelihood(poses)
        log_beam += scene.rays.measure("lidar", sight.rays).log_likelihood(poses)
    return tuple(
        Mode(
            pose=places.paths[number, -1],
            covariance=places.covariances[number],
            began=places.paths[number, 0],
            spread=places.first[number],
            log_likelihood=float(log_likelihood[rank]),
            log_beam=float(log_beam[rank]),
            share=float(shares.shares[rank]),
            low=float(shares.low[rank]),
            high=float(shares.high[rank]),
            terms={name: float(getattr(weighed, name)[number]) for name in evidence.Evidence.__slots__},
            number=number,
        )
        for rank, number in enumerate(foremost.tolist())
    )
