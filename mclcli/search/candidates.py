"""Candidates: the peaks of one exact search, with the mass of the poses around each and of those around none.

A search may be of one scan, or of a few scans that odometry joins rigidly: a stretch of a window.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.search import branching, lattice
from mclcli.search.branching import NO_SIGHTINGS, Found

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.branching import Search, Sightings
    from mclcli.search.lattice import Lattice
    from mclcli.search.parameters import SearchParameters
    from mclcli.search.scene import Scene
    from mclcli.sensors.beams import Beams

    Temper = Callable[[FloatArray], float]

MOST = 32  # peaks that are looked for
ROOM = 60_000  # leaves that are enumerated at most
_SHALLOWEST = 0.05  # nats
_DEEPEST = 25.0  # nats, untempered: no leaf further below the best is enumerated, or flat scores would take minutes


@final
@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """Peaks, the highest first: ``keys`` (M,), ``values`` (M,) and ``masses`` (M,).

    A mass is Σ exp(alpha·(value − best)) over the leaves around a peak; ``rest`` is that of those around none of them.
    """

    keys: IntArray
    values: FloatArray
    masses: FloatArray
    rest: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Nodes (M, 3) of the peaks in map, the highest first, and what the search says of itself.

    ``maximum`` is the greatest log-likelihood of any of the ``lattice``'s poses, at the first node; ``alpha`` the
    temperature at which ``leaves`` poses within ``nats`` of it were enumerated. ``missed`` is the mass of poses around
    no peak, over that around all peaks; ``pruned`` bounds that of poses which were not enumerated, in the same unit.
    """

    nodes: FloatArray
    lattice: Lattice
    maximum: float
    alpha: float
    nats: float
    leaves: int
    missed: float
    pruned: float

    @property
    def spacing(self) -> float:
        """Step [rad] of the angles."""
        return self.lattice.step


def look_for(
    scene: Scene, beams: Beams, parameters: SearchParameters, temper: Temper, sightings: Sightings = NO_SIGHTINGS
) -> Candidates | None:
    """Candidates for beams with a return; None if no pose is allowed.

    ``temper`` gives α from the log p (B,) of the beams at the best pose.
    """
    field = scene.model.field
    turned = field.origin[2] if scene.anchoring.yaw else 0.0
    about = (scene.about[0] - turned, scene.about[1])
    grid = lattice.build(beams.endpoints / field.resolution, scene.places, about)
    search = branching.prepare(field, scene.pyramid, grid, scene.model.table(beams.r_max), sightings)
    best, key = search.maximum()
    if key < 0:
        return None
    top = scene.to_map(grid.poses(np.array([key])))[0]
    alpha = temper(scene.model.each(beams, top[np.newaxis])[0]) if beams.ranges.size > 1 else 1.0
    found, nats = _enumerate(search, best, key, alpha, parameters.leaf_nats)
    peaks = find_peaks(found, grid, alpha, parameters.mode_distance / field.resolution, parameters.mode_angle)
    inside = float(peaks.masses.sum())
    return Candidates(
        nodes=scene.to_map(grid.poses(peaks.keys)),
        lattice=grid,
        maximum=best,
        alpha=alpha,
        nats=nats,
        leaves=found.keys.size,
        missed=peaks.rest / inside,
        pruned=found.pruned / inside,
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


def find_peaks(found: Found, lattice: Lattice, alpha: float, radius: float, angle: float) -> Peaks:
    """Peaks of the leaves; those within ``radius`` [cells] and ``angle`` [rad] of a higher peak belong to it."""
    poses, mass = lattice.poses(found.keys), np.exp(alpha * (found.values - found.best))
    left = np.arange(found.keys.size)
    numbers: list[int] = []
    masses: list[float] = []
    while left.size and len(numbers) < MOST:
        peak = poses[left[0]]
        offset = poses[left] - peak
        near = (offset[:, 0] ** 2 + offset[:, 1] ** 2 <= radius**2) & (np.abs(se2.wrap(offset[:, 2])) <= angle)
        numbers.append(int(left[0]))
        masses.append(float(mass[left[near]].sum()))
        left = left[~near]
    return Peaks(found.keys[numbers], found.values[numbers], np.array(masses), float(mass[left].sum()))
