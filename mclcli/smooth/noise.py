"""What a smoothed drive says of its odometry: how uncertain an increment is, and by how much all of them are off.

An increment u that moves t [m] and turns r [rad] is uncertain by

    var_along = ν₁|t| + ν₂|r|,   var_yaw = ν₃|t| + ν₄|r|,

and sideways by what its yaw walks meanwhile: t²/3 · var_yaw, correlated with the yaw by t/2 · var_yaw. ν grow with the
way, so that it does not matter into how many increments it is cut. Their most probable values come from the smoothed
increments and how uncertain these are. Source: Shumway and Stoffer 1982 (EM with a smoother), weights by iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.smooth.odometry import jacobians

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

FLOOR = np.array([0.002, 0.002, 0.001])  # [m, m, rad] per unit of way: what stamps and rounding add
_LEAST = np.array([2e-4, 2e-4, 1e-4])  # of any increment: a robot at rest shakes
_MOVE, _TURN = 0.25, 0.2  # [m], [rad]: a unit of way, as much as between two updates of the filter
_ROUNDS = 20
_SMALL = 1e-8


@final
@dataclass(frozen=True, slots=True)
class Drift:
    """ν of the variances, by move [m] and turn [rad], and what all increments are off by.

    What was driven is (1 + ``length``)·(x, y) and (1 + ``turn``)·yaw + ``pull``·t, with ``pull`` in rad/m.
    """

    along_by_move: float = 0.02**2
    along_by_turn: float = 0.005**2
    yaw_by_move: float = 0.02**2
    yaw_by_turn: float = 0.02**2
    length: float = 0.0
    turn: float = 0.0
    pull: float = 0.0

    def corrected(self, increments: FloatArray) -> FloatArray:
        """Increments (K, 3) without what all of them are off by."""
        moved = np.hypot(increments[:, 0], increments[:, 1])
        yaw = (1.0 + self.turn) * increments[:, 2] + self.pull * moved
        return np.column_stack([(1.0 + self.length) * increments[:, :2], yaw])

    def covariances(self, increments: FloatArray) -> FloatArray:
        """Covariances (K, 3, 3) of increments (K, 3), in the frame of the base at their beginning."""
        moved, turned = np.hypot(increments[:, 0], increments[:, 1]), np.abs(increments[:, 2])
        along = self.along_by_move * moved + self.along_by_turn * turned
        yaw = self.yaw_by_move * moved + self.yaw_by_turn * turned
        c, s = _direction(increments)
        across = yaw * moved**2 / 3.0
        both = yaw * moved / 2.0
        found = np.zeros((len(increments), 3, 3))
        found[:, 0, 0], found[:, 1, 1] = c * c * along + s * s * across, s * s * along + c * c * across
        found[:, 0, 1] = found[:, 1, 0] = c * s * (along - across)
        found[:, 0, 2] = found[:, 2, 0] = -s * both
        found[:, 1, 2] = found[:, 2, 1] = c * both
        found[:, 2, 2] = yaw
        floors = FLOOR**2 * np.minimum(way(increments), 1.0)[:, np.newaxis] + _LEAST**2
        found[:, range(3), range(3)] += floors
        return found


def way(increments: FloatArray) -> FloatArray:
    """How far increments (K, 3) lead, in units of what the filter takes for an update."""
    return np.asarray(np.hypot(increments[:, 0], increments[:, 1]) / _MOVE + np.abs(increments[:, 2]) / _TURN)


def _direction(increments: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine (K,) of the mean direction of a move in its first frame; of half the turn where it is none."""
    moved = np.hypot(increments[:, 0], increments[:, 1])
    angle = np.where(moved > 0.01, np.arctan2(increments[:, 1], increments[:, 0]), 0.5 * increments[:, 2])
    return np.cos(angle), np.sin(angle)


