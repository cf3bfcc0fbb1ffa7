"""Where and when a run starts, from --init, --start and --duration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli.cli.clock import parse_seconds, parse_time
from mclcli.errors import InputError, UsageError
from mclcli.filter.particles import DEFAULT_SPREAD
from mclcli.filter.start import AlongPoses, AroundPose, Start
from mclcli.io.recording import roles
from mclcli.quantity import parse_list, parse_quantity
from mclcli.records import Odometry, StampedPose

if TYPE_CHECKING:
    from mclcli.io.recording.recording import Recording

_ALWAYS = (-(2**63), 2**63 - 1)
_NUMBERS = re.compile(r"\s*[-+.\d][^/]*,.*")


def read_start(text: str | None, recording: Recording) -> Start | None:
    """Start that --init names; None for ``uniform`` and ``global``: anywhere on the map, or where a search finds it.

    Raises
    ------
    UsageError
        If the text is none of the known forms, or the file does not exist.
    InputError
        If the topic or file states no pose.

    """
    if text in {None, "global", "uniform"}:
        return None
    assert text is not None  # noqa: S101
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


def read_offset(text: str | None) -> int:
    """Nanoseconds of --scan-offset."""
    return 0 if text is None else round(parse_quantity(text, "s", "--scan-offset") * 1e9)


def read_window(start: str | None, duration: str | None, first_ns: int) -> tuple[int, int]:
    """First and last stamp of the scans to use."""
    begin = _ALWAYS[0] if start is None else parse_time(start, first_ns, "--start")
    if duration is None:
        return begin, _ALWAYS[1]
    length = parse_seconds(duration, "--duration")
    if length <= 0:
        raise UsageError(f"--duration: {duration} is not greater than 0")
    return begin, (first_ns if start is None else begin) + length


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
