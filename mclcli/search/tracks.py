"""Candidates followed through a window: from where one was found, scan by scan, and then all scans at once.

Odometry predicts where the next scan was taken, and the scan corrects it (an iterated Kalman filter on the field).
What drifts from one scan to the next is little, whatever it comes to over the window. The poses found so are where the
chain of all scans and of odometry between them starts from (``mclcli.smooth.chain``).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.native.backend import COMPILED
from mclcli.search import refine
from mclcli.search.refine import Refinement
from mclcli.smooth import chain, tridiagonal
from mclcli.smooth.chain import Unary
from mclcli.smooth.odometry import errors, linearise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.search.scene import View
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.likelihood_field import LikelihoodField
    from mclcli.smooth.chain import Smoothed
    from mclcli.smooth.tridiagonal import Factor

_FLAT = 1e-6  # curvature of a pose of which nothing is known
_STEPS = 4  # of a scan: the chain does the rest
REACH = np.array([0.6, 0.6, math.radians(20.0)])  # of a scan's pose from where odometry has it


@final
@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """Unary factors of a chain: the tempered log-likelihood of the beams (with a return) of every scan on its own.

    ``models`` (n,) are likelihood fields that interpolate; ``alphas`` (n,) temperatures.
    """

    models: Sequence[LikelihoodField]
    beams: Sequence[Beams]
    alphas: FloatArray

    def __call__(self, poses: FloatArray) -> Unary:
        """The factors at poses (m, n, 3)."""
        costs, gradients, curvatures = np.empty(poses.shape[:2]), np.empty(poses.shape), np.empty((*poses.shape, 3))
        for k, (model, beams) in enumerate(zip(self.models, self.beams, strict=True)):
            costs[:, k] = -self.alphas[k] * model.measure("lidar", beams).log_likelihood(poses[:, k])
            downhill, bent = refine.normal_equations(model, beams, poses[:, k])
            gradients[:, k], curvatures[:, k] = -self.alphas[k] * downhill, self.alphas[k] * bent
        return Unary(costs, gradients, curvatures)

    def costs(self, poses: FloatArray) -> FloatArray:
        """Costs (m, n) alone."""
        found = [
            -alpha * model.measure("lidar", beams).log_likelihood(poses[:, k])
            for k, (model, beams, alpha) in enumerate(zip(self.models, self.beams, self.alphas, strict=True))
        ]
        return np.stack(found, axis=1)


def follow(poses: FloatArray, start: int, ends: Ends, view: View, spacing: FloatArray) -> FloatArray:
    """Paths (M, n, 3) from poses (M, 3) at scan ``start``, through the later scans and then the earlier ones."""
    paths = np.empty((len(poses), len(ends.beams), 3))
    paths[:, start] = poses
    for order in (range(start + 1, len(ends.beams)), range(start - 1, -1, -1)):
        before, spread = start, np.zeros((len(poses), 3, 3))
        for k in order:
            paths[:, k], spread = _next(paths[:, before], spread, before, k, ends, view, spacing)
            before = k
    return paths


def _next(
    poses: FloatArray, spread: FloatArray, before: int, k: int, ends: Ends, view: View, spacing: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Poses (M, 3) at scan k, next to scan ``before``, and their covariances (M, 3, 3) in map."""
    assert view.odometry is not None  # noqa: S101 - there are two scans
    link = min(before, k)
    step, noise = view.odometry.increments[link], view.odometry.covariances[link]
    if k < before:
        step = se2.between(step, np.zeros(3))
    predicted = se2.compose(poses, step)
    turn = np.zeros((len(poses), 3, 3))
    heading = poses[:, 2] if k > before else predicted[:, 2]
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(heading)
    turn[:, 1, 0] = np.sin(heading)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    carried = np.tile(np.eye(3), (len(poses), 1, 1))
    carried[:, 0, 2], carried[:, 1, 2] = poses[:, 1] - predicted[:, 1], predicted[:, 0] - poses[:, 0]
    prior = carried @ spread @ carried.transpose(0, 2, 1) + turn @ noise @ turn.transpose(0, 2, 1)
    how = Refinement(REACH, spacing, float(ends.alphas[k]), np.linalg.inv(prior), _STEPS)
    return refine.refine(ends.models[k], ends.beams[k], predicted, how)


def costs_of(paths: FloatArray, ends: Ends, view: View) -> FloatArray:
    """Costs (M,) of paths (M, n, 3), as far as they tell good from bad ones."""
    total = ends.costs(paths).sum(axis=1)
    if view.odometry is not None:
        off = errors(paths, view.odometry.increments)
        precise = np.linalg.inv(view.odometry.covariances)
        total += np.minimum(0.5 * np.einsum("mki,kij,mkj->mk", off, precise, off), 10.0).sum(axis=1)
    return np.asarray(total)


def settle(paths: FloatArray, ends: Ends, view: View, steps: int) -> Smoothed:
    """The most probable paths near these (M, n, 3)."""
    assert view.odometry is not None  # noqa: S101 - there are two scans
    return chain.minimise(paths, ends, view.odometry, steps=steps)


def factorised(paths: FloatArray, ends: Ends, view: View) -> Factor:
    """Normal equations of paths (M, n, 3), for the volumes and the spreads of their modes.

    The field's slope changes its sign at a wall, so that right at it differences over a cell vanish: what the ends say
    is taken from around each pose, a cell to every side.
    """
    cell = ends.models[0].field.resolution
    around = cell * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    blocks = np.empty((*paths.shape, 3))
    for k, (model, beams) in enumerate(zip(ends.models, ends.beams, strict=True)):
        displaced = (paths[:, k, np.newaxis] + around).reshape(-1, 3)
        bent = refine.normal_equations(model, beams, displaced)[1].reshape(len(paths), 4, 3, 3)
        blocks[:, k] = ends.alphas[k] * bent.mean(axis=1) + _FLAT * np.eye(3)
    above = np.zeros((len(paths), 0, 3, 3))
    if view.odometry is not None:
        information = np.asarray(np.linalg.inv(view.odometry.covariances), np.float64)
        joined = linearise(paths, view.odometry, information)
        blocks += joined.curvatures
        above = joined.above
    return tridiagonal.factorise(blocks, above)


def interpolating(model: LikelihoodField, outliers: float, r_max: float) -> LikelihoodField:
    """The field with p = (1 − ``outliers``)·exp(−d²/2σ²) + ``outliers`` of interpolated distances d."""
    parameters = dataclasses.replace(
        model.parameters,
        field_lookup="bilinear",
        z_hit=1.0 - outliers,
        z_rand=outliers * r_max,
        hit_normalised="no",
        off_map="max_dist",
    )
    return dataclasses.replace(model, parameters=parameters, backend=COMPILED)
