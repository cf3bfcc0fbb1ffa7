"""The robot: where it truly goes, and what its wheels say."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from samples.sim.planning import plan
from samples.sim.streams import Purpose, stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray, IntArray
    from samples.sim.building import Building
    from samples.sim.planning import Terrain

STEP_NS = 20_000_000
_DT = STEP_NS / 1e9
_ROUNDING = 1e-12
_TELEPORT = 0.2  # m in one step: no robot drives that fast


@final
@dataclass(frozen=True, slots=True)
class Drive:
    """How the robot drives: limits [m/s, rad/s, m/s², rad/s²], pure pursuit's lookahead [m], rest at a place [s]."""

    speed: float = 0.8
    turn: float = 1.2
    acceleration: float = 0.7
    turn_acceleration: float = 3.0
    lookahead: float = 0.5
    rest: float = 0.6


@final
@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Errors of wheel odometry; random parts grow with the root of the motion, systematic ones with the motion.

    ``trans_per_trans`` [m/√m], ``yaw_per_trans`` [rad/√m], ``yaw_per_yaw`` [rad/√rad], ``trans_per_yaw`` [m/√rad] are
    standard deviations; ``scale`` is the relative error of length, ``yaw_scale`` that of turning, ``pull`` [rad/m] the
    turn of wheels of unequal size. ``slips`` are (time [s], (dx, dy, dyaw)): jumps of the odometry in the base frame.
    """

    trans_per_trans: float = 0.02
    yaw_per_trans: float = 0.012
    yaw_per_yaw: float = 0.02
    trans_per_yaw: float = 0.005
    scale: float = 0.01
    yaw_scale: float = -0.005
    pull: float = 0.002
    slips: tuple[tuple[float, tuple[float, float, float]], ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses (T, 3) x, y [m], yaw [rad] at ``stamps_ns`` (T,) int64, counted from the start of the drive."""

    stamps_ns: IntArray
    poses: FloatArray

    def at(self, stamps_ns: IntArray) -> FloatArray:
        """Poses (…, 3) along constant twists; across a kidnapping the pose before it; the ends hold."""
        right = np.clip(np.searchsorted(self.stamps_ns, stamps_ns, side="right"), 1, len(self.stamps_ns) - 1)
        before, after = self.poses[right - 1], self.poses[right]
        span = (self.stamps_ns[right] - self.stamps_ns[right - 1]).astype(np.float64)
        fraction = np.clip((stamps_ns - self.stamps_ns[right - 1]) / span, 0.0, 1.0)
        carried = np.hypot(after[..., 0] - before[..., 0], after[..., 1] - before[..., 1]) > _TELEPORT
        return se2.interpolate(before, after, np.where(carried & (fraction < 1.0), 0.0, fraction))


def travel(building: Building, ground: Terrain, tours: Sequence[Sequence[str]], drive: Drive) -> Trajectory:
    """Truth of driving each of the ``tours`` (names of places) at 50 Hz, floor frame.

    Between two tours somebody carries the robot away: the truth jumps, the odometry knows nothing of it.

    Raises
    ------
    KeyError
        If a place does not exist.

    """
    poses: list[tuple[float, float, float]] = []
    for tour in tours:
        poses += _tour(building, ground, tour, drive)
    stamps = STEP_NS * np.arange(len(poses), dtype=np.int64)
    return Trajectory(stamps, np.array(poses))


