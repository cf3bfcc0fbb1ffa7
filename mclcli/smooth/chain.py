"""The most probable poses of a chain: what is known of each pose alone, joined by odometry from one to the next.

Gauss–Newton steps with Levenberg's damping minimise Σ_k f_k(x_k) + Σ_k g_k(x_k, x_{k+1}), f_k the unary factors and
g_k those of odometry. The normal equations are block tridiagonal, so that a step costs as much as the chain is long.
Many chains that share their factors are minimised at once, each with a damping of its own. Sources: Nocedal and Wright
2006, *Numerical Optimization*, section 10.3; Lu and Milios 1997 (poses joined by odometry).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol, final

import numpy as np

from mclcli.geometry import se2
from mclcli.smooth import odometry as between_poses
from mclcli.smooth import tridiagonal

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.smooth.odometry import Odometry
    from mclcli.smooth.tridiagonal import Factor

_STEPS = 40
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e-9, 1e6
_EASED, _RAISED = 0.2, 20.0  # what a better and a worse step make of the damping; it is raised to 1e-4 at least
_LONGEST = np.array([0.5, 0.5, 0.2])  # step of a pose [m, m, rad]: farther off, the curvature says nothing
_CONVERGED = np.array([1e-5, 1e-5, 1e-5])
_FLAT = 1e-9  # curvature of a pose of which nothing is known: chains of none but odometry have a solution, too


class Unary(NamedTuple):
    """Unary factors of m chains of n poses: costs (m, n), their gradients (m, n, 3) by x, y, yaw, and curvatures.

    A cost is a negative log-likelihood; curvatures (m, n, 3, 3) are symmetric and positive semidefinite.
    """

    costs: FloatArray
    gradients: FloatArray
    curvatures: FloatArray


class UnaryFactors(Protocol):
    """What is known of every pose by itself, the same for all chains; called with some chains or all, in any number."""

    def __call__(self, poses: FloatArray) -> Unary:
        """The factors at poses (m, n, 3)."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """The most probable poses (m, n, 3) of m chains, and how sure they are.

    ``unary_costs`` (m, n) and ``odometry_costs`` (m, n − 1) are what the factors cost there, ``log_determinants`` (m,)
    those of the normal equations. ``converged`` (m,) is False where the steps did not come to an end.
    """

    poses: FloatArray
    unary_costs: FloatArray
    odometry_costs: FloatArray
    converged: BoolArray
    _factor: Factor

    @property
    def costs(self) -> FloatArray:
        """Total costs (m,): negative logarithms of the posterior densities, up to a constant that all share."""
        return np.asarray(self.unary_costs.sum(axis=1) + self.odometry_costs.sum(axis=1))

    @property
    def log_determinants(self) -> FloatArray:
        """Logarithms (m,) of the determinants of the normal equations.

        By Laplace's method a chain's share of the posterior is exp(−cost − ½ log determinant), up to a factor.
        """
        return self._factor.log_determinants()

    def covariances(self) -> FloatArray:
        """Marginal covariances (m, n, 3, 3) of the poses."""
        return self._factor.marginals()


def minimise(poses: FloatArray, unary: UnaryFactors, odometry: Odometry, *, steps: int = _STEPS) -> Smoothed:
    """From poses (m, n, 3), each chain near where it is thought to be, to the nearest minimum of each.

    A chain's bits do not depend on the others. At most so many ``steps`` are tried.
    """
    information = np.asarray(np.linalg.inv(odometry.covariances), dtype=np.float64)
    best = _State.at(poses.copy(), unary, odometry, information)
    damping, converged = np.full(len(poses), _FIRST_DAMPING), np.zeros(len(poses), dtype=np.bool_)
    for _ in range(steps):
        moving = np.flatnonzero(~converged)
        if not moving.size:
            break
        step = best.step(moving, damping[moving])
        tried = best.poses[moving] + step
        tried[..., 2] = se2.wrap(tried[..., 2])
        found = _State.at(tried, unary, odometry, information)
        better = found.costs() <= best.costs()[moving]
        best.replace(moving[better], found, better)
        small = (np.abs(step) < _CONVERGED).all(axis=(1, 2))
        stuck = damping[moving] >= _MOST_DAMPING
        damping[moving] = np.where(
            better,
            np.maximum(_EASED * damping[moving], _LEAST_DAMPING),
            np.clip(_RAISED * damping[moving], 1e-4, _MOST_DAMPING),
        )
        converged[moving] = small | (stuck & ~better)
    factor = tridiagonal.factorise(best.damped(np.arange(len(poses)), np.zeros(len(poses))), best.above)
    return Smoothed(best.poses, best.unary_costs, best.odometry_costs, converged, factor)


@final
@dataclass(slots=True, eq=False)
class _State:
    """Poses (m, n, 3) with their factors: costs, and the blocks of their normal equations."""

    poses: FloatArray
    unary_costs: FloatArray
    odometry_costs: FloatArray
    gradients: FloatArray
    curvatures: FloatArray
    above: FloatArray

    @staticmethod
    def at(poses: FloatArray, unary: UnaryFactors, odometry: Odometry, information: FloatArray) -> _State:
        """The factors at these poses."""
        alone = unary(poses)
        joined = between_poses.linearise(poses, odometry, information)
        gradients, curvatures = alone.gradients + joined.gradients, alone.curvatures + joined.curvatures
        return _State(poses, alone.costs, joined.costs, gradients, curvatures, joined.above)

    def costs(self) -> FloatArray:
        """Total costs (m,)."""
        return np.asarray(self.unary_costs.sum(axis=1) + self.odometry_costs.sum(axis=1))

    def damped(self, chains: IntArray, damping: FloatArray) -> FloatArray:
        """Diagonal blocks of some chains, their diagonals larger by a share ``damping`` (of each chain)."""
        blocks = self.curvatures[chains].copy()
        for i in range(3):
            blocks[..., i, i] += damping[:, np.newaxis] * blocks[..., i, i] + _FLAT
        return blocks

    def step(self, chains: IntArray, damping: FloatArray) -> FloatArray:
        """Steps of some chains, no pose moving farther than is believed."""
        factor = tridiagonal.factorise(self.damped(chains, damping), self.above[chains])
        return np.clip(factor.solve(-self.gradients[chains]), -_LONGEST, _LONGEST)

    def replace(self, chains: IntArray, other: _State, chosen: BoolArray) -> None:
        """Take what is chosen of another state for so many chains of this one."""
        for name in _State.__slots__:
            getattr(self, name)[chains] = getattr(other, name)[chosen]
