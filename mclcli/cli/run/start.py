"""Where and when a run starts, from --init, the robot's own file, --start and --duration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli.cli import console
from mclcli.errors import InputError, UsageError
from mclcli.filter.particles import DEFAULT_SPREAD
from mclcli.filter.start import AlongPoses, AroundPose, Start
from mclcli.io.recording import roles
from mclcli.quantity import parse_list
from mclcli.records import Odometry, StampedPose

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.cli.chosen import Chosen
    from mclcli.cli.clock import LogTime
    from mclcli.io.recording.recording import Recording
    from mclcli.world.occupancy import OccupancyGrid

_ALWAYS = (-(2**63), 2**63 - 1)
_NUMBERS = re.compile(r"\s*[-+.\d][^/]*,.*")


def read_start(text: str, recording: Recording) -> Start | None:
    """Start that --init names; None for ``uniform`` and ``global``: anywhere on the map, or where a search finds it.

    Raises
    ------
    UsageError
        If the text is none of the known forms, or the file does not exist.
    InputError
        If the topic or file states no pose.

    """
    if text in {"global", "uniform"}:
        return None
    if names_topic(text, recording):
        return AlongPoses(poses_of_topic(recording, text))
    if _NUMBERS.fullmatch(text) and not Path(text).exists():
        return _around(text)
    return AlongPoses(_poses_of_file(text))


def names_topic(text: str, recording: Recording) -> bool:
    """Whether a text means a topic: it begins with a slash and is no file, unless the log has a topic of that name."""
    return text.startswith("/") and (text in recording.survey.topics or not Path(text).exists())


def poses_of_topic(recording: Recording, topic: str) -> list[StampedPose]:
    """Poses that a topic states, of type Odometry, PoseStamped or PoseWithCovarianceStamped.

    Raises
    ------
    UsageError
        If the log has no such topic.
    InputError
        If it states no pose that can be used.

    """
    if topic not in recording.survey.topics:
        names = ", ".join(sorted(recording.survey.topics))
        raise UsageError(f"no topic '{topic}' in the log; it has {names or 'none'}")
    poses = [
        StampedPose(record.stamp_ns, record.frame_id, record.pose) if isinstance(record, Odometry) else record
        for record in recording.records(topic)
    ]
    stamped = [pose for pose in poses if isinstance(pose, StampedPose)]
    if not stamped:
        kind = recording.survey.topics[topic].channel.type
        raise InputError(f"topic '{topic}' of type {kind} states no pose that can be used; name another one")
    return stamped


def start_of_file(chosen: Chosen, grid: OccupancyGrid | None) -> Start | None:
    """The start that the robot's file states, None if it states none.

    Raises
    ------
    UsageError
        If it lies off the map.

    """
    file = chosen.file
    if file is None or file.start is None:
        return None
    from mclcli.replay.setup import describe_extent

    x, y, yaw = (float(value) for value in file.start.pose)
    if grid is not None and not grid.contains(file.start.pose[:2]):
        raise UsageError(
            f"{file.name}: its initial_pose ({x:g}, {y:g}) lies off the map; {describe_extent(grid)}; give --init"
        )
    spread = "with its covariance" if file.start.covariance.any() else "all particles there, as in nav2_amcl"
    console.remark(f"start: initial_pose of {file.name}, {x:g},{y:g},{yaw:g}, {spread}; --init says otherwise")
    return AroundPose(file.start.pose, file.start.covariance)


def find_initialpose(recording: Recording) -> str:
    """Topic on which an operator told the robot where it was.

    Raises
    ------
    UsageError
        If the log has none.

    """
    topic = roles.initialpose(recording.survey)
    if not topic:
        has = ", ".join(sorted(recording.survey.topics)) or "none"
        raise UsageError(f"--follow-initialpose: the log has no topic of poses named initialpose; it has {has}")
    return topic


def window_ns(start: LogTime | None, duration_ns: int | None, first_ns: int) -> tuple[int, int]:
    """First and last stamp of the scans to use."""
    begin = _ALWAYS[0] if start is None else start.stamp_ns(first_ns)
    if duration_ns is None:
        return begin, _ALWAYS[1]
    return begin, (first_ns if start is None else begin) + duration_ns


def pose_of(text: str | None) -> FloatArray | None:
    """The pose (3,) that --init states in figures, None where it names something else."""
    if text is None or not _NUMBERS.fullmatch(text) or Path(text).exists():
        return None
    return _around(text).pose


def _around(text: str) -> AroundPose:
    values = parse_list(text, ("m", "m", "rad", "m", "rad"), "--init")
    if len(values) not in {3, 5}:
        raise UsageError(f"--init: '{text}' needs X,Y,YAW or X,Y,YAW,SXY,SYAW")
    covariance = DEFAULT_SPREAD
    if len(values) == 5:
        if min(values[3:]) < 0.0:
            raise UsageError(f"--init: the standard deviations of '{text}' must not be negative")
        covariance = np.diag(np.square([values[3], values[3], values[4]]))
    return AroundPose(np.array(values[:3]), covariance)


def _poses_of_file(text: str) -> list[StampedPose]:
    from mclcli.io.tables.tum import read_tum

    if not Path(text).exists():
        raise UsageError(f"--init: '{text}' is neither X,Y,YAW, uniform, global, a topic nor a file that exists")
    track = read_tum(text)
    return [StampedPose(int(stamp), "map", pose) for stamp, pose in zip(track.stamps_ns, track.poses, strict=True)]
