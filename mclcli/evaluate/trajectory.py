"""Poses over time, and two of them brought together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import se2

if TYPE_CHECKING:
    from numpy.typing import NDArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """``stamps_ns`` (N,) int64, strictly increasing; ``poses`` (N, 3) float64, x, y [m], yaw [rad]."""

    stamps_ns: NDArray[np.int64]
    poses: NDArray[np.float64]

    def at(self, stamps_ns: NDArray[np.int64], max_gap_ns: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Poses (M, 3) at stamps (M,), interpolated with constant twist, and which of them are covered.

        A stamp is covered if it meets a pose, or lies between two that are at most ``max_gap_ns`` apart.
        """
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, max(self.stamps_ns.size - 1, 1))
        before = after - 1
        after = np.minimum(after, self.stamps_ns.size - 1)
        t0, t1 = self.stamps_ns[before], self.stamps_ns[after]
        fraction = (stamps_ns - t0) / np.maximum(t1 - t0, 1)
        meets = (stamps_ns == t0) | (stamps_ns == t1)
        covered = meets | ((stamps_ns > t0) & (stamps_ns < t1) & (t1 - t0 <= max_gap_ns))
        poses = se2.interpolate(self.poses[before], self.poses[after], np.where(covered, fraction, 0.0))
        return poses, covered
