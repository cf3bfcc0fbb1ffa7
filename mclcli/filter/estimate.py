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
    poses: NDArray[np.float64],
    weights: NDArray[np.float64],
    *,
    mean_of: str = "set",
    covariance_of: str = "set",
    most: int = 0,
) -> tuple[Estimate, tuple[Hypothesis, ...]]:
    """The estimate, and the heaviest clusters, at most so many.

    Mean and covariance are each of the whole ``set`` or of its ``heaviest`` cluster; nav2_amcl takes one of each. Of a
    large set hypotheses are those of 2,000 of its particles: clusters of less weight are not worth stating.
    """
    whole, heaviest = weighted_mean(poses, weights), "heaviest" in {mean_of, covariance_of}
    if not most and not heaviest:
        return whole, ()
    thin = poses.shape[0] > _THINNED
    found = clusters.find(poses, weights) if heaviest or not thin else _thinned(poses, weights)
    named = {"set": whole, "heaviest": found.heaviest}
    estimate = Estimate(named[mean_of].pose, named[covariance_of].covariance)
    places = zip(found.weights[:most].tolist(), found.means, found.covariances, strict=False)
    return estimate, tuple(Hypothesis(weight, Estimate(mean, spread)) for weight, mean, spread in places)


def _thinned(poses: NDArray[np.float64], weights: NDArray[np.float64]) -> clusters.Clusters:
    """Clusters of an even choice of particles that weigh the same."""
    pointers = (np.arange(_THINNED) + 0.5) / _THINNED
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), pointers), weights.size - 1)
    return clusters.find(poses[chosen], np.full(_THINNED, 1.0 / _THINNED))


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
