"""What is odd about a map that is loaded all the same, in one line each.

It can hardly be meant as it is written, or its image has opacity, where map servers differ.
"""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.quantity import looks_like_degrees
from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.io.maps.image import Raster
    from mclcli.io.maps.map_description import MapDescription
    from mclcli.io.tables.safe_yaml import Document
    from mclcli.world.occupancy import OccupancyGrid

_MOSTLY_WALL = 0.6
_COARSE, _FINE = 1.0, 1e-3  # m per cell
_OPAQUE = 255


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


def tell_opacity(raster: Raster, description: MapDescription, cells: NDArray[np.int8], name: str) -> None:
    """Warn if an image with opacity makes other cells (H, W) than ``cells`` where opacity is averaged.

    What is not opaque is unknown here, as in nav2's map_server since May 2025 (Jazzy, Kilted and later; ``mode``
    trinary and scale). ROS 1's and that of nav2 before (Humble, Iron) average opacity with the three colours in mode
    trinary: p = 1 − (R + G + B + A) / (4 · 255), occupied where p > occupied_thresh, free where p < free_thresh.
    Sources: nav2_map_server/src/map_io.cpp of branches humble, jazzy and main; map_server/src/image_loader.cpp of
    ROS 1.
    """
    if raster.sums is None or description.mode != "trinary":
        return
    others = int(np.count_nonzero(averaged(raster.sums, description) != cells))
    if others:
        share = 100.0 * others / cells.size
        logging.getLogger("mclcli").warning(
            "%s: has an alpha channel: %d cells (%.2g %%) are others in ROS 1 and nav2 up to Iron, which average "
            "opacity into the colour; here, as in later nav2, what is not opaque is unknown; save it without alpha",
            name,
            others,
            share,
        )


def averaged(sums: NDArray[np.uint16], description: MapDescription) -> NDArray[np.int8]:
    """Cells (H, W), row 0 at the bottom, of R + G + B + A (H, W) where opacity is averaged with the colours."""
    shade = np.arange(4 * _OPAQUE + 1) / (4 * _OPAQUE)
    p = shade if description.negate else 1.0 - shade
    table = np.full(p.shape, UNKNOWN, np.int8)
    table[p < description.free_thresh] = FREE
    table[p > description.occupied_thresh] = OCCUPIED
    found: NDArray[np.int8] = table[sums[::-1]]
    return found