def odometry(truth: Trajectory, noise: OdometryNoise, seed: int, every: int = 2) -> tuple[Trajectory, FloatArray]:
    """Odometry from (0, 0, 0) at every ``every``-th stamp of the truth, and the twists (T, 3) [m/s, rad/s] at them."""
    rng = stream(seed, Purpose.ODOMETRY)
    stamps, poses = truth.stamps_ns[::every], truth.poses[::every]
    motion = se2.log(se2.between(poses[:-1], poses[1:]))
    motion[np.hypot(motion[:, 0], motion[:, 1]) > _TELEPORT] = 0.0
    motion = _disturb(motion, noise, rng.standard_normal((len(motion), 2)))
    for time, jump in noise.slips:
        index = min(int(time * 1e9) // (STEP_NS * every), len(motion) - 1)
        motion[index] = se2.log(se2.compose(se2.exp(motion[index]), jump))
    steps = se2.exp(motion)
    estimate = [np.zeros(3)]
    for step in steps:
        estimate.append(se2.compose(estimate[-1], step))
    twists = np.vstack([np.zeros(3), motion]) / (_DT * every)
    return Trajectory(stamps, np.array(estimate)), twists


def _disturb(motion: FloatArray, noise: OdometryNoise, unit: FloatArray) -> FloatArray:
    length, turn = np.hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])
    length, turn = (np.where(size > _ROUNDING, size, 0.0) for size in (length, turn))  # a root would magnify it
    along = np.sqrt(noise.trans_per_trans**2 * length + noise.trans_per_yaw**2 * turn) * unit[:, 0]
    around = np.sqrt(noise.yaw_per_trans**2 * length + noise.yaw_per_yaw**2 * turn) * unit[:, 1]
    result = motion * [1.0 + noise.scale, 1.0 + noise.scale, 1.0 + noise.yaw_scale]
    result[:, 0] += along
    result[:, 2] += around + noise.pull * length
    return result


def _tour(building: Building, ground: Terrain, places: Sequence[str], drive: Drive) -> list[tuple[float, float, float]]:
    """Poses of one tour, at rest at its beginning and at each of its places."""
    pose: tuple[float, float, float] | None = None
    poses: list[tuple[float, float, float]] = []
    for here, there in pairwise(places):
        path = [(float(x), float(y)) for x, y in plan(ground, building.places[here], building.places[there])]
        if pose is None:
            ahead = path[min(5, len(path) - 1)]
            pose = (*path[0], math.atan2(ahead[1] - path[0][1], ahead[0] - path[0][0]))
        poses += [pose] * round(drive.rest / _DT)
        poses += _leg(path, pose, drive)
        pose = poses[-1]
    return poses + poses[-1:] * round(drive.rest / _DT)


def _leg(
    path: list[tuple[float, float]], pose: tuple[float, float, float], drive: Drive
) -> list[tuple[float, float, float]]:
    """Pure pursuit (Coulter 1992) from rest to the end of a path."""
    poses: list[tuple[float, float, float]] = []
    v = w = 0.0
    carrot = 0
    end = path[-1]
    arrived = False
    while not (arrived and v == w == 0.0):
        arrived = arrived or math.dist(pose[:2], end) < 0.1
        while carrot < len(path) - 1 and math.dist(path[carrot], pose[:2]) < drive.lookahead:
            carrot += 1
        target_v, target_w = (0.0, 0.0) if arrived else _command(pose, path[carrot], end, drive)
        v += _limited(target_v - v, drive.acceleration * _DT)
        w += _limited(target_w - w, drive.turn_acceleration * _DT)
        pose = _advance(pose, v, w)
        poses.append(pose)
        if len(poses) > 30_000:
            raise ValueError(f"the robot never reaches {end}")
    return poses


def _command(
    pose: tuple[float, float, float], carrot: tuple[float, float], end: tuple[float, float], drive: Drive
) -> tuple[float, float]:
    """Speeds [m/s, rad/s] towards the carrot; on the spot while it is more than 45° to the side."""
    dx, dy = carrot[0] - pose[0], carrot[1] - pose[1]
    aside = math.remainder(math.atan2(dy, dx) - pose[2], math.tau)
    if abs(aside) > math.pi / 4:
        braking = math.sqrt(drive.turn_acceleration * abs(aside))
        return 0.0, math.copysign(min(drive.turn, braking), aside)
    rest = math.dist(pose[:2], end)
    v = min(drive.speed * math.cos(aside) ** 2, max(0.1, math.sqrt(drive.acceleration * rest)))
    w = 2.0 * v * math.sin(aside) / max(math.hypot(dx, dy), 0.2)  # curvature 2 sin α / L
    return v, _limited(w, drive.turn)


def _advance(pose: tuple[float, float, float], v: float, w: float) -> tuple[float, float, float]:
    """Exact motion of a unicycle over one step: the chord of its arc."""
    half = 0.5 * w * _DT
    chord = v * _DT * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    yaw = math.remainder(pose[2] + 2 * half, math.tau)
    return pose[0] + chord * math.cos(pose[2] + half), pose[1] + chord * math.sin(pose[2] + half), yaw


def _limited(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
