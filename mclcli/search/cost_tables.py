"""Costs of nodes in whole steps below a perfect fit, laid out for ``mclcli.kernels.sweep`` and ``leaves``.

A cost is rounded down, so that the bound that it stands for is never below the node's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError
from mclcli.native import backend
from mclcli.world.pyramid import COARSE, FINE, bound_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.lattice import Lattice, Places
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.pyramid import Pyramid

_LANES = 32  # of a row of nodes
_NODE = 8  # entries between neighbouring nodes, at every level
_MOST = 65_535  # of a sum
_WIDEST = 16.0  # nats: beams that fit worse than this cost no more, so that steps stay small
_CHUNK = 1 << 17  # nodes written at a time
_GOLDEN = 0.6180339887498949  # a few beams, taken by multiples of this share of a turn, look all around
_SLIP = 1e-9  # of the largest sum of values: what rounding may take from a bound


@final
@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """Costs of one level in rows of ``width``, and where every beam of every group of angles finds them.

    ``counts`` are the places allowed in every node. See the kernels.
    """

    cells: NDArray[np.uint8]
    width: int
    starts: NDArray[np.int32]
    counts: NDArray[np.int32]


@final
@dataclass(frozen=True, slots=True, eq=False)
class CostTables:
    """Planes of the two levels whose nodes are bounded in rows, and ``leaves`` of the poses themselves.

    A cost c stands for the bound ``perfect − step·c`` [nats]; none is higher than ``most``. ``table`` (256,) is the
    greatest value of every bin.
    """

    coarse: Plane
    fine: Plane
    leaves: Plane
    table: FloatArray
    perfect: float
    step: float
    most: int

    def bounds(self, costs: NDArray[np.int32]) -> FloatArray:
        """Bounds (N,) [nats] of costs (N,)."""
        return np.asarray(self.perfect - self.step * costs)

    def within(self, value: float) -> int:
        """The highest cost whose bound is not below ``value``; −1 if there is none."""
        return math.floor(min(max((self.perfect - value) / self.step, -1.0), _MOST))

    def sweep(self, state: IntArray, limit: int, stop: int, weights: FloatArray) -> Nodes:
        """The next nodes, of ``state`` (4,) on, that cost at most ``limit``; see the kernel."""
        out, costs, mass = np.empty((_CHUNK, 3), np.int32), np.empty(_CHUNK, np.int32), np.zeros(1)
        state[3] = 0
        planes = [(p.cells, p.width, p.starts, p.counts) for p in (self.coarse, self.fine)]
        backend.load("sweep").sweep(
            *planes[0], *planes[1], limit, stop, weights,
            out, costs, state, mass, np.empty(_LANES, np.uint16), np.empty(_LANES, np.uint16),
        )  # fmt: skip
        found = int(state[3])
        return Nodes(out[:found], costs[:found], float(mass[0]))

    def done(self, state: IntArray) -> bool:
        """Whether a sweep that has come to ``state`` is over."""
        return bool(state[0] >= self.coarse.counts.shape[0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Fine nodes, angle, row and column (N, 3), with their ``costs`` (N,); ``mass`` of those that cost more."""

    places: NDArray[np.int32]
    costs: NDArray[np.int32]
    mass: float


def lay_out(field: DistanceField, pyramid: Pyramid, lattice: Lattice, log_p: FloatArray) -> CostTables:
    """Costs for a scan; ``log_p`` (L + 1,) is the value [nats] of every level of the field, and of off the map.

    Raises
    ------
    InputError
        If the map is too large for the scan's reach.

    """
    table, beams = bound_table(field, log_p), lattice.ends.shape[1]
    widest = min(float(table[0] - table.min()), _WIDEST)
    most = max(min(255, _MOST // max(beams, 1)), 1)
    step = widest / most or 1.0
    slip = _SLIP * (1.0 + beams * (abs(float(table[0])) + widest))

    def cost(values: FloatArray) -> NDArray[np.uint8]:
        return np.asarray(np.clip((table[0] - values) / step * (1.0 - 1e-12), 0.0, most), np.uint8)

    order = np.argsort(np.arange(beams) * _GOLDEN % 1.0)
    ends, groups, places = lattice.ends[:, order], lattice.groups[:, order], lattice.places
    coarse = _nodes(pyramid, COARSE, groups, cost(table), places)
    fine = _nodes(pyramid, FINE, ends, cost(table), places)
    leaves = _leaves(field, ends, cost(log_p), places)
    return CostTables(coarse, fine, leaves, table, float(table[0]) * beams + slip, step, most * beams)


def _nodes(pyramid: Pyramid, level: int, ends: NDArray[np.int32], cost: NDArray[np.uint8], places: Places) -> Plane:
    """Plane of a level, dealt out by columns."""
    shape, counts = pyramid.shapes[level], places.of_level(level)
    _, _, _, shift, margin = shape.tolist()
    rows, columns = counts.shape[0], -(-counts.shape[1] // _LANES) * _LANES
    down, low, height = _entries(ends[..., 0] >> np.int32(shift), rows, margin, -(-places.shape[0] >> shift))
    across, left, width = _entries(ends[..., 1] >> np.int32(shift), columns, margin, -(-places.shape[1] >> shift))
    eighth = -(-width // _NODE)
    cells = _room_for(_NODE, height, eighth)
    backend.load("sweep").deal(pyramid.pool, shape, cost, low, left, cells)
    starts = np.ascontiguousarray((across % _NODE * height + down) * eighth + across // _NODE)
    return Plane(cells.reshape(-1), eighth, starts, counts)


def _leaves(field: DistanceField, ends: NDArray[np.int32], cost: NDArray[np.uint8], places: Places) -> Plane:
    """Plane of the cells themselves."""
    rows, columns = places.of_level(FINE).shape
    down, low, height = _entries(ends[..., 0], rows, 0, places.shape[0])
    across, left, width = _entries(ends[..., 1], columns, 0, places.shape[1])
    cells = _room_for(height, width)
    backend.load("leaves").spread(field.codes, cost, low, left, cells)
    return Plane(cells.reshape(-1), width, np.ascontiguousarray(down * width + across), places.of_level(0))


def _entries(ends: NDArray[np.int32], nodes: int, margin: int, side: int) -> tuple[NDArray[np.int32], int, int]:
    """Entries (G, B) from the plane's first one to what node 0 needs, that one's place, and how many there are.

    Cells that are off the map for every node are moved to just off it.
    """
    entries = np.clip(ends, -_NODE * nodes - margin, side).astype(np.int32)
    low, high = (int(entries.min()), int(entries.max())) if entries.size else (0, 0)
    return entries - np.int32(low), low, _NODE * nodes + high - low


def _room_for(*shape: int) -> NDArray[np.uint8]:
    if math.prod(shape) >= 2**31:
        raise InputError("the map, and the scan's reach around it, are too large to be searched: take coarser cells")
    return np.empty(shape, np.uint8)
