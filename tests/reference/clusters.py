"""Clusters by flood fill over bins, and the statistics of each by sums over its particles."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

from tests.reference.filter import mean_and_covariance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.reference.filter import Pose

    Bin = tuple[int, int, int]
    Cluster = tuple[list[int], float, Pose, list[list[float]]]

YAW_SIZE = math.pi / 18


def bin_of(pose: Sequence[float], *, wrap: bool) -> Bin:
    """Bin of 0.5 m × 0.5 m × 10°; its yaw modulo a whole turn if wrapped."""
    yaw = math.floor(pose[2] / YAW_SIZE)
    return (math.floor(pose[0] / 0.5), math.floor(pose[1] / 0.5), yaw % 36 if wrap else yaw)


def find(poses: Sequence[Sequence[float]], weights: Sequence[float], *, wrap: bool) -> list[Cluster]:
    """Members, weight, mean and covariance of each cluster, the heaviest first, else by the first member."""
    members: dict[Bin, list[int]] = {}
    for i, pose in enumerate(poses):
        members.setdefault(bin_of(pose, wrap=wrap), []).append(i)
    found = []
    while members:
        queue = [min(members, key=lambda cell: members[cell][0])]
        inside = members.pop(queue[0])
        while queue:
            x, y, yaw = queue.pop()
            for dx, dy, dyaw in itertools.product((-1, 0, 1), repeat=3):
                there = (x + dx, y + dy, (yaw + dyaw) % 36 if wrap else yaw + dyaw)
                if there in members:
                    inside += members.pop(there)
                    queue.append(there)
        found.append(_summary(sorted(inside), poses, weights))
    return sorted(found, key=lambda cluster: -cluster[1])


def _summary(inside: list[int], poses: Sequence[Sequence[float]], weights: Sequence[float]) -> Cluster:
    total = math.fsum(weights[i] for i in inside)
    share = [weights[i] / total if total > 0.0 else 1.0 / len(inside) for i in inside]
    mean, covariance = mean_and_covariance([poses[i] for i in inside], share)
    return inside, total, mean, covariance
