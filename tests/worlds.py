"""Maps drawn as text: ``#`` occupied, ``.`` free, ``?`` unknown; the top line has the highest y."""

from __future__ import annotations

import numpy as np

from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

_SIGNS = {"#": OCCUPIED, ".": FREE, "?": UNKNOWN}


def drawn(picture: str, resolution: float = 1.0, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OccupancyGrid:
    """Map of a drawing; white space around its lines is dropped, and they must be equally long."""
    rows = [line.strip() for line in picture.split("\n") if line.strip()]
    cells = np.array([[_SIGNS[sign] for sign in row] for row in reversed(rows)], dtype=np.int8)
    return OccupancyGrid(cells, resolution, np.array(origin))


def empty(width: int, height: int, resolution: float = 1.0) -> OccupancyGrid:
    """Map without an obstacle, its lower left corner at (0, 0)."""
    return OccupancyGrid(np.zeros((height, width), np.int8), resolution, np.zeros(3))


def room(resolution: float = 0.1) -> OccupancyGrid:
    """Room of 30 × 20 cells whose walls, pillar and corner of unknown cells fit in one way only."""
    cells = np.zeros((20, 30), np.int8)
    cells[[0, -1], :] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[5:8, 20:22] = OCCUPIED
    cells[14:19, 1:4] = UNKNOWN
    return OccupancyGrid(cells, resolution, np.array([-1.0, -0.5, 0.0]))
