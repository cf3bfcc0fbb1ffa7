"""Branch and bound as the rest of the search sees it: the best leaf, and all leaves near it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.native.backend import load
from mclcli.search import cost_tables
from mclcli.world.pyramid import FINE

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.cost_tables import CostTables, Nodes
    from mclcli.search.lattice import Lattice
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.pyramid import Pyramid

_SHORT_OF_PERFECT = (0.1, 0.3, 1.0, 3.0, math.inf)  # nats a beam
_NO_KEY = 2**62
_NONE = np.empty(0)
_LEAVES = 64  # of a fine node
_FURTHEST = 10.0  # nats, untempered, by which a node of many leaves is followed further than a leaf
_WORTHLESS = 7.0  # all leaves that are not looked at together weigh at most e^−7 of the best one


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """Bearings that add to the score of a leaf; empty where there are none.

    ``marks`` (M, 5): column, row [cells] of the landmark, the bearing [rad] to it from the base's heading, and where
    the camera is on the base, x, y [cells]. ``law`` (5,): p = law[0]·exp(law[1]·e²) + law[2], at least law[3]; law[4]
    is the most that all of them can add.
    """

    marks: FloatArray
    law: FloatArray


NO_SIGHTINGS = Sightings(np.zeros((0, 5)), np.array([0.0, 0.0, 1.0, 1.0, 0.0]))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Leaves by key, (angle·H + row)·W + column: the best one, and those within some slack of it, the best first.

    ``pruned`` bounds Σ exp(alpha·(value − best)) over all other leaves.
    """

    best: float
    key: int
    keys: IntArray
    values: FloatArray
    pruned: float


@final
class _Incumbent:
    """The best leaf so far, and the leaves near it: ``written`` of ``keys`` and ``values``."""

    def __init__(self, value: float, key: int, room: int = 0) -> None:
        self.value, self.key = value, key
        self.keys, self.values = np.empty(room, np.int64), np.empty(room)
        self.written = 0
        self.pruned = 0.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """A scan over a field: ``log_p`` (L + 1,) is the value of every level of the field, and of off the map."""

    field: DistanceField
    pyramid: Pyramid
    lattice: Lattice
    log_p: FloatArray
    sightings: Sightings
    costs: CostTables

    def maximum(self) -> tuple[float, int]:
        """The greatest value of a leaf and its key; (−inf, −1) if no cell is allowed. Of equals the least key."""
        if not self.lattice.size:
            return -math.inf, -1
        # A threshold that the best leaf may reach prunes from the start; if no leaf does, a lower one is tried.
        beams, extra = self.lattice.ends.shape[1], float(self.sightings.law[4])
        perfect = self.costs.perfect + extra
        for short in _SHORT_OF_PERFECT:
            found = _Incumbent(perfect - short * max(beams, 1), _NO_KEY)
            state = np.zeros(4, np.int64)
            while not self.costs.done(state):
                limit = self.costs.within(found.value - extra)
                self._look(self.costs.sweep(state, limit, limit, _NONE), found)
            if found.key != _NO_KEY:
                break
        return found.value, found.key

    def near(self, best: float, key: int, slack: float, alpha: float, room: int) -> Found | None:
        """All leaves within ``slack`` of the best one; None if they are more than ``room``."""
        extra = float(self.sightings.law[4])
        floor = best - extra - (math.log(self.lattice.size) + _WORTHLESS) / alpha
        limit = self.costs.within(best - extra - slack - min(math.log(_LEAVES) / alpha, _FURTHEST))
        stop = max(self.costs.within(floor), limit)
        weights = np.exp(alpha * (self.costs.bounds(np.arange(stop + 1, dtype=np.int32)) + extra - best))
        found = _Incumbent(best, key, room)
        if stop < self.costs.most:
            found.pruned += math.exp(-_WORTHLESS)
        state = np.zeros(4, np.int64)
        while not self.costs.done(state):
            nodes = self.costs.sweep(state, limit, stop, weights)
            found.pruned += nodes.mass
            if not self._look(nodes, found, slack, alpha, weights):
                return None
        keys, values = found.keys[: found.written], found.values[: found.written]
        order = np.lexsort((keys, -values))
        return Found(best, key, keys[order], values[order], found.pruned)

    def _look(
        self,
        nodes: Nodes,
        found: _Incumbent,
        slack: float = 0.0,
        alpha: float = 0.0,
        weights: FloatArray = _NONE,
    ) -> bool:
        """Look at the poses of nodes, the best first; False if there is no room for what was found."""
        order = np.argsort(nodes.costs, kind="stable")
        grid, seen, plane = self.lattice, self.sightings, self.costs.leaves
        whole, real = np.array([found.key, found.written], np.int64), np.array([found.value, found.pruned])
        load("leaves").look(
            plane.cells, plane.width, plane.starts, self.costs.perfect, self.costs.step,
            self.pyramid.pool, self.pyramid.shapes[FINE], self.costs.table, self.field.codes,
            grid.ends, plane.counts, self.log_p, seen.marks, seen.law, grid.angles,
            nodes.places[order], nodes.costs[order], slack, alpha, weights,
            found.keys, found.values, whole, real, np.empty(64, np.uint16),
        )  # fmt: skip
        found.key, found.written = int(whole[0]), int(whole[1])
        found.value, found.pruned = float(real[0]), float(real[1])
        return found.written >= 0


def prepare(
    field: DistanceField,
    pyramid: Pyramid,
    lattice: Lattice,
    log_p: FloatArray,
    sightings: Sightings = NO_SIGHTINGS,
) -> Search:
    """Make a search ready: what every beam costs everywhere."""
    return Search(field, pyramid, lattice, log_p, sightings, cost_tables.lay_out(field, pyramid, lattice, log_p))
