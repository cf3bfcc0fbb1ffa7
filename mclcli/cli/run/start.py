"""Where and when a run starts, from --init, the robot's own file, --start and --duration."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.cli import console
from mclcli.errors import InputError, UsageError, nearest_name
from mclcli.filter.particles import DEFAULT_SPREAD
from mclcli.filter.start import AlongPoses, AroundPose, Start
from mclcli.io.recording import kinds, roles
from mclcli.quantity import parse_list
from mclcli.records import StampedPose

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.cli.chosen import Chosen
    from mclcli.cli.clock import LogTime
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.to_map import MapFrame
    from mclcli.world.occupancy import OccupancyGrid

_ALWAYS = (-(2**63), 2**63 - 1)
_NUMBERS = re.compile(r"\s*[-+.\d][^/]*,.*")


def read_start(text: str, recording: Recording, base_frame: str, frame: MapFrame) -> Start | None:
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
        return AlongPoses(poses_of_topic(recording, text, base_frame, frame))
    if _NUMBERS.fullmatch(text) and not Path(text).exists():
        return _around(text)
    return AlongPoses(_poses_of_file(text, list(recording.survey.topics)))


def names_topic(text: str, recording: Recording) -> bool:
    """Whether a text means poses of the log: ``tf:FRAME``, a topic of it, or with a slash what is no file either.

    A name without a slash is a file's where there is one.
    """
    is_known, is_file = recording.survey.topic_named(text) in recording.survey.topics, Path(text).exists()
    return text.startswith("tf:") or (text.startswith("/") and (is_known or not is_file)) or (is_known and not is_file)


def poses_of_topic(recording: Recording, source: str, base_frame: str, frame: MapFrame) -> list[StampedPose]:
    """Poses in the map that a topic or ``tf:FRAME[:CHILD]`` states; of a pipe, only what its head holds.

    Raises
    ------
    UsageError
        If the log has no such topic, or it states no poses.
    InputError
        If it states no pose that can be used, or nothing joins its frame and the map's.

    """
    from mclcli.io.recording.recorded_poses import RecordedPoses

    poses = RecordedPoses(source, recording.survey, base_frame, _for_start(frame, source))
    for topic, record in recording.first_events(poses.topics):
        poses.take(topic, record)
    return poses.poses()


def _for_start(frame: MapFrame, source: str) -> MapFrame:
    """A robot that starts where odometry has its origin starts anywhere: only a reference may say otherwise."""
    return replace(frame, own_may_be=kinds.is_truth(source))


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


def operator_poses(recording: Recording, frame: MapFrame) -> OperatorPoses:
    """Poses by which an operator told the robot where it was.

    Raises
    ------
    UsageError
        If the log has no topic of them.
    InputError
        If none of them can be brought to the map's frame.

    """
    topic = roles.initialpose(recording.survey)
    if not topic:
        has = ", ".join(sorted(recording.survey.topics)) or "none"
        raise UsageError(f"--follow-initialpose: the log has no topic of poses named initialpose; it has {has}")
    return OperatorPoses(topic, recording, frame)


@final
class OperatorPoses:
    """Poses of the ``topic`` that a run follows, brought to the map's frame before the replay sees them.

    They are few, and are read beforehand; of a pipe, those in its head. Later ones find the transforms of the head.
    """

    def __init__(self, topic: str, recording: Recording, frame: MapFrame) -> None:
        from mclcli.io.recording.to_map import ToMap

        self.topic = topic
        self._to_map = ToMap(recording.survey, _for_start(frame, topic), topic)
        told = [record for record in recording.records(topic) if isinstance(record, StampedPose)]
        transforms = self._to_map.topics_for({pose.frame_id for pose in told})
        for record in (found for _, found in recording.first_events({topic, *transforms})) if transforms else told:
            if isinstance(record, StampedPose):
                self._to_map.take(record)
            elif isinstance(record, tuple):
                self._to_map.take_transforms(record)
        self._brought = deque(self._to_map.ready(complete=True))
        if self._brought and not any(self._brought):
            raise InputError(f"--follow-initialpose: no pose of '{topic}' can be used: {self._to_map.nothing}")

    def take(self, record: object) -> object | None:
        """One message of the topic as the replay takes it, None if it cannot be brought to the map's frame."""
        if not isinstance(record, StampedPose):
            return record
        if not self._brought:
            self._to_map.take(record)
            self._brought.extend(self._to_map.ready(complete=True))
        return self._brought.popleft()

    def tell(self) -> None:
        """Say what was done to the poses."""
        self._to_map.tell()


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


def _poses_of_file(text: str, topics: list[str]) -> list[StampedPose]:
    from mclcli.io.tables.tum import read_tum

    if not Path(text).exists():
        hint = nearest_name(text, topics)
        raise UsageError(f"--init: '{text}' is neither X,Y,YAW, uniform, global, a topic nor a file that exists{hint}")
    track = read_tum(text)
    return [StampedPose(int(stamp), "map", pose) for stamp, pose in zip(track.stamps_ns, track.poses, strict=True)]
