"""Errors of paired poses: absolute, and relative over a way or a time.

Definitions: Sturm et al. 2012, *A benchmark for the evaluation of RGB-D SLAM systems* (ATE, RPE); Zhang and Scaramuzza
2018, *A tutorial on quantitative trajectory evaluation*. Here in SE(2), and without alignment unless asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.evaluate.association import Matching, Pairs, associate
from mclcli.geometry import se2

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.geometry.trajectory import Trajectory


@final
@dataclass(frozen=True, slots=True)
class Statistics:
    """Of M ≥ 1 magnitudes; ``std`` divides by M."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    count: int


def statistics(values: FloatArray) -> Statistics | None:
    """Statistics of the magnitudes of values (M,), None of no value."""
    sizes = np.abs(values)
    if not sizes.size:
        return None
    return Statistics(
        rmse=float(np.sqrt(np.mean(sizes**2))),
        mean=float(sizes.mean()),
        median=float(np.median(sizes)),
        std=float(sizes.std()),
        min=float(sizes.min()),
        max=float(sizes.max()),
        count=sizes.size,
    )


@final
@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Absolute pose errors at the M stamps of a track that the reference covers, of ``total`` in all.

    ``translation`` (M,) [m], Euclidean; ``yaw`` (M,) [rad], signed.
    """

    stamps_ns: IntArray
    translation: FloatArray
    yaw: FloatArray
    total: int

    @property
    def translation_rmse(self) -> float:
        """Root mean square of the translation errors [m]."""
        return float(np.sqrt(np.mean(self.translation**2)))

    @property
    def yaw_rmse(self) -> float:
        """Root mean square of the yaw errors [rad]."""
        return float(np.sqrt(np.mean(self.yaw**2)))


def errors_of(pairs: Pairs) -> PoseErrors:
    """Absolute errors of paired poses."""
    error = pairs.estimated - pairs.expected
    translation = np.hypot(error[:, 0], error[:, 1])
    return PoseErrors(pairs.stamps_ns, translation, se2.wrap(error[:, 2]), pairs.total)


def absolute_pose_errors(
    track: Trajectory, reference: Trajectory, max_gap_ns: int = Matching().max_gap_ns
) -> PoseErrors:
    """Errors of each pose of the track against the reference interpolated at its stamp, without alignment.

    Raises
    ------
    InputError
        If the reference covers no pose of the track.

    """
    return errors_of(associate(track, reference, Matching(max_gap_ns=max_gap_ns)))


@final
@dataclass(frozen=True, slots=True, eq=False)
class RelativeErrors:
    """Drift between P pairs of moments, per metre of way or per second.

    ``translation`` (P,) [m/m or m/s] ≥ 0 and ``yaw`` (P,) [rad/m or rad/s], signed; ``spans`` (P,) [m or s] between
    the two moments.
    """

    translation: FloatArray
    yaw: FloatArray
    spans: FloatArray


def relative_errors(pairs: Pairs, *, per: str = "metre", span: float = 1.0) -> RelativeErrors:
    """Relative pose errors from each pose to the first one ``span`` further on, over the span really covered.

    E = (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), P estimated and Q expected, all i (Sturm et al. 2012, eq. 2); divided by the
    reference's way [m] or the time [s] from i to j, as scans may lie much further apart than ``span``. Pairs across a
    hole in the association are left out.
    """
    along = way_of(pairs.expected) if per == "metre" else pairs.seconds
    first = np.arange(along.size)
    last = np.searchsorted(along, along + span * (1.0 - 1e-9))
    inside = last < along.size
    inside[inside] = pairs.pieces[first[inside]] == pairs.pieces[last[inside]]
    i, j = first[inside], last[inside]
    wanted = se2.between(pairs.expected[i], pairs.expected[j])
    error = se2.between(wanted, se2.between(pairs.estimated[i], pairs.estimated[j]))
    spans = along[j] - along[i]
    return RelativeErrors(np.hypot(error[:, 0], error[:, 1]) / spans, error[:, 2] / spans, spans)


def way_of(poses: FloatArray, stride: float = 0.1) -> FloatArray:
    """Length [m] of the way through poses (M, 3), up to each of them.

    The way is made in steps of at least ``stride`` [m]: a reference that trembles at rest does not drive.
    """
    x, y = poses[:, 0].tolist(), poses[:, 1].tolist()
    way, last, total = [0.0], 0, 0.0
    for i in range(1, len(x)):
        step = math.hypot(x[i] - x[last], y[i] - y[last])
        if step >= stride:
            last, total = i, total + step
        way.append(total)
    return np.array(way)


def share_within(translation: FloatArray, bound: float) -> float:
    """Share of errors (M,) that are at most ``bound`` [m], from 0 to 1."""
    return float(np.mean(translation <= bound))
