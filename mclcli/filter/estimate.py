"""From a weighted set of particles to a pose and how sure it is."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.filter import clusters
from mclcli.geometry import se2
from mclcli.geometry.trigonometry import cos_sin
from mclcli.native.backend import NUMPY, Backend
from mclcli.records import Estimate, Hypothesis

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray

    FindHypotheses = Callable[[], tuple[Hypothesis, ...]]

_CONVERGED_RADIUS = 0.5  # [m], as nav2_amcl's dist_threshold
_APART = (0.5, math.radians(20.0))  # standard deviations [m], [rad] above which one mean may lie between clusters
_CONVERGED_SHARE = 0.95  # nav2_amcl asks for all, which some drawn anew would always spoil
_THINNED = 2000
_UNBUFFERED = 8192
_LOWER = np.tril_indices(3)


def report(
    poses: FloatArray,
    weights: FloatArray,
    *,
    mean_of: str = "set",
    covariance_of: str = "set",
    most: int = 0,
    backend: Backend = NUMPY,
) -> tuple[Estimate, FindHypotheses]:
    """The estimate, and a function that finds the heaviest clusters, at most so many, when it is called.

    Mean and covariance are each of the whole ``set`` or of its ``heaviest`` cluster; nav2_amcl takes one of each. With
    ``heaviest_if_apart`` the mean of a set that may be in two rooms is that of its heaviest cluster, and the covariance
    of the set is about that pose. Of a large set hypotheses are those of 2,000 of its particles: clusters of less
    weight are not worth reporting.
    """
    whole = weighted_mean(poses, weights, backend)
    if mean_of == "heaviest_if_apart" and not may_be_apart(whole.covariance):
        mean_of = "set"
    if {mean_of, covariance_of} == {"set"}:
        return whole, functools.cache(lambda: _heaviest(_of_some(poses, weights, backend), most) if most else ())
    found = clusters.find(poses, weights, backend=backend)
    stated = whole if mean_of == "set" else found.heaviest
    if mean_of == "heaviest_if_apart":
        whole = _about(stated.pose, poses, weights)
    spread = whole if covariance_of == "set" else found.heaviest
    return Estimate(stated.pose, spread.covariance), lambda: _heaviest(found, most)


def may_be_apart(covariance: FloatArray) -> bool:
    """Whether a set is spread so widely that its mean may lie where none of it is."""
    distance, turn = _APART
    return bool(covariance[0, 0] + covariance[1, 1] > distance**2 or covariance[2, 2] > turn**2)


def _about(pose: FloatArray, poses: FloatArray, weights: FloatArray) -> Estimate:
    """A pose (3,) and Σ W r rᵀ of what poses (N, 3) with weights (N,) are off it."""
    residual = poses.T - pose[:, np.newaxis]
    residual[2] = se2.wrap(residual[2])
    return Estimate(pose, _covariance(residual, weights))


def _heaviest(found: clusters.Clusters, most: int) -> tuple[Hypothesis, ...]:
    places = zip(found.weights[:most].tolist(), found.means, found.covariances, strict=False)
    return tuple(Hypothesis(weight, Estimate(mean, spread)) for weight, mean, spread in places)


def _of_some(poses: FloatArray, weights: FloatArray, backend: Backend) -> clusters.Clusters:
    """Clusters of all particles, or of an even choice that weigh the same."""
    if weights.size <= _THINNED:
        return clusters.find(poses, weights, backend=backend)
    pointers = (np.arange(_THINNED) + 0.5) / _THINNED
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), pointers), weights.size - 1)
    return clusters.find(poses[chosen], np.full(_THINNED, 1.0 / _THINNED), backend=backend)


def weighted_mean(poses: FloatArray, weights: FloatArray, backend: Backend = NUMPY) -> Estimate:
    """Mean with circular yaw, and covariance Σ W r rᵀ of r = (dx, dy, wrap(dyaw)), for poses (N, 3), weights (N,).

    Source: Mardia and Jupp 2000, *Directional Statistics*, section 2.2 (mean direction).
    """
    kernels = backend.kernels("moments")
    if kernels is not None:  # without a copy of every column
        pose, covariance, scratch = np.empty(3), np.empty((3, 3)), (np.empty((6, 128)), np.empty((65, 6)))
        kernels.mean_and_covariance(np.ascontiguousarray(poses), weights, pose, covariance, *scratch)
        return Estimate(pose, covariance)
    columns = np.ascontiguousarray(poses.T)
    x, y, c, s = _sums(weights * np.array([columns[0], columns[1], *cos_sin(columns[2])])).tolist()
    mean = np.array([x, y, math.atan2(s, c)])
    residual = columns - mean[:, np.newaxis]
    residual[2] = se2.wrap(residual[2])
    return Estimate(mean, _covariance(residual, weights))


def _covariance(residual: FloatArray, weights: FloatArray) -> FloatArray:
    """Σ W r rᵀ of r (3, N) by fixed-order sums: BLAS may order them by the number of its threads."""
    one, other = _LOWER
    covariance = np.empty((3, 3))
    covariance[one, other] = covariance[other, one] = _sums((weights * residual)[one] * residual[other])
    return covariance


def _sums(rows: FloatArray) -> FloatArray:
    """Sum (K,) of each row (K, N) in the order of ``mclcli.kernels.moments``.

    NumPy's own order is that up to 8,192 terms; of longer rows some versions add buffers up one by one.
    """
    count = rows.shape[1]
    if count <= _UNBUFFERED:
        return np.asarray(rows.sum(axis=1))
    half = count // 2
    half -= half % 8
    return _sums(rows[:, :half]) + _sums(rows[:, half:])


def has_converged(poses: FloatArray, estimate: Estimate, backend: Backend = NUMPY) -> bool:
    """Whether 95 % of the particles are within 0.5 m of the estimate in x and in y."""
    x, y, _ = estimate.pose.tolist()
    return bool(count_near(poses, x, y, backend) >= _CONVERGED_SHARE * poses.shape[0])


def count_near(poses: FloatArray, x: float, y: float, backend: Backend = NUMPY) -> int:
    """How many poses (N, 3) are within 0.5 m of a place [m] in x and in y."""
    kernels = backend.kernels("moments")
    if kernels is None:
        near = (np.abs(poses[:, 0] - x) <= _CONVERGED_RADIUS) & (np.abs(poses[:, 1] - y) <= _CONVERGED_RADIUS)
        return int(np.count_nonzero(near))
    count = np.zeros(1, np.int64)
    kernels.count_near(np.ascontiguousarray(poses), x, y, _CONVERGED_RADIUS, count)
    return int(count[0])
