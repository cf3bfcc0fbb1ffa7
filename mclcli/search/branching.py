"""Branch and bound as the rest of the search sees it: the best leaf, and all leaves near it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import compiled
from mclcli.world import pyramid as pyramids

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.search.lattice import Lattice
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.pyramid import Pyramid

_SHORT_OF_PERFECT = (0.1, 0.3, 1.0, 3.0, math.inf)  # nats a beam
_NO_KEY = 2**62


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """Bearings that add to the score of a leaf; empty where there are none.

    ``marks`` (M, 5): column, row [cells] of the landmark, the bearing [rad] to it from the base's heading, and where
    the camera is on the base, x, y [cells]. ``law`` (5,): p = law[0]·exp(law[1]·e²) + law[2], at least law[3]; law[4]
    is the most that all of them can add.
    """

    marks: NDArray[np.float64]
    law: NDArray[np.float64]


NO_SIGHTINGS = Sightings(np.zeros((0, 5)), np.array([0.0, 0.0, 1.0, 1.0, 0.0]))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Leaves by key, (angle·H + row)·W + column: the best one, and those within some slack of it, the best first.

    ``pruned`` bounds Σ exp(alpha·(value − best)) over all other leaves.
    """

    best: float
    key: int
    keys: NDArray[np.int64]
    values: NDArray[np.float64]
    pruned: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """A scan over a field: ``log_p`` (L + 1,) is the value of every level of the field, and of off the map."""

    field: DistanceField
    pyramid: Pyramid
    lattice: Lattice
    log_p: NDArray[np.float64]
    sightings: Sightings
    table: NDArray[np.float64]
    roots: NDArray[np.int64]
    bounds: NDArray[np.float64]

    def maximum(self) -> tuple[float, int]:
        """The greatest value of a leaf and its key; (−inf, −1) if no cell is allowed. Of equals the least key."""
        if not len(self.roots):
            return -math.inf, -1
        # A threshold that the best leaf may reach prunes from the start; if no leaf does, a lower one is tried.
        beams = self.lattice.ends.shape[1]
        perfect = float(self.table[0]) * beams + self.sightings.law[4]
        for short in _SHORT_OF_PERFECT:
            best, key, _, _ = self._descend((perfect - short * max(beams, 1), _NO_KEY))
            if key != _NO_KEY:
                break
        return best, key

    def near(self, best: float, key: int, slack: float, alpha: float, room: int) -> Found | None:
        """All leaves within ``slack`` of the best one; None if they are more than ``room``."""
        keys, values = np.empty(room, np.int64), np.empty(room)
        _, _, found, pruned = self._descend((best, key), slack=slack, alpha=alpha, into=(keys, values))
        if found < 0:
            return None
        order = np.lexsort((keys[:found], -values[:found]))
        return Found(best, key, keys[:found][order], values[:found][order], pruned)

    def _descend(
        self,
        incumbent: tuple[float, int],
        *,
        slack: float = 0.0,
        alpha: float = 0.0,
        into: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None,
    ) -> tuple[float, int, int, float]:
        keys, values = into or (np.empty(0, np.int64), np.empty(0))
        grid, seen, level = self.lattice, self.sightings, self.lattice.frames.shape[0] - 1
        whole, real = np.array([incumbent[1], 0], np.int64), np.array([incumbent[0], 0.0])
        room = 16 * (level + 2)
        compiled.load("branch_and_bound").descend(
            self.field.codes, self.pyramid.pool, self.pyramid.shapes, grid.frames, grid.ends,
            grid.places.counts, grid.places.firsts, self.log_p, float(self.log_p.max()), self.table,
            seen.marks, seen.law, grid.angles, self.roots, self.bounds, level, slack, alpha,
            keys, values, whole, real, np.empty((room, 4), np.int64), np.empty(room),
        )  # fmt: skip
        return float(real[0]), int(whole[0]), int(whole[1]), float(real[1])


def prepare(
    field: DistanceField,
    pyramid: Pyramid,
    lattice: Lattice,
    log_p: NDArray[np.float64],
    sightings: Sightings = NO_SIGHTINGS,
) -> Search:
    """Bound the nodes of the highest level, and put them in order: the best first, of equals the first."""
    table = pyramids.bound_table(field, log_p)
    level = lattice.frames.shape[0] - 1
    bounds = np.empty(int(lattice.frames[level, 1:].prod()))
    compiled.load("branch_and_bound").bound_roots(
        pyramid.pool, pyramid.shapes, lattice.frames, lattice.ends, lattice.places.counts,
        int(lattice.places.firsts[level]), level, table, bounds,
    )  # fmt: skip
    order = np.argsort(-bounds, kind="stable")[: int(np.isfinite(bounds).sum())]
    roots = np.column_stack(np.unravel_index(order, lattice.frames[level, 1:])).astype(np.int64)
    return Search(field, pyramid, lattice, log_p, sightings, table, np.ascontiguousarray(roots), bounds[order])
