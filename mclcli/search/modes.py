"""Distinct places among many poses: peaks that suppress their neighbours, each with the mass around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.branching import Found
    from mclcli.search.lattice import Lattice

MOST = 32  # peaks that are looked for


@final
@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """Peaks, the highest first: ``keys`` (M,), ``values`` (M,) and ``masses`` (M,).

    A mass is Σ exp(alpha·(value − best)) over the leaves around a peak; ``rest`` is that of those around none of them.
    """

    keys: IntArray
    values: FloatArray
    masses: FloatArray
    rest: float


def find_peaks(found: Found, lattice: Lattice, alpha: float, radius: float, angle: float) -> Peaks:
    """Peaks of the leaves; those within ``radius`` [cells] and ``angle`` [rad] of a higher peak belong to it."""
    poses, mass = lattice.poses(found.keys), np.exp(alpha * (found.values - found.best))
    left = np.arange(found.keys.size)
    numbers: list[int] = []
    masses: list[float] = []
    while left.size and len(numbers) < MOST:
        peak = poses[left[0]]
        offset = poses[left] - peak
        near = (offset[:, 0] ** 2 + offset[:, 1] ** 2 <= radius**2) & (np.abs(se2.wrap(offset[:, 2])) <= angle)
        numbers.append(int(left[0]))
        masses.append(float(mass[left[near]].sum()))
        left = left[~near]
    return Peaks(found.keys[numbers], found.values[numbers], np.array(masses), float(mass[left].sum()))