def fit(
    poses: FloatArray,
    covariances: FloatArray,
    crossed: FloatArray,
    increments: FloatArray,
    before: Drift,
    used: FloatArray,
) -> Drift:
    """Drift that makes smoothed poses (n, 3) most probable, from increments (n − 1, 3) of which those ``used`` count.

    ``covariances`` (n, 3, 3) are those of the poses, ``crossed`` (n − 1, 3, 3) those of a pose and the next one.
    """
    moved, turned = np.hypot(increments[:, 0], increments[:, 1]), np.abs(increments[:, 2])
    driven = se2.between(poses[:-1], poses[1:])
    spread = _spread(poses, covariances, crossed)
    c, s = _direction(increments)
    error = driven - before.corrected(increments)
    error[:, 2] = se2.wrap(error[:, 2])
    along = (c * error[:, 0] + s * error[:, 1]) ** 2 + np.einsum("ni,nij,nj->n", _ray(c, s), spread, _ray(c, s))
    yaw = error[:, 2] ** 2 + spread[:, 2, 2]
    by_way = np.column_stack([moved, turned])[used]
    floors = (FLOOR**2 * np.minimum(way(increments), 1.0)[:, np.newaxis] + _LEAST**2)[used]
    return Drift(
        *_variances(by_way, along[used], floors[:, 0], (before.along_by_move, before.along_by_turn)),
        *_variances(by_way, yaw[used], floors[:, 2], (before.yaw_by_move, before.yaw_by_turn)),
        *_systematic(driven[used], increments[used], before),
    )


def _ray(c: FloatArray, s: FloatArray) -> FloatArray:
    return np.column_stack([c, s, np.zeros_like(c)])


def _spread(poses: FloatArray, covariances: FloatArray, crossed: FloatArray) -> FloatArray:
    """Covariances (n − 1, 3, 3) of the increments of uncertain poses (n, 3)."""
    first, second = (part[0] for part in jacobians(poses[np.newaxis]))
    mixed = first @ crossed @ second.transpose(0, 2, 1)
    own = first @ covariances[:-1] @ first.transpose(0, 2, 1) + second @ covariances[1:] @ second.transpose(0, 2, 1)
    return np.asarray(own + mixed + mixed.transpose(0, 2, 1))


def _variances(
    by_way: FloatArray, squares: FloatArray, floors: FloatArray, start: tuple[float, float]
) -> tuple[float, float]:
    """ν ≥ 0 of squares ≈ by_way · ν + floors, weighted by 1/variance²: the maximum of a Gaussian likelihood."""
    found = np.maximum(start, _SMALL)
    for _ in range(_ROUNDS):
        weight = 1.0 / (by_way @ found + floors) ** 2
        found = np.maximum(_not_negative(by_way, squares - floors, weight), _SMALL)
    return float(found[0]), float(found[1])


def _not_negative(by: FloatArray, value: FloatArray, weight: FloatArray) -> FloatArray:
    """Weighted least squares in two unknowns that may not be negative."""
    a, b = (by * weight[:, np.newaxis]).T @ by, (by * weight[:, np.newaxis]).T @ value
    determinant = a[0, 0] * a[1, 1] - a[0, 1] ** 2
    if determinant > 1e-9 * a[0, 0] * a[1, 1]:
        both = np.array([a[1, 1] * b[0] - a[0, 1] * b[1], a[0, 0] * b[1] - a[0, 1] * b[0]]) / determinant
        if (both >= 0.0).all():
            return np.asarray(both)
    alone = np.maximum(b, 0.0) / np.maximum(np.diag(a), 1e-300)
    gain = np.maximum(b, 0.0) * alone
    return np.where(np.arange(2) == gain.argmax(), alone, 0.0)


def _systematic(driven: FloatArray, increments: FloatArray, before: Drift) -> tuple[float, float, float]:
    """``length``, ``turn`` and ``pull`` by weighted least squares, held near 0 by a weak prior of 5 %."""
    moved = np.hypot(increments[:, 0], increments[:, 1])
    precision = 1.0 / before.covariances(increments)[:, range(3), range(3)]
    c, s = _direction(increments)
    along = c * (driven - increments)[:, 0] + s * (driven - increments)[:, 1]
    weight = 1.0 / (before.along_by_move * moved + before.along_by_turn * np.abs(increments[:, 2]) + 1e-6)
    length = (weight * moved * along).sum() / ((weight * moved * moved).sum() + 400.0)
    by = np.column_stack([increments[:, 2], moved])
    a = (by * precision[:, 2:]).T @ by + 400.0 * np.eye(2)
    off = se2.wrap(driven[:, 2] - increments[:, 2])
    turn, pull = np.linalg.solve(a, (by * precision[:, 2:]).T @ off)
    return float(length), float(turn), float(pull)
