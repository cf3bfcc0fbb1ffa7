"""Where the particles are at the first used reading."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Protocol, final

import numpy as np

from mclcli.filter import particles
from mclcli.geometry import se2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.motion.odometry import OdometryPath
    from mclcli.records import StampedPose
    from mclcli.sensors.observation import Observation
    from mclcli.world.occupancy import OccupancyGrid

GIVEN_SPREAD = np.diag(np.square([0.1, 0.1, np.radians(5.0)]))
_JOINED_WITHIN_NS = 1_000_000_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """What a start may look at: every reading since the first one that could begin the run.

    ``stamp_ns`` is that reading's stamp, where the particles are to be. ``observations`` are in the order of their
    stamps, with mounts and places by odometry; the first one is that reading, of the instrument that triggers updates.
    ``path`` is the odometry since then at least. ``complete`` says that no more readings will come.
    """

    stamp_ns: int
    path: OdometryPath
    observations: tuple[Observation, ...] = ()
    complete: bool = False


@final
class Patience(Enum):
    """The answer of a start that cannot place particles yet.

    ``SKIP``: not at this stamp; the reading is counted as skipped, and the next one asks again. ``HOLD``: the readings
    are kept, and the start is asked again with one more, until it answers or they are ``complete``; then the run
    begins at the first of them, and none is lost.
    """

    SKIP = "skip"
    HOLD = "hold"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """The answer of a start that had to look for the robot: particles (n, 3), and how sure it is of where.

    ``modes`` (n,) says which place each particle is at, the number of places where it is at none of them.
    ``places`` (K, 3) are at ``Opening.stamp_ns``, the most probable first, with ``probabilities`` (K,);
    ``elsewhere`` is the probability of not being on this map. K is 0 where there was nothing to go by.
    """

    poses: FloatArray
    modes: IntArray
    places: FloatArray
    probabilities: FloatArray
    elsewhere: float


class Start(Protocol):
    """A way to place the first particles: at the beginning, and again in every segment of a log whose time jumps."""

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray | Placed | Patience:
        """Poses (n, 3) float64 of the base in map at ``opening.stamp_ns``, or what to wait for.

        Must depend on nothing but its arguments, and take all randomness from ``rng``: asked again, it gets the same.
        """
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class AroundPose:
    """Around one pose (3,), with a covariance (3, 3)."""

    pose: FloatArray
    covariance: FloatArray

    @staticmethod
    def at(x: float, y: float, yaw: float, spread: float = 0.5, yaw_spread: float = math.radians(15.0)) -> AroundPose:
        """Around x, y [m], yaw [rad], with these standard deviations [m], [rad]."""
        return AroundPose(np.array([x, y, yaw]), np.diag(np.square([spread, spread, yaw_spread])))

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray:
        """Poses (n, 3) around the pose, whatever the stamp."""
        del opening
        return particles.gaussian(self.pose, self.covariance, n, rng)


@final
@dataclass(frozen=True, slots=True, eq=False)
class AroundSeveral:
    """Around several poses (K, 3), each with a covariance (K, 3, 3), and with particles by its weight (K,)."""

    poses: FloatArray
    covariances: FloatArray
    weights: FloatArray

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray:
        """Poses (n, 3), whatever the stamp; each hypothesis gets its share of n to within one particle."""
        del opening
        edges = np.round(n * np.cumsum(self.weights) / np.sum(self.weights)).astype(int)
        shares = np.diff(edges, prepend=0)
        groups = zip(self.poses, self.covariances, shares.tolist(), strict=True)
        return np.concatenate([particles.gaussian(pose, spread, share, rng) for pose, spread, share in groups])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Anywhere:
    """Uniform over the free cells of the map."""

    grid: OccupancyGrid

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray:
        """Poses (n, 3) over the whole map, whatever the stamp."""
        del opening
        return particles.uniform(self.grid, n, rng)


@final
@dataclass(frozen=True, slots=True)
class WhenTold:
    """Nowhere: the run begins with the first pose that the log's own operator states (see ``Setup.follow``)."""

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> Patience:
        """Wait, reading by reading."""
        del opening, n, rng
        return Patience.SKIP


@final
class AlongPoses:
    """Around the pose that a topic or file gives for that time; the run starts at the first given pose."""

    def __init__(self, poses: Sequence[StampedPose]) -> None:
        self._poses = sorted(poses, key=lambda pose: pose.stamp_ns)
        self._stamps = [pose.stamp_ns for pose in self._poses]

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray | Patience:
        """Poses (n, 3) around the last given pose carried on to the stamp; too early before the first one."""
        after = bisect_right(self._stamps, opening.stamp_ns)
        if after == 0:
            return Patience.SKIP
        stamp_ns, path, last = opening.stamp_ns, opening.path, self._poses[after - 1]
        if after < len(self._poses) and self._stamps[after] - last.stamp_ns <= _JOINED_WITHIN_NS:
            fraction = (stamp_ns - last.stamp_ns) / (self._stamps[after] - last.stamp_ns)
            pose = se2.interpolate(last.pose, self._poses[after].pose, fraction)
            return particles.gaussian(pose, spread_of(last), n, rng)
        return particles.gaussian(carried(last, stamp_ns, path), spread_of(last), n, rng)


def spread_of(given: StampedPose) -> FloatArray:
    """Covariance (3, 3) of a given pose: its own, or 0.1 m and 5° where it has none that could be used."""
    return GIVEN_SPREAD if given.covariance is None else given.covariance


def carried(given: StampedPose, stamp_ns: int, path: OdometryPath) -> FloatArray:
    """A given pose (3,) moved on to a stamp, by odometry where it reaches back so far."""
    if not path.covers(given.stamp_ns) or not path.covers(stamp_ns):
        return given.pose
    return se2.compose(given.pose, se2.between(path.at(given.stamp_ns), path.at(stamp_ns)))
