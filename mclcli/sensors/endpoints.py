"""The seam between the readable formula and the compiled loop: sums of a table over the cells where beams end."""

from __future__ import annotations

import collections
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry.trigonometry import cos_sin
from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import SimpleNamespace

    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.world.distance_field import Codes, DistanceField

BLOCK = 4096  # poses whose temporaries stay in the second-level cache
PAIRS = 32768  # pose·beam pairs, likewise
COMPILED_BLOCK = 8192  # a kernel keeps its own, smaller blocks; this is a thread's share
_CELLS_OF_A_KERNEL = 2**31  # beyond, its indices do not reach


@final
@dataclass(frozen=True, slots=True)
class Anchoring:
    """How a point finds its cell: shifted by half a cell as in nav2_amcl or not, heeding the origin's yaw or not."""

    half_cell: bool = False
    yaw: bool = True

    def frame(self, field: DistanceField) -> tuple[float, ...]:
        """Where the cells lie: x, y [m], cosine, sine, yaw of their frame in map, side of a cell [m], shift [cells]."""
        x, y, yaw = field.origin.tolist()
        yaw = yaw if self.yaw else 0.0
        return x, y, math.cos(yaw), math.sin(yaw), yaw, field.resolution, 0.5 if self.half_cell else 0.0

    def to_cells(self, field: DistanceField, poses: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Poses (N, 3) in map as column, row [cells, continuous] and yaw [rad] in the field's own frame."""
        origin_x, origin_y, c, s, origin_yaw, resolution, shift = self.frame(field)
        dx, dy = poses[:, 0] - origin_x, poses[:, 1] - origin_y
        column, row = (c * dx + s * dy) / resolution, (c * dy - s * dx) / resolution
        return column + shift, row + shift, poses[:, 2] - origin_yaw


CORNER = Anchoring()


def sum_table(
    field: DistanceField,
    table: FloatArray,
    endpoints: FloatArray,
    poses: FloatArray,
    *,
    anchoring: Anchoring = CORNER,
    backend: Backend = NUMPY,
    threads: int = 1,
) -> FloatArray:
    """Σ_b table[code of the cell where beam b ends] (N,), for endpoints (B, 2) [m] in the base frame, poses (N, 3).

    ``table`` (L + 1,) holds a value per level of the field, and one more for endpoints off the map. Beams are added in
    their order: both backends give the same bits.
    """
    ends, out = in_cells(field, endpoints), np.zeros(poses.shape[0])
    kernels = kernels_over(field, backend, "likelihood_field")
    block = BLOCK if kernels is None else COMPILED_BLOCK

    def sum_block(start: int) -> None:
        some, total = poses[start : start + block], out[start : start + block]
        if kernels is None:
            add_table(field, table, anchoring, some, ends, total)
            return
        scratch, about = (np.empty((5, 256)), np.empty((4, 256), np.int32)), (field.codes.ravel(), *field.codes.shape)
        some = np.ascontiguousarray(some)
        kernels.sum_log_p(*about, table, *anchoring.frame(field), some, ends.ravel(), total, *scratch)

    for_each(sum_block, range(0, poses.shape[0], block), threads)
    return out


def in_cells(field: DistanceField, endpoints: FloatArray) -> FloatArray:
    """Endpoints (B, 2) [m] as (2, B) [cells], in C order."""
    return np.divide(endpoints.T, field.resolution, order="C")


def kernels_over(field: DistanceField, backend: Backend, module: str) -> SimpleNamespace | None:
    """The backend's kernels of a module, if the field is not too large for them."""
    return backend.kernels(module) if field.codes.size < _CELLS_OF_A_KERNEL else None


def add_table(
    field: DistanceField,
    table: FloatArray,
    anchoring: Anchoring,
    poses: FloatArray,
    ends: FloatArray,
    out: FloatArray,
) -> None:
    """Add to ``out`` (N,) the table's value of the cell where each beam ends, ``ends`` (2, B) [cells], beam by beam."""
    for _, inside, cell in _cells(field, anchoring, poses, ends):
        out += np.where(inside, table[field.codes.ravel()[cell]], table[-1])


def _cells(
    field: DistanceField, anchoring: Anchoring, poses: FloatArray, ends: FloatArray
) -> Iterator[tuple[int, BoolArray, NDArray[np.intp]]]:
    """Beam by beam: its number, which of its endpoints (N,) are on the map, and their cells."""
    height, width = field.codes.shape
    x, y, yaw = anchoring.to_cells(field, poses)
    cos, sin = cos_sin(yaw)
    for beam, (end_x, end_y) in enumerate(ends.T):
        column = np.floor(x + (cos * end_x - sin * end_y))
        row = np.floor(y + (sin * end_x + cos * end_y))
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        yield beam, inside, np.where(inside, row * width + column, 0).astype(np.intp)


def look_up(
    field: DistanceField,
    endpoints: FloatArray,
    poses: FloatArray,
    *,
    anchoring: Anchoring = CORNER,
    backend: Backend = NUMPY,
) -> Codes:
    """Code (B, N) of the cell where each beam ends, the number of levels off the map; arguments as of ``sum_table``."""
    ends, off_map = in_cells(field, endpoints), field.levels.size
    found = np.empty((ends.shape[1], poses.shape[0]), field.codes.dtype)
    kernels = kernels_over(field, backend, "likelihood_field")
    if kernels is not None:
        scratch = np.empty((5, 256)), np.empty((4, 256), np.int32)
        poses, frame = np.ascontiguousarray(poses), anchoring.frame(field)
        kernels.look_up(field.codes.ravel(), *field.codes.shape, off_map, *frame, poses, ends.ravel(), found, *scratch)
        return found
    for start in range(0, poses.shape[0], BLOCK):
        block = slice(start, start + BLOCK)
        for beam, inside, cell in _cells(field, anchoring, poses[block], ends):
            found[beam, block] = np.where(inside, field.codes.ravel()[cell], off_map)
    return found


def count_below(found: Codes, limit: int, backend: Backend = NUMPY) -> IntArray:
    """How many codes of each row (B,) of ``found`` (B, N) are below a limit."""
    kernels = backend.kernels("likelihood_field")
    if kernels is None:
        return np.asarray(np.count_nonzero(found < limit, axis=1), np.int64)
    counts = np.zeros(found.shape[0], np.int64)
    kernels.count_below(found, limit, counts)
    return counts


def sum_looked_up(found: Codes, table: FloatArray, backend: Backend = NUMPY) -> FloatArray:
    """Σ_b table[found[b]] (N,): with ``look_up``, the same as ``sum_table``, to the bit."""
    out, kernels = np.zeros(found.shape[1]), backend.kernels("likelihood_field")
    if kernels is not None:
        kernels.sum_looked_up(found, table, out)
        return out
    for row in found:
        out += table[row]
    return out


def for_each(task: Callable[[int], None], starts: range, threads: int) -> None:
    """Run independent blocks; the result is the same for any number of threads.

    Each thread, this one among them, takes the next block as soon as it is done with one.
    """
    if threads == 1 or len(starts) <= 1:
        for start in starts:
            task(start)
        return
    from concurrent.futures import ThreadPoolExecutor

    waiting, helpers = collections.deque(starts), min(threads, len(starts)) - 1

    def work() -> None:
        while True:
            try:
                start = waiting.popleft()
            except IndexError:  # the others took the rest
                return
            task(start)

    with ThreadPoolExecutor(helpers) as pool:
        helping = [pool.submit(work) for _ in range(helpers)]
        work()
    for one in helping:
        one.result()


def distances(
    field: DistanceField,
    endpoints: FloatArray,
    poses: FloatArray,
    *,
    bilinear: bool = False,
    anchoring: Anchoring = CORNER,
) -> FloatArray:
    """Distance to the nearest obstacle (N, B) [m] at each endpoint; +inf off the map.

    ``bilinear`` interpolates between the centres of the four nearest cells, which near the border are repeated.
    """
    x, y, yaw = anchoring.to_cells(field, poses)
    ends = endpoints / field.resolution
    c, s = (values[:, np.newaxis] for values in cos_sin(yaw))
    column = x[:, np.newaxis] + (c * ends[:, 0] - s * ends[:, 1])
    row = y[:, np.newaxis] + (s * ends[:, 0] + c * ends[:, 1])
    height, width = field.codes.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    found = _bilinear(field, column, row) if bilinear else _level(field, _cell(row, height), _cell(column, width))
    return np.where(inside, found, np.inf)


def _level(field: DistanceField, row: NDArray[np.intp], column: NDArray[np.intp]) -> FloatArray:
    codes = field.codes.ravel().take(row * field.codes.shape[1] + column)
    return np.asarray(field.levels.take(codes))


def _cell(coordinate: FloatArray, size: int) -> NDArray[np.intp]:
    return np.fmin(np.fmax(np.floor(coordinate), 0.0), size - 1.0).astype(np.intp)  # NaN is taken for 0


def _bilinear(field: DistanceField, column: FloatArray, row: FloatArray) -> FloatArray:
    height, width = field.codes.shape
    column, row = column - 0.5, row - 0.5
    u, v = column - np.floor(column), row - np.floor(row)
    left, right = _cell(column, width), _cell(column + 1.0, width)
    below, above = _cell(row, height), _cell(row + 1.0, height)
    lower, beside = _level(field, below, left), _level(field, below, right)
    upper, across = _level(field, above, left), _level(field, above, right)
    lower, upper = lower + u * (beside - lower), upper + u * (across - upper)
    return np.asarray(lower + v * (upper - lower))
