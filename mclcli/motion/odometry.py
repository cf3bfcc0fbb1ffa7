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

_SLACK_M, _SLACK_RAD = 1.0, 1.5  # what samples may differ by however close: stamps of real logs are not exact
_GAP = 1.0  # s between samples from which on nobody knows what happened
_RARER = 3.0  # times the interval before it that a gap lasts at least
_SET_BACK_M, _SET_BACK_RAD = 0.1, 0.05  # a smaller step to the origin passes for motion
_AT_ORIGIN_M, _AT_ORIGIN_RAD = 1e-3, 2e-3  # so near is no robot that drove there
_FASTER = 3.0  # times as fast as the step before is a step to the origin that is no motion
_DOUBTED_M, _DOUBTED_RAD = 1.0, 0.5


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

    @property
    def believe_all(self) -> bool:
        """Whether every step counts as motion."""
        return not self.odom_max_speed and not self.odom_max_turn

    def is_jump(self, moved: float, turned: float, seconds: float) -> bool:
        """Whether a step of so many metres and radians, both positive, in so many seconds cannot be motion."""
        speed, turn = self.odom_max_speed or math.inf, self.odom_max_turn or math.inf
        return moved > max(_SLACK_M, speed * seconds) or turned > max(_SLACK_RAD, turn * seconds)


@final
@dataclass(frozen=True, slots=True)
class Jump:
    """A step of odometry, from one sample to the next, that is not motion or may not be.

    ``moved`` [m] and ``turned`` [rad], both positive, are what odometry makes of it.
    """

    before_ns: int
    after_ns: int
    moved: float
    turned: float

    @property
    def seconds(self) -> float:
        """Time between the two samples [s]."""
        return (self.after_ns - self.before_ns) * 1e-9

    @property
    def in_gap(self) -> bool:
        """Whether the samples are so far apart that the robot may have been carried meanwhile."""
        return self.seconds > _GAP


@final
@dataclass(slots=True)
class OdometryPath:
    """Recent odometry, growing at its end; constant twist between samples, never extrapolated.

    Where odometry jumps (a reset, a slip of the driver's numbers) the path stands still for that step and goes on:
    ``at`` is continuous, ``recorded`` turns it into what the log says. ``jump`` is that of the newest sample, None if
    it was motion; ``doubt`` is a step, after a gap or suddenly, that may be motion or not: only scans can tell. By
    default all is believed.
    """

    parameters: OdometryParameters = field(default_factory=lambda: OdometryParameters(0.0, 0.0))
    jump: Jump | None = None
    doubt: Jump | None = None
    _stamps: list[int] = field(default_factory=list)
    _poses: list[FloatArray] = field(default_factory=list)
    _origins: list[FloatArray | None] = field(default_factory=list)
    _last: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def append(
        self,
        stamp_ns: int,
        odom_from_base: FloatArray,
        *,
        stated: FloatArray | None = None,
        other_frame: bool = False,
    ) -> bool:
        """Add a sample (3,); returns False, and leaves it out, if it is not newer than the last one.

        ``stated`` is the pose as the message has it, where that is of another frame than the base; ``other_frame`` says
        that it is told in another frame than the sample before.
        """
        self.jump = self.doubt = None
        if not self._stamps:
            self._add(stamp_ns, odom_from_base, None)
            return True
        if stamp_ns <= self._stamps[-1]:
            return False
        origin = self._origins[-1]
        pose = odom_from_base if origin is None else se2.compose(se2.inverse(origin), odom_from_base)
        x, y, turned = se2.between(self._poses[-1], pose).tolist()
        step = math.hypot(x, y), abs(turned), (stamp_ns - self._stamps[-1]) * 1e-9
        if other_frame or self.parameters.is_jump(*step):
            self.jump = Jump(self._stamps[-1], stamp_ns, *step[:2])
        elif not self.parameters.believe_all:
            self._look_closer(stamp_ns, step, odom_from_base if stated is None else stated)
        self._last = step
        if self.jump is not None:
            pose = self._poses[-1]
            origin = se2.compose(odom_from_base, se2.inverse(pose))
        self._add(stamp_ns, pose, origin)
        return True

    def _look_closer(self, stamp_ns: int, step: tuple[float, float, float], stated: FloatArray) -> None:
        """Tell what is slow enough for motion from odometry that was set back, and what cannot be told.

        ``step`` is how far it goes [m], how far it turns [rad], and how long it takes [s].
        """
        (moved, turned, seconds), (moved_before, turned_before, before) = step, self._last
        in_gap, rare = seconds > _GAP, seconds > _RARER * before
        x, y, yaw = stated.tolist()
        if abs(x) <= _AT_ORIGIN_M and abs(y) <= _AT_ORIGIN_M:
            pace = 0.0 if in_gap or not before else _FASTER * seconds / before
            turns = abs(yaw) <= _AT_ORIGIN_RAD and turned > max(_SET_BACK_RAD, pace * turned_before)
            if turns or moved > max(_SET_BACK_M, pace * moved_before):
                self.jump = Jump(self._stamps[-1], stamp_ns, moved, turned)
                return
        far = moved > _DOUBTED_M and (rare or moved * before > _FASTER * seconds * moved_before)
        if far or (rare and in_gap and turned > _DOUBTED_RAD):
            self.doubt = Jump(self._stamps[-1], stamp_ns, moved, turned)

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
