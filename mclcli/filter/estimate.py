"""From a weighted set of particles to a pose and how sure it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli import se2
from mclcli.filter import clusters
from mclcli.records import Estimate, Hypothesis

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CONVERGED_RADIUS = 0.5  # [m], as nav2_amcl's dist_threshold
_CONVERGED_SHARE = 0.95  # nav2_amcl asks for all, which some drawn anew would always spoil
_THINNED = 2000


def stated(
    poses: NDArray[np.float64], weights: NDArray[np.float64], *, mean_of: str = "set", covariance_of: str = "set"
) -> Estimate:
    """Mean and covariance, each of the whole ``set`` or of its ``heaviest`` cluster; nav2_amcl takes one of each."""
    whole = weighted_mean(poses, weights)
    if mean_of == covariance_of == "set":
        return whole
    heaviest = clusters.find(poses, weights).heaviest
    mean, covariance = (heaviest if of == "heaviest" else whole for of in (mean_of, covariance_of))
    return Estimate(mean.pose, covariance.covariance)


def weighted_mean(poses: NDArray[np.float64], weights: NDArray[np.float64]) -> Estimate:
    """Mean with circular yaw, and covariance Σ W r rᵀ of r = (dx, dy, wrap(dyaw)), for poses (N, 3), weights (N,).

    Source: Mardia and Jupp 2000, *Directional Statistics*, section 2.2 (mean direction).
    """
    position = np.sum(weights[:, np.newaxis] * poses[:, :2], axis=0)
    yaw = np.arctan2(np.sum(weights * np.sin(poses[:, 2])), np.sum(weights * np.cos(poses[:, 2])))
    mean = np.array([position[0], position[1], yaw])
    residual = poses - mean
    residual[:, 2] = se2.wrap(residual[:, 2])
    return Estimate(mean, _covariance(residual, weights))


def _covariance(residual: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ W r rᵀ by fixed-order sums: BLAS may order them by the number of its threads."""
    covariance = np.empty((3, 3))
    for i in range(3):
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = np.sum(weights * residual[:, i] * residual[:, j])
    return covariance


def has_converged(poses: NDArray[np.float64], estimate: Estimate) -> bool:
    """Whether 95 % of the particles are within 0.5 m of the estimate in x and in y."""
    offset = np.abs(poses[:, :2] - estimate.pose[:2]).max(axis=1)
    return bool(np.count_nonzero(offset <= _CONVERGED_RADIUS) >= _CONVERGED_SHARE * offset.size)


def hypotheses(poses: NDArray[np.float64], weights: NDArray[np.float64], most: int) -> tuple[Hypothesis, ...]:
    """The heaviest clusters of poses (N, 3) with weights (N,), at most so many.

    A large set is thinned to 2,000 equally weighted particles first: clusters of less weight are not worth stating.
    """
    if most == 0:
        return ()
    if poses.shape[0] > _THINNED:
        pointers = (np.arange(_THINNED) + 0.5) / _THINNED
        chosen = np.minimum(np.searchsorted(np.cumsum(weights), pointers), weights.size - 1)
        poses, weights = poses[chosen], np.full(_THINNED, 1.0 / _THINNED)
    found = clusters.find(poses, weights)
    heaviest = zip(found.weights[:most].tolist(), found.means, found.covariances, strict=False)
    return tuple(Hypothesis(weight, Estimate(mean, covariance)) for weight, mean, covariance in heaviest)
