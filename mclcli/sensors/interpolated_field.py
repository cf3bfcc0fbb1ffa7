"""Sums over beams of what the likelihood field makes of distances that are interpolated between cells.

NumPy and the kernel ``interpolated_field`` do the same operations in the same order: the bits are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import exponential
from mclcli.native.backend import NUMPY, Backend
from mclcli.sensors import endpoints
from mclcli.sensors.endpoints import CORNER, Anchoring

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.world.distance_field import DistanceField

_FACTORS = 16  # of 1e-12 to 1e18: their product neither vanishes nor overflows


@final
@dataclass(frozen=True, slots=True)
class Law:
    """p = amplitude·2^(factor·d²) + rest of a distance d, at most ``furthest`` [m].

    ``factor`` ≤ 0 [1/m²]; ``unknown`` [m²] is the d² that stands for an unknown cell; ``off_map`` is p off the map.
    Beams add log max(p, ``floor``), or p³ with ``cubes``.
    """

    factor: float
    amplitude: float
    rest: float
    off_map: float
    unknown: float
    furthest: float
    floor: float
    cubes: bool = False

    @property
    def factors(self) -> int:
        """How many likelihoods are multiplied before a logarithm is taken."""
        return _FACTORS if max(self.amplitude + self.rest, self.off_map) < 1e18 else 1

    def likelihood(self, distance: FloatArray) -> FloatArray:
        """p, any shape; +inf stands for off the map, NaN for an unknown cell."""
        d = np.minimum(distance, self.furthest)
        square = np.where(np.isnan(d), self.unknown, d * d)
        p = self.amplitude * exponential.exp2(self.factor * square) + self.rest
        return np.where(distance == np.inf, self.off_map, p)

    def combine(self, likelihood: FloatArray) -> FloatArray:
        """Sum (N,) over beams of p (N, B), in groups of ``factors``."""
        total, beams = np.zeros(likelihood.shape[0]), np.ascontiguousarray(likelihood.T)
        terms = beams * beams * beams if self.cubes else np.maximum(beams, self.floor)
        for first in range(0, len(terms), self.factors):
            result = terms[first].copy()
            for term in terms[first + 1 : first + self.factors]:
                (np.add if self.cubes else np.multiply)(result, term, out=result)
            total += result if self.cubes else exponential.log(result)
        return total


def sum_interpolated(
    field: DistanceField,
    law: Law,
    ends: FloatArray,
    poses: FloatArray,
    *,
    anchoring: Anchoring = CORNER,
    backend: Backend = NUMPY,
    threads: int = 1,
) -> FloatArray:
    """Σ_b log p (N,), or Σ_b p³, at endpoints (B, 2) [m] in the base frame, for poses (N, 3)."""
    out, kernels = np.empty(poses.shape[0]), endpoints.kernels_over(field, backend, "interpolated_field")
    size = max(1, endpoints.PAIRS // max(1, len(ends))) if kernels is None else endpoints.COMPILED_BLOCK

    def by_numpy(start: int) -> None:
        block = slice(start, start + size)
        found = endpoints.distances(field, ends, poses[block], bilinear=True, anchoring=anchoring)
        out[block] = law.combine(law.likelihood(found))

    figures = np.array([law.factor, law.amplitude, law.rest, law.off_map, law.unknown, law.furthest, law.floor])
    about = (field.codes.ravel(), *field.codes.shape, field.levels, *anchoring.frame(field))
    in_cells = endpoints.in_cells(field, ends).ravel()

    def by_kernel(start: int) -> None:
        assert kernels is not None  # noqa: S101 - else by_numpy
        block, scratch = slice(start, start + size), (np.empty((12, 256)), np.empty((4, 256), np.int32))
        some = np.ascontiguousarray(poses[block])
        out[block] = 0.0
        kernels.sum_interpolated(*about, some, in_cells, figures, law.factors, law.cubes, out[block], *scratch)

    endpoints.for_each(by_numpy if kernels is None else by_kernel, range(0, poses.shape[0], size), threads)
    return out
