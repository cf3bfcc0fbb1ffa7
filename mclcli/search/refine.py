"""From the best cell and angle to the best pose: Gauss–Newton on the interpolated distance field.

A beam adds log(z_hit·exp(−d²/2σ²) + z_rand/r_max); its derivative is that of −w·d²/2σ² with w the share of the hit
component, so that each step solves Σ w J Jᵀ δ = −Σ w d J with J the derivative of d by the pose. Source: Nocedal and
Wright 2006, *Numerical Optimization*, section 10.3.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.likelihood_field import LikelihoodField

_STEPS = 12
_STEPS_ON_LATTICE = 10  # there the creases of the field, not the number of steps, set the limit
_CONVERGED = 1e-5
_DRIFT = np.array([0.15, 0.15, math.radians(5.0)])  # of odometry within half a window
_SHARES = 0.5 ** np.arange(6)[:, np.newaxis]  # of a step


@final
@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """How maxima are sought: within ``reach`` (3,) of where they are thought to be, x, y [m] and yaw [rad].

    ``spacing`` (3,) is that of the lattice: a covariance is at least that of a pose somewhere in one step of it.
    ``alpha`` is the temperature of the log-likelihood, ``precision`` (3, 3), or (M, 3, 3) one for each pose, that
    of Gaussians around the poses given. At most so many ``steps`` are taken.
    """

    reach: FloatArray
    spacing: FloatArray
    alpha: float
    precision: FloatArray
    steps: int = _STEPS


def on_lattice(spacing: FloatArray, alpha: float) -> Refinement:
    """From poses of the lattice, which are the best within a step of it."""
    return Refinement(2.0 * spacing, spacing, alpha, np.zeros((3, 3)), _STEPS_ON_LATTICE)


def after_drift(spacing: FloatArray, alpha: float) -> Refinement:
    """From poses that fit scans joined by odometry, to those that fit the later ones of them."""
    return Refinement(2.0 * _DRIFT, spacing, alpha, np.diag(1.0 / _DRIFT**2))


def refine(model: LikelihoodField, beams: Beams, poses: FloatArray, how: Refinement) -> tuple[FloatArray, FloatArray]:
    """Poses (M, 3) of local maxima, one near each of ``poses`` (M, 3), and their covariances (M, 3, 3).

    A covariance is the inverse curvature of the tempered log-likelihood.
    """
    smooth = dataclasses.replace(model, parameters=dataclasses.replace(model.parameters, field_lookup="bilinear"))
    measured = smooth.measure("lidar", beams)
    precision = np.broadcast_to(how.precision, (len(poses), 3, 3))
    best, values, moving = poses.copy(), how.alpha * measured.log_likelihood(poses), np.arange(len(poses))
    for _ in range(how.steps):
        start = poses[moving, np.newaxis]
        tried = _along_the_step(smooth, beams, best[moving], poses[moving], how, precision[moving])
        tried = np.clip(tried, start - how.reach, start + how.reach)
        found = how.alpha * measured.log_likelihood(tried.reshape(-1, 3)).reshape(tried.shape[:2])
        off = tried - start
        found -= 0.5 * ((off @ precision[moving]) * off).sum(axis=-1)
        row, chosen = np.arange(len(moving)), found.argmax(axis=1)
        better = found[row, chosen] > values[moving]
        far = np.abs(tried[row, chosen] - best[moving]).max(axis=1) >= _CONVERGED
        best[moving[better]], values[moving[better]] = tried[row, chosen][better], found[row, chosen][better]
        moving = moving[better & far]
        if not moving.size:
            break
    return np.column_stack([best[:, :2], se2.wrap(best[:, 2])]), _covariances(smooth, beams, best, how)


def _along_the_step(
    model: LikelihoodField,
    beams: Beams,
    poses: FloatArray,
    starts: FloatArray,
    how: Refinement,
    precision: FloatArray,
) -> FloatArray:
    """Poses (M, 6, 3) one Gauss–Newton step away, half of it, a quarter, and so on."""
    gradients, curvatures = normal_equations(model, beams, poses)
    gradients = how.alpha * gradients - (precision @ (poses - starts)[..., np.newaxis])[..., 0]
    curvatures = how.alpha * curvatures + precision
    damping = 1e-6 * np.trace(curvatures, axis1=1, axis2=2) + 1e-12
    damped = curvatures + damping[:, np.newaxis, np.newaxis] * np.eye(3)
    steps = np.linalg.solve(damped, gradients[..., np.newaxis])[..., 0]
    longest = 0.5 * how.reach
    return np.asarray(poses[:, np.newaxis] + _SHARES * np.clip(steps, -longest, longest)[:, np.newaxis])


def normal_equations(model: LikelihoodField, beams: Beams, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """−Σ w d J / σ² (M, 3) and Σ w J Jᵀ / σ² (M, 3, 3); derivatives by differences over a cell."""
    p = model.parameters
    ends, h = beams.endpoints, model.field.resolution
    shifts = np.array([[0.0, 0.0, 0.0], [h, 0.0, 0.0], [-h, 0.0, 0.0], [0.0, h, 0.0], [0.0, -h, 0.0]])
    around = (poses[:, np.newaxis] + shifts).reshape(-1, 3)
    d = np.nan_to_num(model.distances(beams, around), nan=model.field.max_dist).reshape(len(poses), 5, -1)
    d = np.minimum(d, model.field.max_dist)
    across = np.stack([d[:, 1] - d[:, 2], d[:, 3] - d[:, 4]], axis=-1) / (2.0 * h)
    c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    arm = np.stack([-s * ends[:, 0] - c * ends[:, 1], c * ends[:, 0] - s * ends[:, 1]], axis=-1)
    jacobian = np.concatenate([across, (across * arm).sum(axis=-1, keepdims=True)], axis=-1)
    hit = p.z_hit * np.exp(-0.5 * (d[:, 0] / p.sigma_hit) ** 2)
    weight = hit / np.maximum(hit + p.z_rand / beams.r_max, 1e-300) / p.sigma_hit**2
    weighted = jacobian * weight[..., np.newaxis]
    return -(weighted * d[:, 0, :, np.newaxis]).sum(axis=1), np.einsum("mbi,mbj->mij", weighted, jacobian)


def _covariances(model: LikelihoodField, beams: Beams, poses: FloatArray, how: Refinement) -> FloatArray:
    _, curvatures = normal_equations(model, beams, poses)
    steps = np.outer(how.spacing, how.spacing)
    values, vectors = np.linalg.eigh((how.alpha * curvatures + how.precision) * steps)
    spread = 1.0 / np.maximum(values, 1e-6) + 1.0 / 12.0
    scaled = (vectors * spread[:, np.newaxis]) @ vectors.transpose(0, 2, 1)
    return np.asarray(0.5 * (scaled + scaled.transpose(0, 2, 1)) * steps)
