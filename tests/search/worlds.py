"""Small worlds for the search: random maps and scans, drawn by Hypothesis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import strategies as st

from mclcli.search import branching, lattice
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world import distance_field, pyramid
from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

if TYPE_CHECKING:
    from mclcli.search.branching import Search

R_MAX = 9.0


@dataclass(frozen=True)
class World:
    """A map, the endpoints (B, 2) [cells] of a scan in the base frame, and which cells may hold the base."""

    grid: OccupancyGrid
    ends: np.ndarray
    allowed: np.ndarray
    parameters: LikelihoodFieldParameters

    def search(self) -> Search:
        """The compiled search."""
        mark = self.parameters.field_unknown == "uniform"
        field = distance_field.compute(self.grid, "exact", 0.7, mark_unknown=mark)
        table = LikelihoodField(field, self.parameters).table(R_MAX)
        found = lattice.build(self.ends, lattice.count_places(self.allowed))
        return branching.prepare(field, pyramid.build(field), found, table)


@st.composite
def worlds(draw: st.DrawFn, largest: int = 24) -> World:
    """Random worlds: rooms and noise, scans near and far, some of them beyond the map."""
    height, width = draw(st.integers(1, largest)), draw(st.integers(1, largest))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    density = draw(st.sampled_from([0.01, 0.1, 0.5]))
    cells = np.where(rng.random((height, width)) < density, OCCUPIED, FREE).astype(np.int8)
    cells[rng.random((height, width)) < draw(st.sampled_from([0.0, 0.3]))] = UNKNOWN
    reach = draw(st.sampled_from([1.5, 6.0, 40.0]))
    beams = draw(st.integers(0, 9))
    angles, ranges = rng.uniform(-math.pi, math.pi, beams), rng.uniform(0.0, reach, beams)
    ends = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    if draw(st.booleans()):
        ends = np.round(ends)  # on the lattice: many poses tie
    allowed = rng.random((height, width)) < draw(st.sampled_from([0.2, 1.0]))
    parameters = LikelihoodFieldParameters(
        sigma_hit=0.15,
        off_map=draw(st.sampled_from(["max_dist", "uniform"])),
        field_unknown=draw(st.sampled_from(["free", "uniform"])),
    )
    return World(OccupancyGrid(cells, 0.1, np.array([3.0, -2.0, 0.4])), ends, allowed, parameters)
