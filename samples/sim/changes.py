"""The building as it is today, where the map shows it as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samples.sim.building import FREE, OCCUPIED, Building, Rect, paint
from samples.sim.layouts import scatter
from samples.sim.streams import Purpose, stream


def move_boxes(building: Building, seed: int, count: int) -> Building:
    """Building in which the first ``count`` boxes have gone elsewhere (at most that many: floor may be short)."""
    grid = np.array(building.grid)
    for box in building.boxes[:count]:
        paint(grid, box, FREE)
    height, width = (side * building.resolution for side in grid.shape)
    everywhere = [Rect(0.0, 0.0, width, height)]
    moved = scatter(stream(seed, Purpose.CHANGES), grid, everywhere, count, building.doors)
    return replace(building, grid=grid, boxes=moved + building.boxes[count:])


def close_doors(building: Building, doors: tuple[int, ...]) -> Building:
    """Building in which the doors with these indices into ``building.doors`` are shut."""
    grid = np.array(building.grid)
    for index in doors:
        paint(grid, building.doors[index], OCCUPIED)
    return replace(building, grid=grid)
