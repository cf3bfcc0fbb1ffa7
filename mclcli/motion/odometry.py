"""Odometry as a path through time, asked for at any stamp."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray

_SLACK_M, _SLACK_RAD = (
    1.0,
    1.5,
)  # what samples may differ by however close their stamps: those of real logs are not exact


@final
@dataclass(frozen=True, slots=True)
class OdometryParameters:
    """The speeds up to which odometry is believed."""

    odom_max_speed: float = parameter(
        10.0, "a faster step of the odometry is a reset or a jump, not motion; 0: believe all", unit="m/s", low=0.0
    )
    odom_max_turn: float = parameter(
        15.0, "a step that turns faster is a reset or a jump, not motion; 0: believe all", unit="rad/s", low=0.0
    )

    def __post_init__(self) -> None:
        validate(self)

    def is_jump(self, step: FloatArray, seconds: float) -> bool:
        """Whether a step (3,) in so many seconds cannot be motion."""
        speed, turn = self.odom_max_speed or math.inf, self.odom_max_turn or math.inf
        x, y, turned = step.tolist()
        moved, turned = math.hypot(x, y), abs(turned)
        return moved > max(_SLACK_M, speed * seconds) or turned > max(_SLACK_RAD, turn * seconds)


@final
@dataclass(slots=True)
class OdometryPath:
    """Recent odometry, growing at its end; constant twist between samples, never extrapolated.

    Where odometry jumps (a reset, a slip of the driver's numbers) the path stands still for that step and goes on:
    ``at`` is continuous, ``recorded`` turns it into what the log says, ``jumps`` counts. By default all is believed.
    """

    parameters: OdometryParameters = field(default_factory=lambda: OdometryParameters(0.0, 0.0))
    jumps: int = 0
    _stamps: list[int] = field(default_factory=list)
    _poses: list[FloatArray] = field(default_factory=list)
    _origins: list[FloatArray | None] = field(default_factory=list)

    def append(self, stamp_ns: int, odom_from_base: FloatArray) -> bool:
        """Add a sample (3,); returns False, and leaves it out, if it is not newer than the last one."""
        if not self._stamps:
            self._add(stamp_ns, odom_from_base, None)
            return True
        if stamp_ns <= self._stamps[-1]:
            return False
        origin = self._origins[-1]
        pose = odom_from_base if origin is None else se2.compose(se2.inverse(origin), odom_from_base)
        step = se2.between(self._poses[-1], pose)
        if self.parameters.is_jump(step, (stamp_ns - self._stamps[-1]) * 1e-9):
            self.jumps += 1
            pose = self._poses[-1]
            origin = se2.compose(odom_from_base, se2.inverse(pose))
        self._add(stamp_ns, pose, origin)
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

    def at(self, stamp_ns: int) -> FloatArray:
        """Pose (3,) at a stamp within the span."""
        after = bisect_left(self._stamps, stamp_ns)
        if self._stamps[after] == stamp_ns:
            return self._poses[after]
        before_ns, after_ns = self._stamps[after - 1], self._stamps[after]
        fraction = (stamp_ns - before_ns) / (after_ns - before_ns)
        return se2.interpolate(self._poses[after - 1], self._poses[after], fraction)

    def along(self, stamps_ns: IntArray) -> FloatArray:
        """Poses (K, 3) at stamps (K,) within the span."""
        known = np.array(self._stamps, dtype=np.int64)
        after = np.clip(np.searchsorted(known, stamps_ns), 1, known.size - 1)
        poses = np.array(self._poses)
        fraction = (stamps_ns - known[after - 1]) / (known[after] - known[after - 1])
        return se2.interpolate(poses[after - 1], poses[after], fraction)

    def recorded(self, stamp_ns: int, pose: FloatArray) -> FloatArray:
        """The pose (3,) that is ``at`` a stamp, in the log's own odometry frame, with its jumps."""
        origin = self._origins[bisect_right(self._stamps, stamp_ns) - 1]
        return pose if origin is None else se2.compose(origin, pose)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop samples that no stamp from here on needs."""
        keep = bisect_left(self._stamps, stamp_ns) - 1
        if keep > 0:
            del self._stamps[:keep], self._poses[:keep], self._origins[:keep]

    def _add(self, stamp_ns: int, pose: FloatArray, origin: FloatArray | None) -> None:
        self._stamps.append(stamp_ns)
        self._poses.append(pose)
        self._origins.append(origin)
