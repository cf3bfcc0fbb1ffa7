"""Covariance of the estimate's error, where the likelihood is not how readings are distributed.

Particles say how wide the tempered likelihood makes the belief: with σ_hit = 0.2 m on a map that is good to 2 cm, far
too wide; along walls that a map draws wrongly, too narrow. The error follows from the scores s_i = ∂ log p_i / ∂pose of
the beams at the estimate, and from the curvature H = −Σ ∂² log p_i / ∂pose²:

    c = (Σ_i s_i² + 2 Σ_k (1 − k/K) Σ_i s_i s_{i+k}) / H        along and across the robot, and in yaw

with a sum over fewer than K neighbours, a third of the beams, is 1 where the likelihood is true, less where readings
fit better than it says, more where neighbouring beams err together. With M, P the belief's covariance before and after
the reading, and L = P⁻¹ − M⁻¹ what the reading adds,

    S = P (M⁻¹ S⁻ M⁻¹ + D L D) P,        D² = c in the robot's axes,        S⁻ = F S F' + Q,        Q = M − F P F'

is the covariance of the error, as that of a Kalman filter that weighs with another covariance than the true one.
Source: White 1982, *Maximum likelihood estimation of misspecified models* (the sandwich H⁻¹ J H⁻¹); Jazwinski 1970,
section 7.8 (errors of a filter with a wrong model); Newey and West 1987 (the weights 1 − k/K, with which c is never
negative). α is not in c: where beams err together, so do scans one after the other, because the map is wrong
(docs/decisions/0033).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.filter.estimate import may_be_apart, weighted_mean
from mclcli.geometry import se2, symmetric
from mclcli.geometry.symmetric import Symmetric
from mclcli.records import Estimate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.native.backend import Backend
    from mclcli.records import StepRecord
    from mclcli.sensors import Measurement

FLOOR = np.array([0.005, 0.005, math.radians(0.05)])  # standard deviations [m], [rad] that nothing stated is below
_STEP = np.array([0.05, 0.05, 0.0125])  # [m], [rad] of the differences: a cell of a usual map, and as much at 4 m
_LOOKS = np.concatenate([np.zeros((1, 3)), np.diag(_STEP), -np.diag(_STEP)])
_MOST = 60  # neighbours
_EVERY = 8  # updates from one look at the beams to the next
_MEMORY = 0.16  # share of the newest look in the running averages
_BOUNDS = (0.02, 4.0)  # of c
_LEAST = Symmetric.of(np.diag(np.square(FLOOR / 100.0)))  # added to what is inverted
_FLOOR = np.diag(np.square(FLOOR))
_FLAT = 1e-6  # determinant of the correlations below which rounding decides what an inverse is


class _Scores(NamedTuple):
    """Running averages over scans of one sensor: variances of the scores' sums (3,), and curvatures (3,)."""

    variances: FloatArray
    curvatures: FloatArray
    looks: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sandwich:
    """Covariance of the error after an update at ``stamp_ns``, and what the next one needs.

    ``belief`` is that of the particles, which were at ``pose`` (3,).
    """

    covariance: Symmetric
    belief: Symmetric
    pose: FloatArray
    stamp_ns: int
    scores: Mapping[str, _Scores]
    updates: int = 0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Of one update: the pose stated (3,), and covariances of the particles before and after the reading.

    ``concentration`` is Σ W² of their weights after it, 1 / ESS.
    """

    stamp_ns: int
    pose: FloatArray
    before: Symmetric
    after: Symmetric
    concentration: float


def update(last: Sandwich | None, moments: Moments, measurements: Sequence[Measurement]) -> Sandwich | None:
    """Covariance of the error after an update, from that after the one before, None at the start.

    None where the particles lie in a line or a plane, as a few of them do: no reading can be told from them.
    """
    before, after = symmetric.plus(moments.before, _LEAST), _corrected(moments)
    if min(symmetric.correlation_determinant(before), symmetric.correlation_determinant(after)) < _FLAT:
        return None
    count = 0 if last is None else last.updates
    scores = {} if last is None else last.scores
    if count % _EVERY == 0 or count < _EVERY:
        seen = [m for m in measurements if m.each is not None and m.count]
        scores = {**scores, **{m.sensor: _look(m, moments.pose, scores.get(m.sensor)) for m in seen}}
    information = symmetric.inverse(before)
    added = symmetric.plus(symmetric.inverse(after), information, -1.0)
    gained = symmetric.positive(added)
    if gained is not added:  # weights of a few particles say that the reading took knowledge away
        after = symmetric.inverse(symmetric.plus(information, gained))
    error_before = moments.before if last is None else _carried(last, moments)
    scale = _along_the_robot(np.sqrt(_ratio(scores)), float(moments.pose[2]))
    inner = symmetric.plus(symmetric.between(information, error_before), symmetric.between(scale, gained))
    return Sandwich(symmetric.between(after, inner), moments.after, moments.pose, moments.stamp_ns, scores, count + 1)


def state(
    last: Sandwich | None,
    log_weights: FloatArray,
    record: StepRecord,
    increment: FloatArray,
    measurements: Sequence[Measurement],
    backend: Backend,
) -> tuple[Estimate, Sandwich | None]:
    """The estimate of an update with the covariance of its error, and what the next update needs.

    ``log_weights`` (N,) are those of the particles before the reading. Particles in several places, or a single one,
    keep their own covariance, with the floor added: what matters there is which place is right. ``increment`` (3,) was
    moved since the last update. A lidar whose beams count as measured at one moment sees the robot from up to half a
    sweep's way off.
    """
    pose, belief = record.estimate.pose, record.estimate.covariance
    if may_be_apart(belief) or log_weights.size == 1:
        return Estimate(pose, belief + _FLOOR), None
    carried = np.exp(log_weights)
    free = _share_free(float(np.square(carried).sum()))
    before = Symmetric.of(weighted_mean(record.poses, carried, backend).covariance / free)
    moments = Moments(record.stamp_ns, pose, before, Symmetric.of(belief), 1.0 / record.ess)
    found = update(last, moments, measurements)
    if found is None:
        return Estimate(pose, _corrected(moments).matrix() + _FLOOR), None
    covariance = found.covariance.matrix() + _FLOOR
    sweep = max((m.sweep for m in measurements), default=0.0)
    if last is not None and sweep > 0.0:
        seconds = (record.stamp_ns - last.stamp_ns) * 1e-9
        c, s = math.cos(pose[2]), math.sin(pose[2])
        ahead, left, turn = (0.5 * min(1.0, sweep / seconds) * increment).tolist() if seconds > 0.0 else (0.0, 0.0, 0.0)
        way = np.array([c * ahead - s * left, s * ahead + c * left, turn])
        covariance += np.outer(way, way)
    return Estimate(pose, covariance), found


def _look(measurement: Measurement, pose: FloatArray, before: _Scores | None) -> _Scores:
    """Scores and curvatures of the beams from around a pose (3,), taken into the running averages."""
    assert measurement.each is not None  # noqa: S101 - the caller asked
    each = measurement.each(se2.compose(pose, _LOOKS))  # (7, B)
    middle, ahead, behind = each[0], each[1:4], each[4:7]
    slope = (ahead - behind) / (2.0 * _STEP[:, np.newaxis])
    curvatures = (2.0 * middle - ahead - behind).sum(axis=1) / np.square(_STEP)
    variances = _variance_of_sum(slope)
    if before is None:
        return _Scores(variances, curvatures, 1)
    share = max(_MEMORY, 1.0 / (before.looks + 1))
    return _Scores(
        before.variances + share * (variances - before.variances),
        before.curvatures + share * (curvatures - before.curvatures),
        before.looks + 1,
    )


def _variance_of_sum(slope: FloatArray) -> FloatArray:
    """Variance (3,) of a sum over beams (3, B) that are correlated: 1/K of the squares of all sums of K neighbours."""
    size = slope.shape[1]
    window = min(_MOST, max(1, size // 3))
    total = np.zeros((3, size + 2 * window))
    np.cumsum(slope, axis=1, out=total[:, window : window + size])
    total[:, window + size :] = total[:, window + size - 1 : window + size]
    return np.asarray(np.square(total[:, window:] - total[:, :-window]).sum(axis=1) / window, np.float64)


def _ratio(scores: Mapping[str, _Scores]) -> FloatArray:
    """c (3,) of all sensors, 1 where none tells."""
    variance, curvature = np.zeros(3), np.zeros(3)
    for one in scores.values():
        variance += one.variances
        curvature += one.curvatures
    lowest, highest = _BOUNDS
    ratio: FloatArray = np.clip(variance / np.maximum(curvature, 1e-12), lowest, highest)
    return np.asarray(np.where(curvature > 0.0, ratio, 1.0), np.float64)


def _corrected(moments: Moments) -> Symmetric:
    """Covariance of the weighted set without the bias of a small one: of a single particle, that before the reading."""
    factor, free = moments.concentration, _share_free(moments.concentration)
    return symmetric.plus(symmetric.plus(_LEAST, moments.after, 1.0 / free), moments.before, factor)


def _share_free(concentration: float) -> float:
    """1 − Σ W², by which a weighted covariance is too small on average (Kish 1965); at least a half."""
    return max(1.0 - concentration, 0.5)


def _carried(last: Sandwich, moments: Moments) -> Symmetric:
    """Covariance of the error before the reading: the last one moved, and what the motion has added."""
    dx, dy, _ = (moments.pose - last.pose).tolist()
    added = symmetric.positive(symmetric.plus(moments.before, symmetric.moved(last.belief, dx, dy), -1.0))
    return symmetric.plus(symmetric.moved(last.covariance, dx, dy), added)


def _along_the_robot(factors: FloatArray, yaw: float) -> Symmetric:
    """The matrix that stretches by these factors (3,) along and across the robot, and in yaw."""
    along, across, turn = factors.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    return Symmetric(
        along * c * c + across * s * s, (along - across) * c * s, 0.0, along * s * s + across * c * c, 0.0, turn
    )
