"""Sets of particles to start from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry import se2

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.world.occupancy import OccupancyGrid

DEFAULT_SPREAD = np.diag(np.square([0.5, 0.5, np.radians(15.0)]))


def gaussian(pose: FloatArray, covariance: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """Poses (n, 3) around a pose (3,), with a covariance (3, 3) of x, y [m] and yaw [rad], positive semidefinite."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    poses: FloatArray = pose + rng.standard_normal((n, 3)) @ root.T
    poses[:, 2] = se2.wrap(poses[:, 2])
    return poses


def uniform(grid: OccupancyGrid, n: int, rng: np.random.Generator) -> FloatArray:
    """Poses (n, 3) uniform over the free cells of a map, anywhere within the cell, with any yaw.

    Raises
    ------
    InputError
        If the map has no free cell.

    """
    rows, columns = np.nonzero(grid.free)
    if rows.size == 0:
        raise InputError("map: no cell is free, so there is nowhere to start from; check its thresholds")
    cell = rng.integers(rows.size, size=n)
    xy = grid.to_map(np.stack([columns[cell], rows[cell]], axis=-1) + rng.random((n, 2)))
    return np.column_stack([xy, np.pi - se2.TAU * rng.random(n)])
