"""Several scans as one: what a moving robot saw in a while, seen from where it is at the end."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2
from mclcli.sensors.beams import Beams

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray, IntArray

_ARM = 0.5  # m: turning by a radian shows as much anew as driving so far
_MOVE, _MOVE_OF_TURN, _YAW_OF_MOVE, _YAW_OF_TURN = 0.1, 0.05, 0.05, 0.1  # m/m, m/rad, rad/√m, rad/rad
_FIRM = np.array([0.02, 0.02, 0.01])  # of increments that are nothing
_STANDING = 0.05  # m: scans nearer than this to the last one chosen show nothing new


def spread(odom_from_base: FloatArray, count: int) -> IntArray:
    """Numbers of at most ``count`` of the poses (N, 3), evenly along the way; the last one is always among them."""
    way = np.concatenate([[0.0], np.cumsum(ways(odom_from_base))])
    wanted = way[-1] - np.arange(count) * max(way[-1] / max(count - 1, 1), _STANDING)
    after = np.searchsorted(way, wanted[wanted > -0.5 * _STANDING])
    return np.unique([*after[1:].tolist(), len(way) - 1]).astype(np.int64)


def stretches(count: int, length: int) -> list[range]:
    """So many scans in stretches of about ``length``, in order of time; none if one stretch is all."""
    parts = -(-count // length)
    edges = [round(i * count / parts) for i in range(parts + 1)] if parts > 1 else []
    return [range(first, last) for first, last in itertools.pairwise(edges)]


def ways(odom_from_base: FloatArray) -> FloatArray:
    """How far (N − 1,) [m] the robot moved from each pose (N, 3) to the next, turns counted as in ``spread``."""
    steps = se2.between(odom_from_base[:-1], odom_from_base[1:])
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]) + _ARM * np.abs(steps[:, 2]))


def noise(steps: FloatArray) -> FloatArray:
    """Covariances (N, 3, 3) of odometry's increments (N, 3), in the frame of the base before each."""
    moved, turned = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    found = np.zeros((len(steps), 3, 3))
    yaw = _FIRM[2] ** 2 + _YAW_OF_MOVE**2 * moved + (_YAW_OF_TURN * turned) ** 2 + (_YAW_OF_TURN**2) * 0.2 * turned
    found[:, 2, 2] = yaw
    move = _FIRM[0] ** 2 + _MOVE**2 * (moved**2 + 0.25 * moved) / 2.0 + (_MOVE_OF_TURN * turned) ** 2
    direction = np.stack([-steps[:, 1], steps[:, 0]], axis=-1) * 0.5
    found[:, 0, 0] = found[:, 1, 1] = move
    found[:, :2, :2] += yaw[:, np.newaxis, np.newaxis] * direction[:, :, np.newaxis] * direction[:, np.newaxis, :]
    found[:, :2, 2] = found[:, 2, :2] = yaw[:, np.newaxis] * direction
    return found


def join(parts: Sequence[tuple[Beams, FloatArray]]) -> Beams:
    """Beams of several scans, each with the pose ``now_from_then`` (3,) of its base, as beams of one scan.

    They are put in the order of the directions in which they end: neighbours hit the same walls, whichever scan they
    are from, so that their correlation is that of beams and scans.
    """
    if len(parts) == 1 and not parts[0][1].any():
        return parts[0][0]
    origins = np.concatenate([_moved(beams.origins, pose) for beams, pose in parts])
    directions = np.concatenate([_moved(beams.directions, [0.0, 0.0, pose[2]]) for beams, pose in parts])
    ranges = np.concatenate([beams.ranges for beams, _ in parts])
    ends = origins + ranges[:, np.newaxis] * directions
    order = np.argsort(np.arctan2(ends[:, 1], ends[:, 0]), kind="stable")
    furthest, offset = max(beams.r_max for beams, _ in parts), parts[0][0].offset
    return Beams(origins[order], directions[order], ranges[order], furthest, offset=offset)


def _moved(points: FloatArray, pose: Sequence[float] | FloatArray) -> FloatArray:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(np.asarray(points) @ np.array([[c, s], [-s, c]]) + np.asarray(pose[:2]))
