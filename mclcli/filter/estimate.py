"""From a weighted set of particles to a pose and how sure it is."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.filter import clusters
from mclcli.geometry import se2
from mclcli.geometry.trigonometry import cos_sin
from mclcli.native import backend
from mclcli.records import Estimate, Hypothesis

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray

    FindHypotheses = Callable[[], tuple[Hypothesis, ...]]

_CONVERGED_RADIUS = 0.5  # [m], as nav2_amcl's dist_threshold
_CONVERGED_SHARE = 0.95  # nav2_amcl asks for all, which some drawn anew would always spoil
_THINNED = 2000
_LOWER = np.tril_indices(3)


def report(
    poses: FloatArray,
    weights: FloatArray,
    *,
    mean_of: str = "set",
    covariance_of: str = "set",
    most: int = 0,
) -> tuple[Estimate, FindHypotheses]:
    """The estimate, and a function that finds the heaviest clusters, at most so many, when it is called.

    Mean and covariance are each of the whole ``set`` or of its ``heaviest`` cluster; nav2_amcl takes one of each. Of a
    large set hypotheses are those of 2,000 of its particles: clusters of less weight are not worth reporting.
    """
    whole = weighted_mean(poses, weights)
    if "heaviest" not in {mean_of, covariance_of}:
        return whole, functools.cache(lambda: _heaviest(_of_some(poses, weights), most) if most else ())
    found = clusters.find(poses, weights)
    named = {"set": whole, "heaviest": found.heaviest}
    return Estimate(named[mean_of].pose, named[covariance_of].covariance), lambda: _heaviest(found, most)


def _heaviest(found: clusters.Clusters, most: int) -> tuple[Hypothesis, ...]:
    places = zip(found.weights[:most].tolist(), found.means, found.covariances, strict=False)
    return tuple(Hypothesis(weight, Estimate(mean, spread)) for weight, mean, spread in places)


def _of_some(poses: FloatArray, weights: FloatArray) -> clusters.Clusters:
    """Clusters of all particles, or of an even choice that weigh the same."""
    if weights.size <= _THINNED:
        return clusters.find(poses, weights)
    pointers = (np.arange(_THINNED) + 0.5) / _THINNED
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), pointers), weights.size - 1)
    return clusters.find(poses[chosen], np.full(_THINNED, 1.0 / _THINNED))


def weighted_mean(poses: FloatArray, weights: FloatArray) -> Estimate:
    """Mean with circular yaw, and covariance Σ W r rᵀ of r = (dx, dy, wrap(dyaw)), for poses (N, 3), weights (N,).

    Source: Mardia and Jupp 2000, *Directional Statistics*, section 2.2 (mean direction).
    """
    if backend.in_use():
        return _weighted_mean_compiled(poses, weights)
    columns = np.ascontiguousarray(poses.T)
    x, y, c, s = (weights * np.array([columns[0], columns[1], *cos_sin(columns[2])])).sum(axis=1).tolist()
    mean = np.array([x, y, math.atan2(s, c)])
    residual = columns - mean[:, np.newaxis]
    residual[2] = se2.wrap(residual[2])
    return Estimate(mean, _covariance(residual, weights))


def _weighted_mean_compiled(poses: FloatArray, weights: FloatArray) -> Estimate:
    """The same to the bit, without a copy of every column."""
    mean, covariance = np.empty(3), np.empty((3, 3))
    scratch = np.empty((6, 128)), np.empty((65, 6))
    backend.load("moments").mean_and_covariance(np.ascontiguousarray(poses), weights, mean, covariance, *scratch)
    return Estimate(mean, covariance)


def _covariance(residual: FloatArray, weights: FloatArray) -> FloatArray:
    """Σ W r rᵀ of r (3, N) by fixed-order sums: BLAS may order them by the number of its threads."""
    one, other = _LOWER
    covariance = np.empty((3, 3))
    covariance[one, other] = covariance[other, one] = ((weights * residual)[one] * residual[other]).sum(axis=1)
    return covariance


def has_converged(poses: FloatArray, estimate: Estimate) -> bool:
    """Whether 95 % of the particles are within 0.5 m of the estimate in x and in y."""
    x, y, _ = estimate.pose.tolist()
    return bool(count_near(poses, x, y) >= _CONVERGED_SHARE * poses.shape[0])


def count_near(poses: FloatArray, x: float, y: float) -> int:
    """How many poses (N, 3) are within 0.5 m of a place [m] in x and in y."""
    if not backend.in_use():
        near = (np.abs(poses[:, 0] - x) <= _CONVERGED_RADIUS) & (np.abs(poses[:, 1] - y) <= _CONVERGED_RADIUS)
        return int(np.count_nonzero(near))
    count = np.zeros(1, np.int64)
    backend.load("moments").count_near(np.ascontiguousarray(poses), x, y, _CONVERGED_RADIUS, count)
    return int(count[0])
