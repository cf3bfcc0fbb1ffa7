"""What odometry says of two poses that follow each other, as a factor of a chain.

The error of poses a and b against an increment u is e = (R_aᵀ(t_b − t_a) − t_u, wrap(θ_b − θ_a − θ_u)), in the frame
of the base at a. Gaussian errors cost ½ s with s = eᵀ Q⁻¹ e. Where wheels may slip or the robot may be pushed, a share
ε of the increments is k times as uncertain: −log[(1 − ε) exp(−s/2) + ε k⁻³ exp(−s/2k²)]. Its derivative is that of
½ w s with the weight w = ρ + (1 − ρ)/k², ρ the share of the first part, so that Gauss–Newton goes on as before.
Source: Barfoot 2017, *State Estimation for Robotics*, section 5.3.2 (iteratively reweighted least squares).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.geometry import se2

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


@final
@dataclass(frozen=True, slots=True)
class Jumps:
    """A ``share`` of all increments, 0 to 1, whose standard deviations are ``times`` as large, at least 1."""

    share: float
    times: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
    """Increments (n − 1, 3) in the frame of the base, with covariances (n − 1, 3, 3) there, positive definite."""

    increments: FloatArray
    covariances: FloatArray
    jumps: Jumps | None = None


class Linearised(NamedTuple):
    """Factors of m chains at their poses, as the blocks of normal equations.

    ``costs`` (m, n − 1); ``gradients`` and ``curvatures`` of the costs, (m, n, 3) and (m, n, 3, 3), the blocks of
    poses, and ``above`` (m, n − 1, 3, 3), those of a pose and the next one.
    """

    costs: FloatArray
    gradients: FloatArray
    curvatures: FloatArray
    above: FloatArray


def errors(poses: FloatArray, increments: FloatArray) -> FloatArray:
    """e (m, n − 1, 3) of poses (m, n, 3) against increments (n − 1, 3)."""
    a, b = poses[:, :-1], poses[:, 1:]
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    yaw = se2.wrap(b[..., 2] - a[..., 2] - increments[:, 2])
    return np.stack([c * dx + s * dy - increments[:, 0], c * dy - s * dx - increments[:, 1], yaw], axis=-1)


def linearise(poses: FloatArray, odometry: Odometry, information: FloatArray) -> Linearised:
    """The factors at poses (m, n, 3); ``information`` (n − 1, 3, 3) is Q⁻¹ of the increments."""
    error = errors(poses, odometry.increments)
    by_first, by_second = _jacobians(poses)
    weighed = np.einsum("nij,mnj->mni", information, error)
    costs, weights = _costs((weighed * error).sum(axis=-1), odometry.jumps)
    weighed *= weights[..., np.newaxis]
    ahead, behind = by_first.transpose(0, 1, 3, 2), by_second.transpose(0, 1, 3, 2)
    precise = information * weights[..., np.newaxis, np.newaxis]
    gradients, curvatures = np.zeros_like(poses), np.zeros((*poses.shape, 3))
    gradients[:, :-1] += (ahead @ weighed[..., np.newaxis])[..., 0]
    gradients[:, 1:] += (behind @ weighed[..., np.newaxis])[..., 0]
    of_second = precise @ by_second
    curvatures[:, :-1] += ahead @ precise @ by_first
    curvatures[:, 1:] += behind @ of_second
    return Linearised(costs, gradients, curvatures, ahead @ of_second)


def _costs(squares: FloatArray, jumps: Jumps | None) -> tuple[FloatArray, FloatArray]:
    """Costs and weights of increments whose errors are ``squares`` = eᵀ Q⁻¹ e, all of one shape."""
    if jumps is None:
        return 0.5 * squares, np.ones_like(squares)
    calm = np.log1p(-jumps.share) - 0.5 * squares
    rough = np.log(jumps.share) - 3.0 * np.log(jumps.times) - 0.5 * squares / jumps.times**2
    total = np.logaddexp(calm, rough)
    share = np.exp(calm - total)
    return -total, share + (1.0 - share) / jumps.times**2


def _jacobians(poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """∂e/∂a and ∂e/∂b, each (m, n − 1, 3, 3)."""
    a, b = poses[:, :-1], poses[:, 1:]
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    nought, one = np.zeros_like(c), np.ones_like(c)
    first = [-c, -s, c * dy - s * dx, s, -c, -c * dx - s * dy, nought, nought, -one]
    second = [c, s, nought, -s, c, nought, nought, nought, one]
    shape = (*c.shape, 3, 3)
    return np.stack(first, axis=-1).reshape(shape), np.stack(second, axis=-1).reshape(shape)
