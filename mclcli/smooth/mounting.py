"""Whether the lidar sits, and its clock runs, as the log says: one joint step of both from the smoothed poses.

A scan that was taken dt after its stamp, by a lidar that sits (x, y, yaw) beside where it is said to be, fits less well
than it could; poses take most of that up, and odometry speaks against it. With g the gradient by these four, D their
curvature, B that of poses and them, and A of the poses, the step is −(D − BᵀA⁻¹B)⁻¹ g, and (D − BᵀA⁻¹B)⁻¹ its
covariance. Sources: Kümmerle, Grisetti and Burgard 2012; Censi, Franchi, Marchionni and Oriolo 2013.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from mclcli.smooth.chain import Smoothed
    from mclcli.smooth.scans import Drive, Residuals, ScanFactors

_PRIOR = np.diag(1.0 / np.square([0.2, 0.1, 0.1, 0.1]))  # [s, m, m, rad]
_WIDER = 2.0  # halves of one log differ by up to twice what the curvature says
_SURE = 3.0  # standard deviations
_LEAST = 0.01  # [s], [m] that matters


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mounting:
    """By how much the log is off, as far as one step tells, with standard deviations.

    ``late`` [s] is the time from a scan's stamp to the scan; ``ahead`` and ``left`` [m] lead from where the lidar is
    said to sit to where it sits, along x and y of the base.
    """

    late: tuple[float, float]
    ahead: tuple[float, float]
    left: tuple[float, float]

    @property
    def is_late(self) -> bool:
        """Whether the log says that stamps are off, by enough to matter."""
        return _matters(*self.late)

    @property
    def is_moved(self) -> bool:
        """Whether the log says that the lidar sits elsewhere, by enough to matter."""
        return _matters(*self.ahead) or _matters(*self.left)


def _matters(value: float, deviation: float) -> bool:
    return abs(value) > max(_SURE * deviation, _LEAST)


def estimate(found: Smoothed, factors: ScanFactors, seen: Residuals, drive: Drive) -> Mounting:
    """From a chain at its minimum, with what its scans are there."""
    poses = found.poses[0]
    c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    along, aside = c * seen.by_x + s * seen.by_y, c * seen.by_y - s * seen.by_x
    ends = factors.scans.ends + np.float32(factors.law.offset) * factors.scans.directions
    turned = aside * ends[..., 0] - along * ends[..., 1]
    vx, vy, rate = (drive.twists[:, i : i + 1] for i in range(3))
    by = np.stack([along * vx + aside * vy + turned * rate, along, aside, turned], axis=-1)
    weights = seen.shares * (factors.alphas / factors.law.sigma**2)[:, np.newaxis]
    weighed = weights[..., np.newaxis] * by
    mixed = np.einsum("nki,nkj->nij", seen.jacobians, weighed)
    absorbed = np.stack([found.solve(np.ascontiguousarray(mixed[np.newaxis, ..., j]))[0] for j in range(4)], axis=-1)
    curvature = np.einsum("nki,nkj->ij", by, weighed) + _PRIOR - np.einsum("nki,nkj->ij", mixed, absorbed)
    gradient = np.einsum("nk,nkj->j", seen.distances, weighed)
    covariance = np.linalg.inv(curvature)
    steps, deviations = -(covariance @ gradient), _WIDER * np.sqrt(np.diag(covariance))
    late, ahead, left, _ = zip(steps.tolist(), deviations.tolist(), strict=True)
    return Mounting(late, ahead, left)
