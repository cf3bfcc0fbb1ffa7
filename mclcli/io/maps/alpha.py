"""Opacity in the image of a map, where map servers differ: said, with the cells that come out otherwise elsewhere.

What is not opaque is unknown here, as in nav2's map_server since May 2025 (Jazzy, Kilted and later; ``mode`` trinary
and scale). ROS 1's and that of nav2 before (Humble, Iron) average opacity with the three colours in mode trinary:
p = 1 − (R + G + B + A) / (4 · 255), occupied where p > occupied_thresh, free where p < free_thresh.
Sources: nav2_map_server/src/map_io.cpp of branches humble, jazzy and main; map_server/src/image_loader.cpp of ROS 1.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.io.maps.image import Raster
    from mclcli.io.maps.map_description import MapDescription

_OPAQUE = 255


def tell(raster: Raster, description: MapDescription, cells: NDArray[np.int8], name: str) -> None:
    """Warn if an image with opacity makes other cells (H, W) than ``cells`` where opacity is averaged."""
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
