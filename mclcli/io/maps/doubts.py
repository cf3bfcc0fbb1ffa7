"""Maps that can hardly be meant as they are written: loaded all the same, with one line that names the likely slip."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.quantity import looks_like_degrees
from mclcli.world.occupancy import OCCUPIED

if TYPE_CHECKING:
    from mclcli.io.maps.map_description import MapDescription
    from mclcli.io.tables.safe_yaml import Document
    from mclcli.world.occupancy import OccupancyGrid

_MOSTLY_WALL = 0.6
_COARSE, _FINE = 1.0, 1e-3  # m per cell


def tell(grid: OccupancyGrid, description: MapDescription, document: Document) -> None:
    """Warn, in one line for the map and one for its yaw."""
    doubts = [*_doubts_of_cells(grid, description), *_doubts_of_resolution(description)]
    logger = logging.getLogger("mclcli")
    if doubts:
        logger.warning("%s: can hardly be meant: %s", document.name, "; ".join(doubts))
    yaw = description.origin[2]
    if looks_like_degrees(yaw):
        logger.warning(
            "%s: origin: yaw %g rad looks like degrees, line %d; for %g deg write %.6g",
            document.name,
            yaw,
            document.line("origin"),
            yaw,
            math.radians(yaw),
        )


def _doubts_of_cells(grid: OccupancyGrid, description: MapDescription) -> list[str]:
    occupied = int(np.count_nonzero(grid.cells == OCCUPIED)) / grid.cells.size
    rule = f"negate ({int(description.negate)})"
    if description.mode != "raw":
        rule += f", occupied_thresh ({description.occupied_thresh:g}) and free_thresh ({description.free_thresh:g})"
    if occupied > _MOSTLY_WALL:
        return [f"{100.0 * occupied:.0f} % of its cells are occupied; check {rule}"]
    likely_free = grid.cells < OCCUPIED // 2
    if not np.any(likely_free & ~grid.unknown):
        return [f"none of its cells is free; check {rule}"]
    return []


def _doubts_of_resolution(description: MapDescription) -> list[str]:
    resolution = description.resolution
    if _FINE <= resolution <= _COARSE:
        return []
    return [f"its cells are {resolution:g} m wide; check resolution (metres per cell)"]
