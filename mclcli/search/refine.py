"""From the best cell and angle to the best pose: Gauss–Newton on the interpolated distance field.

A beam adds log(z_hit·exp(−d²/2σ²) + z_rand/r_max); its derivative is that of −w·d²/2σ² with w the share of the hit
component, so that each step solves Σ w J Jᵀ δ = −Σ w d J with J the derivative of d by the pose. Source: Nocedal and
Wright 2006, *Numerical Optimization*, section 10.3.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from mclcli import se2

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.sensors.beams import Beams
    from mclcli.sensors.likelihood_field import LikelihoodField

_STEPS = 12
_CONVERGED = 1e-5


def refine(
    model: LikelihoodField, beams: Beams, pose: NDArray[np.float64], spacing: NDArray[np.float64], alpha: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pose (3,) of a local maximum near ``pose`` (3,), and its covariance (3, 3).

    ``spacing`` (3,) is the lattice's in x, y [m] and yaw [rad]: the maximum is sought within two steps of it. The
    covariance is the inverse curvature of ``alpha`` times the log-likelihood, at least that of a pose somewhere in one
    step of the lattice.
    """
    smooth = dataclasses.replace(model, parameters=dataclasses.replace(model.parameters, field_lookup="bilinear"))
    score = smooth.measure("lidar", beams).log_likelihood
    best, value = pose.copy(), float(score(pose[np.newaxis])[0])
    for _ in range(_STEPS):
        gradient, curvature = _normal_equations(smooth, beams, best)
        step = np.linalg.solve(curvature + 1e-6 * np.trace(curvature) * np.eye(3) + 1e-12 * np.eye(3), gradient)
        scales = 0.5 ** np.arange(6)[:, np.newaxis]
        tried = best + scales * np.clip(step, -spacing, spacing)
        tried = np.clip(tried, pose - 2.0 * spacing, pose + 2.0 * spacing)
        values = score(tried)
        if not values.max() > value:
            break
        moved = np.abs(tried[values.argmax()] - best).max()
        best, value = tried[values.argmax()], float(values.max())
        if moved < _CONVERGED:
            break
    return np.append(best[:2], se2.wrap(best[2])), _covariance(smooth, beams, best, spacing, alpha)


def _normal_equations(
    model: LikelihoodField, beams: Beams, pose: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """−Σ w d J / σ² (3,) and Σ w J Jᵀ / σ² (3, 3); derivatives by differences over a cell."""
    p = model.parameters
    ends, h = beams.endpoints, model.field.resolution
    shifts = np.array([[0.0, 0.0, 0.0], [h, 0.0, 0.0], [-h, 0.0, 0.0], [0.0, h, 0.0], [0.0, -h, 0.0]])
    d = np.nan_to_num(model.distances(beams, pose + shifts), nan=model.field.max_dist)
    d = np.minimum(d, model.field.max_dist)
    across = np.stack([d[1] - d[2], d[3] - d[4]], axis=-1) / (2.0 * h)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    arm = np.stack([-s * ends[:, 0] - c * ends[:, 1], c * ends[:, 0] - s * ends[:, 1]], axis=-1)
    jacobian = np.column_stack([across, (across * arm).sum(axis=1)])
    hit = p.z_hit * np.exp(-0.5 * (d[0] / p.sigma_hit) ** 2)
    weight = hit / np.maximum(hit + p.z_rand / beams.r_max, 1e-300) / p.sigma_hit**2
    weighted = jacobian * weight[:, np.newaxis]
    return -(weighted * d[0][:, np.newaxis]).sum(axis=0), np.einsum("bi,bj->ij", weighted, jacobian)


def _covariance(
    model: LikelihoodField, beams: Beams, pose: NDArray[np.float64], spacing: NDArray[np.float64], alpha: float
) -> NDArray[np.float64]:
    _, curvature = _normal_equations(model, beams, pose)
    values, vectors = np.linalg.eigh(alpha * curvature / np.outer(1.0 / spacing, 1.0 / spacing))
    spread = 1.0 / np.maximum(values, 1e-6) + 1.0 / 12.0
    scaled = vectors * spread @ vectors.T
    return np.asarray(0.5 * (scaled + scaled.T) * np.outer(spacing, spacing))
