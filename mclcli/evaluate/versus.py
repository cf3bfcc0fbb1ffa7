"""A track against what the robot itself believed: how far apart, and since when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from mclcli.errors import InputError
from mclcli.evaluate.association import Matching, associate
from mclcli.evaluate.events import APART, Loss, Rule, stretches
from mclcli.evaluate.metrics import PoseErrors, errors_of
from mclcli.geometry import se2
from mclcli.geometry.trajectory import Trajectory

_ALWAYS_NS = 2**62


@final
@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Differences between a track and a belief, and the stretches in which they were ``apart``, in order of time."""

    belief: Trajectory
    differences: PoseErrors
    apart: tuple[Loss, ...]


def compare(track: Trajectory, belief: Trajectory, rule: Rule = APART) -> Comparison:
    """Compare a track with a belief at the track's stamps.

    Raises
    ------
    InputError
        If the belief covers no pose of the track.

    """
    pairs = associate(track, belief, Matching())
    differences = errors_of(pairs)
    return Comparison(belief, differences, tuple(stretches(pairs, differences, rule)))


def carried(belief: Trajectory, odometry: Trajectory) -> Trajectory:
    """Belief at each odometry sample: the robot's last pose until then, carried on by odometry.

    That is what a robot believes between two answers of its localizer, knowing nothing of the next one. Samples
    before the robot's first pose, and poses outside the odometry's span, are left out.

    Raises
    ------
    InputError
        If none of the poses lies within the odometry's span.

    """
    odom_then, covered = odometry.at(belief.stamps_ns, _ALWAYS_NS)
    stamps, poses, odom_then = belief.stamps_ns[covered], belief.poses[covered], odom_then[covered]
    if not stamps.size:
        raise InputError("none of the robot's own poses lies within the run; are both of the same clock?")
    last = np.searchsorted(stamps, odometry.stamps_ns, side="right") - 1
    known = last >= 0
    since = se2.between(odom_then[last[known]], odometry.poses[known])
    return Trajectory(odometry.stamps_ns[known], se2.compose(poses[last[known]], since))


def composed(map_from_odom: Trajectory, odometry: Trajectory, max_gap_ns: int = Matching().max_gap_ns) -> Trajectory:
    """Belief at each odometry sample: the recorded transform interpolated there, as tf does, after odometry.

    Raises
    ------
    InputError
        If the transform is known at none of them.

    """
    known_map, covered = map_from_odom.at(odometry.stamps_ns, max_gap_ns)
    if not covered.any():
        raise InputError("the recorded transform is known at no moment of the run; are both of the same clock?")
    return Trajectory(odometry.stamps_ns[covered], se2.compose(known_map[covered], odometry.poses[covered]))
