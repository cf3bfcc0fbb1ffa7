"""Several scans as one: what a moving robot saw in a while, seen from where it is at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2
from mclcli.sensors.beams import Beams

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray, IntArray

_ARM = 0.5  # m: turning by a radian shows as much anew as driving so far
_STANDING = 0.05  # m: scans nearer than this to the last one chosen show nothing new


def spread(odom_from_base: FloatArray, count: int) -> IntArray:
    """Numbers of at most ``count`` of the poses (N, 3), evenly along the way; the last one is always among them."""
    steps = se2.between(odom_from_base[:-1], odom_from_base[1:])
    way = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]) + _ARM * np.abs(steps[:, 2]))])
    wanted = way[-1] - np.arange(count) * max(way[-1] / max(count - 1, 1), _STANDING)
    after = np.searchsorted(way, wanted[wanted > -0.5 * _STANDING])
    return np.unique([*after[1:].tolist(), len(way) - 1]).astype(np.int64)


def halves(count: int) -> list[int]:
    """Half of so many scans, half of that, and so on, down to one."""
    return [count >> n for n in range(1, count.bit_length())]


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
