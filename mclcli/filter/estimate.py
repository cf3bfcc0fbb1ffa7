"""From a weighted set of particles to a pose and how sure it is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli import compiled, se2
from mclcli.filter import clusters
from mclcli.records import Estimate, Hypothesis
from mclcli.trigonometry import cos_sin

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CONVERGED_RADIUS = 0.5  # [m], as nav2_amcl's dist_threshold
_CONVERGED_SHARE = 0.95  # nav2_amcl asks for all, which some drawn anew would always spoil
_THINNED = 2000
_WORTH_COMPILING = 20_000  # particles: a function of their number alone, since sums differ in the last bits


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
    if poses.shape[0] >= _WORTH_COMPILING:
        return _weighted_mean_compiled(poses, weights)
    x, y, yaw = np.ascontiguousarray(poses.T)
    c, s = cos_sin(yaw)
    mean = np.array([np.sum(weights * x), np.sum(weights * y), math.atan2(np.sum(weights * s), np.sum(weights * c))])
    residual = np.stack([x - mean[0], y - mean[1], se2.wrap(yaw - mean[2])])
    return Estimate(mean, _covariance(residual, weights))


def _weighted_mean_compiled(poses: NDArray[np.float64], weights: NDArray[np.float64]) -> Estimate:
    """The same, summed in the particles' order."""
    kernels, poses = compiled.load("particles"), np.ascontiguousarray(poses)
    sums, covariance = np.zeros(4), np.zeros((3, 3))
    kernels.mean_sums(poses, weights, sums, np.empty((3, 512)))
    mean = np.array([sums[0], sums[1], math.atan2(sums[3], sums[2])])
    kernels.covariance_sums(poses, weights, mean, covariance)
    return Estimate(mean, covariance + np.tril(covariance, -1).T)


def _covariance(residual: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ W r rᵀ of r (3, N) by fixed-order sums: BLAS may order them by the number of its threads."""
    covariance = np.empty((3, 3))
    for i in range(3):
        weighted = weights * residual[i]
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = np.sum(weighted * residual[j])
    return covariance


def has_converged(poses: NDArray[np.float64], estimate: Estimate) -> bool:
    """Whether 95 % of the particles are within 0.5 m of the estimate in x and in y."""
    x, y, _ = estimate.pose.tolist()
    near = (np.abs(poses[:, 0] - x) <= _CONVERGED_RADIUS) & (np.abs(poses[:, 1] - y) <= _CONVERGED_RADIUS)
    return bool(np.count_nonzero(near) >= _CONVERGED_SHARE * near.size)
