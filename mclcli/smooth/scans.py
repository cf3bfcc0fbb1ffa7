"""Scans of a drive against the map: what a beam says of the pose it was seen from.

A beam ends at a distance d from the nearest wall, d in [0, d_max]:

    p(d) = z · 2/(σ√2π) · exp(−d²/2σ²) + (1 − z)/d_max

a half of a normal distribution where it hit something that the map knows, else anywhere. It is normalised in d, the
only thing that the field tells, so that σ and z have a most probable value. With the hit share ρ of a beam the
derivative of −log p is that of ρ d²/2σ²: Gauss–Newton takes ρ/σ² for the weight of d. Source: Dempster, Laird and
Rubin 1977 (the shares); Nocedal and Wright 2006, section 10.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.geometry import se2
from mclcli.smooth.chain import Unary

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.smooth.surface import Surface

_SIGMA = 0.2  # [m] of the filter's likelihood field, by default
_BLOCK = 256  # scans whose temporaries stay in the second-level cache


@final
@dataclass(frozen=True, slots=True, eq=False)
class Scans:
    """Beams of n scans, each seen from the base at its stamp; a scan has K of them at most, ``counts`` (n,) are real.

    ``ends`` (n, K, 2) [m] are where they end, ``directions`` (n, K, 2) where they point: single precision holds a
    micrometre of 30 m, and halves the memory that a long log takes. ``r_max`` [m] is how far the lidar sees.
    """

    ends: NDArray[np.float32]
    directions: NDArray[np.float32]
    counts: IntArray
    r_max: float

    def some(self, chosen: IntArray | BoolArray | slice) -> Scans:
        """Some of the scans."""
        return Scans(self.ends[chosen], self.directions[chosen], self.counts[chosen], self.r_max)

    def real(self, block: slice = slice(None)) -> BoolArray:
        """Which of the K beams of each scan, or of those of a block, are beams (n, K)."""
        return np.arange(self.ends.shape[1]) < self.counts[block, np.newaxis]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """n scans in order, with the odometry (n, 3) at each, and which of them (n,) do not follow the one before.

    ``twists`` (n, 3) are its velocity there, in the frame of the base [m/s, m/s, rad/s].
    ``sweeps`` (n, 3) lead from the base at a scan's stamp to where odometry has it at the middle of the scan.
    """

    scans: Scans
    odometry: FloatArray
    breaks: BoolArray
    twists: FloatArray
    sweeps: FloatArray

    def some(self, chosen: IntArray) -> Drive:
        """Some of the scans."""
        return Drive(
            self.scans.some(chosen),
            self.odometry[chosen],
            self.breaks[chosen],
            self.twists[chosen],
            self.sweeps[chosen],
        )

    @property
    def increments(self) -> FloatArray:
        """Odometry (n − 1, 3) from each scan to the next."""
        return se2.between(self.odometry[:-1], self.odometry[1:])


@final
@dataclass(frozen=True, slots=True)
class Law:
    """How far from walls beams end: σ [m], z, and ``offset`` [m], by which ranges are too short of what is mapped."""

    sigma: float
    z: float
    offset: float = 0.0


class Residuals(NamedTuple):
    """What n scans of K beams are at one pose each: all (n, K), and 0 where there is no beam.

    ``distances`` [m] to the nearest wall, their derivatives by x, y and yaw of the pose and ``along`` the beam;
    ``shares`` ρ.
    """

    distances: FloatArray
    by_x: FloatArray
    by_y: FloatArray
    by_yaw: FloatArray
    along: FloatArray
    shares: FloatArray

    @property
    def jacobians(self) -> FloatArray:
        """Derivatives (n, K, 3) by the pose."""
        return np.stack([self.by_x, self.by_y, self.by_yaw], axis=-1)

    def some(self, chosen: IntArray) -> Residuals:
        """Those of some of the scans."""
        return Residuals(*(column[chosen] for column in self))


@final
@dataclass(frozen=True, slots=True, eq=False)
class ScanFactors:
    """The scans as unary factors of a chain, each with a temperature ``alphas`` (n,) on its log-likelihood."""

    surface: Surface
    scans: Scans
    law: Law
    alphas: FloatArray

    def some(self, chosen: IntArray | slice) -> ScanFactors:
        """Those of some of the scans."""
        return ScanFactors(self.surface, self.scans.some(chosen), self.law, self.alphas[chosen])

    def __call__(self, poses: FloatArray) -> Unary:
        """The factors at poses (m, n, 3)."""
        chains, n = poses.shape[:2]
        costs, gradients = np.zeros((chains, n)), np.zeros((chains, n, 3))
        curvatures = np.zeros((chains, n, 3, 3))
        variance = self.law.sigma**2
        for chain in range(chains):
            for start in range(0, n, _BLOCK):
                block = slice(start, start + _BLOCK)
                found = self._residuals(poses[chain, block], block)
                alpha = self.alphas[block]
                costs[chain, block] = alpha * self._costs(found.distances, block)
                weights = found.shares * (alpha / variance)[:, np.newaxis]
                pulled = weights * found.distances
                columns = (found.by_x, found.by_y, found.by_yaw)
                for i in range(3):
                    gradients[chain, block, i] = (pulled * columns[i]).sum(axis=1)
                    weighted = weights * columns[i]
                    for j in range(i + 1):
                        curvatures[chain, block, i, j] = curvatures[chain, block, j, i] = (weighted * columns[j]).sum(
                            axis=1
                        )
        return Unary(costs, gradients, curvatures)

    def least_costs(self) -> FloatArray:
        """What scans (n,) would cost whose beams all end at a wall."""
        hit, other = self._parts(np.zeros(1))
        return np.asarray(-self.alphas * self.scans.counts * np.log(hit + other)[0])

    def residuals(self, poses: FloatArray) -> Residuals:
        """What the scans are at poses (n, 3)."""
        blocks = [slice(start, start + _BLOCK) for start in range(0, len(poses), _BLOCK)]
        parts = [self._residuals(poses[block], block) for block in blocks]
        return Residuals(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def explained(self, poses: FloatArray) -> FloatArray:
        """Share (n,) of each scan's beams that end at what the map knows, at poses (n, 3); 1 for a scan without."""
        found = np.empty(len(poses))
        for start in range(0, len(poses), _BLOCK):
            block = slice(start, start + _BLOCK)
            found[block] = self._residuals(poses[block], block).shares.sum(axis=1)
        return np.where(self.scans.counts > 0, found / np.maximum(self.scans.counts, 1), 1.0)

    def reliability(self, poses: FloatArray) -> FloatArray:
        """How well (n,) each scan fits at poses (n, 3), from 0 to 1, as ``filter.fit`` has it by default."""
        rest, furthest = 0.5 / self.scans.r_max, self.surface.field.max_dist
        low, high = math.log(0.5 * math.exp(-0.5 * (furthest / _SIGMA) ** 2) + rest), math.log(0.5 + rest)
        found = np.empty(len(poses))
        for start in range(0, len(poses), _BLOCK):
            block = slice(start, start + _BLOCK)
            d = self._residuals(poses[block], block).distances
            log_p = np.log(0.5 * np.exp(-0.5 * (d / _SIGMA) ** 2) + rest)
            found[block] = ((log_p - low) / (high - low) * self.scans.real(block)).sum(axis=1)
        return np.where(self.scans.counts > 0, found / np.maximum(self.scans.counts, 1), 0.0)

    def _residuals(self, poses: FloatArray, block: slice) -> Residuals:
        ends, directions = self.scans.ends[block], self.scans.directions[block]
        real = self.scans.real(block)
        c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        ahead_x, ahead_y = directions[..., 0].astype(np.float64), directions[..., 1].astype(np.float64)
        x, y = ends[..., 0] + self.law.offset * ahead_x, ends[..., 1] + self.law.offset * ahead_y
        turned_x, turned_y = c * x - s * y, s * x + c * y
        looked = self.surface.look(poses[:, :1] + turned_x, poses[:, 1:2] + turned_y)
        along = looked.slope_x * (c * ahead_x - s * ahead_y) + looked.slope_y * (s * ahead_x + c * ahead_y)
        by_yaw = looked.slope_y * turned_x - looked.slope_x * turned_y
        hit, other = self._parts(looked.distance)
        found = Residuals(looked.distance, looked.slope_x, looked.slope_y, by_yaw, along, hit / (hit + other))
        return found if real.all() else Residuals(*(column * real for column in found))

    def _costs(self, distances: FloatArray, block: slice) -> FloatArray:
        hit, other = self._parts(distances)
        return np.asarray(-(np.log(hit + other) * self.scans.real(block)).sum(axis=1))

    def _parts(self, distances: FloatArray) -> tuple[FloatArray, float]:
        """Densities of a hit and of anything else."""
        peak = self.law.z * 2.0 / (self.law.sigma * math.sqrt(2.0 * math.pi))
        return peak * np.exp(distances**2 * (-0.5 / self.law.sigma**2)), (
            1.0 - self.law.z
        ) / self.surface.field.max_dist
