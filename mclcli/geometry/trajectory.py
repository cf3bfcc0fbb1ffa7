"""Poses over time: what a run, a reference or another localizer said, ready to be asked at any stamp."""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.records import TrackPoint

_SAME_NS = 1_000_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """``stamps_ns`` (N,) int64, strictly increasing; ``poses`` (N, 3) float64, x, y [m], yaw [rad].

    ``covariances`` (N, 3, 3) of (x, y, yaw) in the frame of the poses, or None where there are none. ``updated``
    (N,) tells measured poses from those carried on by odometry; None: all were measured.
    """

    stamps_ns: IntArray
    poses: FloatArray
    covariances: FloatArray | None = None
    updated: BoolArray | None = None

    def at(self, stamps_ns: IntArray, max_gap_ns: int) -> tuple[FloatArray, BoolArray]:
        """Poses (M, 3) at stamps (M,), interpolated with constant twist, and which of them are covered.

        A stamp is covered if it lies between two poses that are at most ``max_gap_ns`` apart, or meets one to 1 ms:
        files of references often round their stamps.
        """
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, max(self.stamps_ns.size - 1, 1))
        before = after - 1
        after = np.minimum(after, self.stamps_ns.size - 1)
        t0, t1 = self.stamps_ns[before], self.stamps_ns[after]
        fraction = np.clip((stamps_ns - t0) / np.maximum(t1 - t0, 1), 0.0, 1.0)
        meets = np.minimum(np.abs(stamps_ns - t0), np.abs(stamps_ns - t1)) <= _SAME_NS
        covered = meets | ((stamps_ns > t0) & (stamps_ns < t1) & (t1 - t0 <= max_gap_ns))
        poses = se2.interpolate(self.poses[before], self.poses[after], np.where(covered, fraction, 0.0))
        return poses, covered


def in_order(
    stamps_ns: IntArray,
    poses: FloatArray,
    covariances: FloatArray | None = None,
    updated: BoolArray | None = None,
) -> Trajectory:
    """Trajectory of poses as they arrived: a pose replaces those that came before it with the same or a later stamp.

    So where a clock jumped back, what was recorded after the jump counts.
    """
    later = np.minimum.accumulate(stamps_ns[::-1])[::-1]
    chosen = np.ones(stamps_ns.size, dtype=np.bool_)
    chosen[:-1] = stamps_ns[:-1] < later[1:]
    spread = None if covariances is None else covariances[chosen]
    return Trajectory(stamps_ns[chosen], poses[chosen], spread, None if updated is None else updated[chosen])


@final
class Track:
    """Points of a replay so far, as compact columns; without ``whole`` only their span of time."""

    def __init__(self, *, whole: bool = True) -> None:
        self._whole = whole
        self._segment, self._last_ns, self._passed_ns = -1, 0, 0
        self._stamps, self._updated = array("q"), array("b")
        self._poses, self._covariances, self._odometry = array("d"), array("d"), array("d")

    def append(self, point: TrackPoint) -> None:
        """Take one point in."""
        if point.segment == self._segment:
            self._passed_ns += point.stamp_ns - self._last_ns
        self._segment, self._last_ns = point.segment, point.stamp_ns
        if not self._whole:
            return
        self._stamps.append(point.stamp_ns)
        self._updated.append(point.updated)
        self._poses.extend(point.estimate.pose)
        self._covariances.extend(point.estimate.covariance.ravel())
        self._odometry.extend(point.odom_from_base)

    @property
    def seconds(self) -> float:
        """Time from the first point to the last one of each segment, in all [s]."""
        return self._passed_ns * 1e-9

    @property
    def stamps_ns(self) -> IntArray:
        """Stamps (N,) int64."""
        return np.array(self._stamps, dtype=np.int64)

    @property
    def poses(self) -> FloatArray:
        """Poses (N, 3) float64."""
        return np.array(self._poses, dtype=np.float64).reshape(-1, 3)

    @property
    def trajectory(self) -> Trajectory:
        """The track in order of time, with covariances."""
        covariances = np.array(self._covariances, dtype=np.float64).reshape(-1, 3, 3)
        return in_order(self.stamps_ns, self.poses, covariances, np.array(self._updated, dtype=np.bool_))

    @property
    def odometry(self) -> Trajectory:
        """Odometry, odom_from_base, at the track's stamps."""
        return in_order(self.stamps_ns, np.array(self._odometry, dtype=np.float64).reshape(-1, 3))


def track_of(points: Iterable[TrackPoint]) -> Trajectory:
    """Track of the points of a replay, with covariances, ready to be evaluated."""
    track = Track()
    for point in points:
        track.append(point)
    return track.trajectory
