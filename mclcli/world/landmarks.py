"""Landmarks: named points of the map that a camera recognises."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.quantity import FARTHEST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray, IntArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """L landmarks: distinct ``ids`` and their ``positions`` (L, 3) float64 x, y, z [m] in map, read-only.

    Raises
    ------
    ValueError
        If an id repeats, or the positions are not L points within bounds.

    """

    ids: tuple[str, ...]
    positions: FloatArray
    _index: dict[str, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64)
        if positions.shape != (len(self.ids), 3) or not (np.abs(positions) <= FARTHEST).all():
            expected = f"{len(self.ids)} points within {FARTHEST:g} m"
            raise ValueError(f"positions: expected {expected}, got shape {positions.shape}")
        index = {name: row for row, name in enumerate(self.ids)}
        if len(index) != len(self.ids):
            raise ValueError("ids: each landmark needs its own")
        positions.flags.writeable = False
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "_index", index)

    def lookup(self, ids: Sequence[str]) -> IntArray:
        """Row of each id in ``positions``, −1 for those not in the map, shape (M,) for M ids."""
        return np.array([self._index.get(name, -1) for name in ids], dtype=np.int64)
