"""Stretches of a chain that stand aside: a cabinet that was moved, or a wall's other face, may hold a few scans.

Such a stretch lies between two increments that odometry hardly explains. It is carried on by odometry from the pose
before it and from the pose after it, which are starts of their own; what makes the drive more probable stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2
from mclcli.smooth import chain

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.smooth.odometry import Odometry
    from mclcli.smooth.scans import ScanFactors

_DOUBTED = 8.0  # nats of an increment: 4 standard deviations
_LONGEST = 60  # scans of a stretch
_STRETCHES = 16  # at a time, the most doubtful
_AROUND = 10  # scans to both sides that may give way
_GAIN = 1.0  # nats
_STEPS = 12


def better(poses: FloatArray, costs: FloatArray, factors: ScanFactors, odometry: Odometry) -> FloatArray:
    """Poses (n, 3) near a more probable chain, or as they are; ``costs`` (n − 1,) are those of odometry."""
    poses = poses.copy()
    for first, last in _stretches(costs):
        begin, end = max(0, first - _AROUND), min(len(poses), last + 1 + _AROUND)
        starts = [poses, _onwards(poses, odometry, first, last), _backwards(poses, odometry, first, last)]
        tried = chain.minimise(
            np.array(starts)[:, begin:end], factors.some(slice(begin, end)), odometry.some(begin, end), steps=_STEPS
        )
        best = int(tried.costs.argmin())
        if tried.costs[best] < tried.costs[0] - _GAIN:
            poses[begin:end] = tried.poses[best]
    return poses


def _stretches(costs: FloatArray) -> list[tuple[int, int]]:
    """First and last pose of every stretch between two increments that cost (n − 1,) much."""
    doubted = np.flatnonzero(costs > _DOUBTED)
    pairs = [(int(a) + 1, int(b)) for i, a in enumerate(doubted) for b in doubted[i + 1 : i + 3] if b - a <= _LONGEST]
    return sorted(pairs, key=lambda pair: (-min(costs[pair[0] - 1], costs[pair[1]]), pair))[:_STRETCHES]


def _onwards(poses: FloatArray, odometry: Odometry, first: int, last: int) -> FloatArray:
    """Poses (n, 3) with those of a stretch carried on from the one before it."""
    moved = poses.copy()
    for k in range(first, last + 1):
        moved[k] = se2.compose(moved[k - 1], odometry.increments[k - 1])
    return moved


def _backwards(poses: FloatArray, odometry: Odometry, first: int, last: int) -> FloatArray:
    """Poses (n, 3) with those of a stretch carried back from the one after it."""
    moved = poses.copy()
    for k in range(last, first - 1, -1):
        moved[k] = se2.compose(moved[k + 1], se2.inverse(odometry.increments[k]))
    return moved
