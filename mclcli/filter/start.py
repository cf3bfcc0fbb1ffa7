"""Where the particles are at the first used scan."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, final

import numpy as np

from mclcli import se2
from mclcli.filter import particles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mclcli.motion.odometry import OdometryPath
    from mclcli.records import StampedPose
    from mclcli.world.occupancy import OccupancyGrid

STATED_SPREAD = np.diag(np.square([0.1, 0.1, np.radians(5.0)]))
_JOINED_WITHIN_NS = 1_000_000_000


class Start(Protocol):
    """A way to place the first particles."""

    def place(self, stamp_ns: int, path: OdometryPath, n: int, rng: np.random.Generator) -> NDArray[np.float64] | None:
        """Poses (n, 3) at a stamp, or None if it is too early to start."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class AroundPose:
    """Around one pose (3,), with a covariance (3, 3)."""

    pose: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @staticmethod
    def at(x: float, y: float, yaw: float, spread: float = 0.5, yaw_spread: float = math.radians(15.0)) -> AroundPose:
        """Around x, y [m], yaw [rad], with these standard deviations [m], [rad]."""
        return AroundPose(np.array([x, y, yaw]), np.diag(np.square([spread, spread, yaw_spread])))

    def place(self, stamp_ns: int, path: OdometryPath, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Poses (n, 3) around the pose, whatever the stamp."""
        del stamp_ns, path
        return particles.gaussian(self.pose, self.covariance, n, rng)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Anywhere:
    """Uniform over the free cells of the map."""

    grid: OccupancyGrid

    def place(self, stamp_ns: int, path: OdometryPath, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Poses (n, 3) over the whole map, whatever the stamp."""
        del stamp_ns, path
        return particles.uniform(self.grid, n, rng)


@final
class AlongPoses:
    """Around the pose that a topic or file states for that time; the run starts at the first stated pose."""

    def __init__(self, stated: Sequence[StampedPose]) -> None:
        self._stated = sorted(stated, key=lambda pose: pose.stamp_ns)
        self._stamps = [pose.stamp_ns for pose in self._stated]

    def place(self, stamp_ns: int, path: OdometryPath, n: int, rng: np.random.Generator) -> NDArray[np.float64] | None:
        """Poses (n, 3) around the last stated pose carried on to the stamp; None before the first one."""
        after = bisect_right(self._stamps, stamp_ns)
        if after == 0:
            return None
        last = self._stated[after - 1]
        covariance = STATED_SPREAD if last.covariance is None else last.covariance
        return particles.gaussian(self._carry(after, stamp_ns, path), covariance, n, rng)

    def _carry(self, after: int, stamp_ns: int, path: OdometryPath) -> NDArray[np.float64]:
        """Between two poses less than 1 s apart by interpolation, else by odometry where it reaches back so far."""
        last = self._stated[after - 1]
        if after < len(self._stated) and self._stamps[after] - last.stamp_ns <= _JOINED_WITHIN_NS:
            fraction = (stamp_ns - last.stamp_ns) / (self._stamps[after] - last.stamp_ns)
            return se2.interpolate(last.pose, self._stated[after].pose, fraction)
        if path.covers(last.stamp_ns):
            return se2.compose(last.pose, se2.between(path.at(last.stamp_ns), path.at(stamp_ns)))
        return last.pose
