"""The seam between the readable formula and the compiled loop: sums of a table over the cells where beams end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import compiled

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mclcli.world.distance_field import DistanceField

BLOCK = 4096  # poses whose temporaries stay in the second-level cache


@final
@dataclass(frozen=True, slots=True)
class Anchoring:
    """How a point finds its cell: shifted by half a cell as in nav2_amcl or not, heeding the origin's yaw or not."""

    half_cell: bool = False
    yaw: bool = True

    def to_cells(
        self, field: DistanceField, poses: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Poses (N, 3) in map as column, row [cells, continuous] and yaw [rad] in the field's own frame."""
        origin_x, origin_y, origin_yaw = field.origin
        shift = 0.5 if self.half_cell else 0.0
        dx, dy = poses[:, 0] - origin_x, poses[:, 1] - origin_y
        if origin_yaw == 0.0 or not self.yaw:
            return dx / field.resolution + shift, dy / field.resolution + shift, poses[:, 2].copy()
        c, s = math.cos(origin_yaw), math.sin(origin_yaw)
        column, row = (c * dx + s * dy) / field.resolution, (c * dy - s * dx) / field.resolution
        return column + shift, row + shift, poses[:, 2] - origin_yaw


CORNER = Anchoring()


def sum_table(
    field: DistanceField,
    table: NDArray[np.float64],
    endpoints: NDArray[np.float64],
    poses: NDArray[np.float64],
    *,
    anchoring: Anchoring = CORNER,
    job_size: float = 0.0,
    threads: int = 1,
) -> NDArray[np.float64]:
    """Σ_b table[code of the cell where beam b ends] (N,), for endpoints (B, 2) [m] in the base frame, poses (N, 3).

    ``table`` (L + 1,) holds a value per level of the field, and one more for endpoints off the map. ``job_size`` hints
    how many pose·beam pairs will be summed in all. Beams are added in their order: every path gives the same bits.
    """
    ends = endpoints / field.resolution
    end_x, end_y = np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1])
    steps = max(job_size, poses.shape[0] * end_x.size)
    add = compiled.load("likelihood_field").sum_log_p if compiled.worth_compiling(steps) else add_table
    out = np.zeros(poses.shape[0])

    def sum_block(start: int) -> None:
        x, y, yaw = anchoring.to_cells(field, poses[start : start + BLOCK])
        add(field.codes, table, x, y, np.cos(yaw), np.sin(yaw), end_x, end_y, out[start : start + BLOCK])

    for_each(sum_block, range(0, poses.shape[0], BLOCK), threads)
    return out


def for_each(task: Callable[[int], None], starts: range, threads: int) -> None:
    """Run independent blocks; the result is the same for any number of threads."""
    if threads == 1 or len(starts) == 1:
        for start in starts:
            task(start)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(task, starts))


def add_table(
    codes: NDArray[np.uint16] | NDArray[np.uint32],
    table: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    cos: NDArray[np.float64],
    sin: NDArray[np.float64],
    end_x: NDArray[np.float64],
    end_y: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """The formula in NumPy; equal to the bit to the kernel ``likelihood_field.sum_log_p``, which see."""
    height, width = codes.shape
    for bx, by in zip(end_x, end_y, strict=True):
        column = np.floor(x + (cos * bx - sin * by))
        row = np.floor(y + (sin * bx + cos * by))
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        cell = np.where(inside, row * width + column, 0).astype(np.intp)
        out += np.where(inside, table[codes.ravel()[cell]], table[-1])


def distances(
    field: DistanceField,
    endpoints: NDArray[np.float64],
    poses: NDArray[np.float64],
    *,
    bilinear: bool = False,
    anchoring: Anchoring = CORNER,
) -> NDArray[np.float64]:
    """Distance to the nearest obstacle (N, B) [m] at each endpoint; +inf off the map.

    ``bilinear`` interpolates between the centres of the four nearest cells, which near the border are repeated.
    """
    x, y, yaw = anchoring.to_cells(field, poses)
    ends = endpoints / field.resolution
    c, s = np.cos(yaw)[:, np.newaxis], np.sin(yaw)[:, np.newaxis]
    column = x[:, np.newaxis] + (c * ends[:, 0] - s * ends[:, 1])
    row = y[:, np.newaxis] + (s * ends[:, 0] + c * ends[:, 1])
    height, width = field.codes.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    found = (
        _bilinear(field, column, row)
        if bilinear
        else field.levels[field.codes[_cell(row, height), _cell(column, width)]]
    )
    return np.where(inside, found, np.inf)


def _cell(coordinate: NDArray[np.float64], size: int) -> NDArray[np.intp]:
    return np.clip(np.floor(coordinate), 0, size - 1).astype(np.intp)


def _bilinear(field: DistanceField, column: NDArray[np.float64], row: NDArray[np.float64]) -> NDArray[np.float64]:
    height, width = field.codes.shape
    column, row = column - 0.5, row - 0.5
    u, v = column - np.floor(column), row - np.floor(row)
    left, right = _cell(column, width), _cell(column + 1.0, width)
    below, above = _cell(row, height), _cell(row + 1.0, height)
    levels, codes = field.levels, field.codes
    lower = (1.0 - u) * levels[codes[below, left]] + u * levels[codes[below, right]]
    upper = (1.0 - u) * levels[codes[above, left]] + u * levels[codes[above, right]]
    return np.asarray((1.0 - v) * lower + v * upper)
