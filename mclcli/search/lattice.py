"""The lattice of poses that is searched: the centres of cells, and angles so close that no endpoint skips a cell.

Everything is in cells of the field and in its own frame; ``Lattice.poses`` leads back to the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry import se2
from mclcli.world.pyramid import COARSE, angles_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray, IntArray

_MOST_ENDS = 2**26  # endpoints of all beams at all angles, eight bytes each and as much again while they are made
_COARSEST = math.radians(2.0)  # of scans that reach hardly anywhere


@final
@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Which cells of a map may hold the base, counted in blocks.

    ``counts`` int32: allowed cells of every block of 2^h × 2^h cells, level h from ``firsts[h]`` on; ``sizes`` (6, 2):
    rows and columns of blocks. Level 0 is the map itself.
    """

    counts: NDArray[np.int32]
    firsts: IntArray
    sizes: IntArray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows H and columns W of the map."""
        return int(self.sizes[0, 0]), int(self.sizes[0, 1])

    def of_level(self, level: int) -> NDArray[np.int32]:
        """Allowed cells in every block of a level."""
        rows, columns = self.sizes[level].tolist()
        first = int(self.firsts[level])
        return self.counts[first : first + rows * columns].reshape(rows, columns)

    @property
    def number(self) -> int:
        """How many cells are allowed."""
        return int(self.counts[int(self.firsts[-1]) :].sum(dtype=np.int64))


def count_places(allowed: BoolArray) -> Places:
    """Count the allowed cells (H, W) in the blocks of every level."""
    counts = [allowed.astype(np.int32)]
    for _ in range(COARSE):
        counts.append(_sums_of_blocks(counts[-1]))
    firsts = np.cumsum([0, *(count.size for count in counts)])[:-1].astype(np.int64)
    sizes = np.array([count.shape for count in counts], np.int64)
    return Places(np.concatenate([count.ravel() for count in counts]), firsts, sizes)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Angles, where every beam ends from each of them, and which cells may hold the base.

    ``angles`` (A,) [rad] in the field's frame, ``step`` apart. ``ends`` (A, B, 2) int32: row and column offset of the
    cell in which a beam ends, seen from a base at the centre of cell (0, 0); ``groups`` (G, B, 2) the least ones of the
    angles that are a group at the coarse level.
    """

    angles: FloatArray
    step: float
    ends: NDArray[np.int32]
    groups: NDArray[np.int32]
    places: Places

    @property
    def size(self) -> int:
        """Number of poses."""
        return self.angles.size * self.places.number

    def nodes(self, keys: IntArray) -> IntArray:
        """Angle, row and column (N, 3) of keys (N,) = (angle·H + row)·W + column."""
        height, width = self.places.shape
        return np.column_stack([keys // (height * width), keys // width % height, keys % width])

    def poses(self, keys: IntArray) -> FloatArray:
        """Column, row [cells, continuous] and yaw [rad] (N, 3) in the field's frame."""
        angle, row, column = self.nodes(keys).T
        return np.column_stack([column + 0.5, row + 0.5, self.angles[angle]])


def angle_step(reach: float) -> float:
    """Step [rad] of angles: it divides a turn, and moves no endpoint up to ``reach`` cells away by more than one."""
    return se2.TAU / math.ceil(se2.TAU / min(1.0 / max(reach, 1e-9), _COARSEST))


def build(endpoints: FloatArray, places: Places, about: tuple[float, float] = (0.0, math.pi)) -> Lattice:
    """Lattice for endpoints (B, 2) [cells] in the base frame.

    ``about`` is an angle [rad] in the field's frame and how far from it angles may be.

    Raises
    ------
    InputError
        If beams end so far away that their endpoints at all angles would fill the memory.

    """
    reach = float(np.hypot(endpoints[:, 0], endpoints[:, 1]).max(initial=0.0))
    if reach * len(endpoints) > _MOST_ENDS / se2.TAU:
        raise InputError(
            f"{len(endpoints)} beams that end up to {reach:.3g} cells from the base are too many to be searched at "
            "every angle: take coarser cells, a smaller --set laser_max_range=METRES or --set locate_beams=N"
        )
    step = angle_step(reach)
    angles = np.arange(round(se2.TAU / step), dtype=np.float64) * step
    angles = angles[np.abs(se2.wrap(angles - about[0])) <= about[1]]
    ends = _cells_of_ends(endpoints, angles)
    groups = np.minimum.reduceat(ends, np.arange(0, angles.size, angles_in(COARSE)), axis=0) if angles.size else ends
    return Lattice(angles, step, ends, groups, places)


def _cells_of_ends(endpoints: FloatArray, angles: FloatArray) -> NDArray[np.int32]:
    """Row and column (A, B, 2) of the cell in which each beam ends, from the centre of cell (0, 0)."""
    c, s = np.cos(angles)[:, np.newaxis], np.sin(angles)[:, np.newaxis]
    x, y = endpoints[:, 0], endpoints[:, 1]
    out = np.empty((angles.size, x.size, 2), np.int32)
    out[..., 0] = np.floor(0.5 + (s * x + c * y))
    out[..., 1] = np.floor(0.5 + (c * x - s * y))
    return out


def _sums_of_blocks(counts: NDArray[np.int32]) -> NDArray[np.int32]:
    """Sums of 2 × 2 blocks."""
    rows, columns = counts.shape
    even = np.pad(counts, ((0, rows % 2), (0, columns % 2)))
    return np.asarray(even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2], np.int32)
