"""Odometry as a path through time, asked for at any stamp."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, final

from mclcli import se2

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@final
class OdometryPath:
    """Recent odometry, growing at its end; constant twist between samples, never extrapolated."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._poses: list[NDArray[np.float64]] = []

    def append(self, stamp_ns: int, odom_from_base: NDArray[np.float64]) -> bool:
        """Add a sample (3,); returns False, and leaves it out, if it is not newer than the last one."""
        if self._stamps and stamp_ns <= self._stamps[-1]:
            return False
        self._stamps.append(stamp_ns)
        self._poses.append(odom_from_base)
        return True

    @property
    def last_ns(self) -> int | None:
        """Last stamp, None while there is no sample."""
        return self._stamps[-1] if self._stamps else None

    def ends_after(self, stamp_ns: int) -> bool:
        """Whether the last sample is later than a stamp."""
        return bool(self._stamps) and self._stamps[-1] > stamp_ns

    def covers(self, stamp_ns: int) -> bool:
        """Whether a stamp lies within the span."""
        return bool(self._stamps) and self._stamps[0] <= stamp_ns <= self._stamps[-1]

    def at(self, stamp_ns: int) -> NDArray[np.float64]:
        """Pose (3,) at a stamp within the span."""
        after = bisect_left(self._stamps, stamp_ns)
        if self._stamps[after] == stamp_ns:
            return self._poses[after]
        before_ns, after_ns = self._stamps[after - 1], self._stamps[after]
        fraction = (stamp_ns - before_ns) / (after_ns - before_ns)
        return se2.interpolate(self._poses[after - 1], self._poses[after], fraction)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop samples that no stamp from here on needs."""
        keep = bisect_left(self._stamps, stamp_ns) - 1
        if keep > 0:
            del self._stamps[:keep], self._poses[:keep]
