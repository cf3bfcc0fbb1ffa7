"""Poses that a log states: ground truth, another localizer's answer; from a topic, or from transforms by frame."""

from __future__ import annotations

import logging
from array import array
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError, UsageError, nearest_name
from mclcli.geometry.trajectory import in_order
from mclcli.io.recording.recording import open_recording
from mclcli.io.tables.tum import read_tum
from mclcli.records import Odometry, StampedPose

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.geometry.frames import TransformTree
    from mclcli.geometry.trajectory import Trajectory
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.records import Transform

_TF = "tf:"


def read_trajectory(source: str) -> Trajectory:
    """Poses of ``FILE`` (TUM, or CSV with stamp, x, y, yaw), ``-``, ``LOG:TOPIC`` or ``LOG:tf:FRAME``.

    A frame stands for the poses in it of the robot's base, as transforms state them.

    Raises
    ------
    UsageError
        If there is no such file, topic or frame.
    InputError
        If it states no pose that can be used.

    """
    return read_checked(source)[0]


def read_checked(source: str, *, strict: bool = False) -> tuple[Trajectory, bool]:
    """Poses as from ``read_trajectory``, and whether bytes or messages of the log were damaged.

    With ``strict``, damage of a log and rows of a file that are not as they should be are an InputError.
    """
    log, where = split_source(source)
    if not where:
        return read_tum(source, strict=strict), False
    if not Path(log).exists():
        raise UsageError(f"{log}: no such file; LOG:TOPIC names a topic of a log, FILE a TUM or CSV file")
    recording = open_recording(log, strict=strict)
    poses = RecordedPoses(where, recording.survey, recording.roles().base_frame)
    for topic, record in recording.events(poses.topics):
        poses.take(topic, record)
    try:
        return poses.trajectory(), recording.tally.lossy
    except InputError as error:
        raise InputError(f"{log}: {error}") from None


def split_source(source: str) -> tuple[str, str]:
    """Log and topic (or ``tf:FRAME``) of ``LOG:TOPIC``; the topic is empty where a file is meant."""
    if source == "-" or Path(source).exists():
        return source, ""
    for mark in (f":{_TF}", ":/"):
        log, found, rest = source.partition(mark)
        if found and log:
            return log, f"{mark[1:]}{rest}"
    return source, ""


@final
class RecordedPoses:
    """Poses of one topic, or of ``child`` in a frame (``tf:FRAME``), collected while a log goes by.

    ``topics`` are those whose messages it needs.
    """

    def __init__(self, source: str, survey: LogSurvey, child: str) -> None:
        self._source, self._child = source, child
        self._frame = source.removeprefix(_TF).lstrip("/") if source.startswith(_TF) else ""
        if self._frame:
            _check_frames(survey, self._frame, child)
        else:
            _check_topic(survey, source)
        self.topics = frozenset(survey.transform_topics if self._frame else (source,))
        self._tree: TransformTree = survey.frames.replayed()
        self._frame_of_poses = ""
        self._stamps, self._poses, self._covariances = array("q"), array("d"), array("d")

    def take(self, topic: str, record: object) -> None:
        """Take one decoded message in, of whichever topic."""
        if topic not in self.topics:
            return
        if isinstance(record, tuple):
            self._take_transforms(record)
        elif isinstance(record, Odometry | StampedPose):
            self._frame_of_poses = self._frame_of_poses or record.frame_id
            covariance = record.covariance if isinstance(record, StampedPose) else None
            self._append(record.stamp_ns, record.pose, covariance)

    def trajectory(self) -> Trajectory:
        """Everything collected, in order of time; of equal stamps the last one counts.

        Raises
        ------
        InputError
            If there is nothing.

        """
        if not self._stamps:
            raise InputError(f"'{self._source}' states no pose that can be used; name another topic")
        if self._frame_of_poses not in {"", "map"}:
            logging.getLogger("mclcli").info(
                "%s: in frame '%s', taken for the map's", self._source, self._frame_of_poses
            )
        stamps = np.array(self._stamps, dtype=np.int64)
        complete = len(self._covariances) == 9 * stamps.size
        spread = np.array(self._covariances, dtype=np.float64).reshape(-1, 3, 3) if complete else None
        return in_order(stamps, np.array(self._poses, dtype=np.float64).reshape(-1, 3), spread)

    def _append(self, stamp_ns: int, pose: FloatArray, covariance: FloatArray | None) -> None:
        self._stamps.append(stamp_ns)
        self._poses.extend(pose.tolist())
        if covariance is not None:
            self._covariances.extend(covariance.ravel().tolist())

    def _take_transforms(self, transforms: tuple[Transform, ...]) -> None:
        """One pose each time that the latest moment grows at which all transforms in between are known."""
        from mclcli.geometry import se3

        for transform in transforms:
            self._tree.add(transform)
        stamp_ns = self._tree.latest_common(self._frame, self._child)
        if stamp_ns is None or (self._stamps and stamp_ns <= self._stamps[-1]):
            return
        matrix = self._tree.lookup(self._frame, self._child, stamp_ns)
        if matrix is not None:
            self._append(stamp_ns, se3.to_planar(matrix), None)
            self._tree.forget_before(stamp_ns)


def _check_topic(survey: LogSurvey, name: str) -> None:
    topic = survey.topics.get(name)
    if topic is None:
        hint = nearest_name(name, list(survey.topics)) or f"; it has {', '.join(sorted(survey.topics)) or 'none'}"
        raise UsageError(f"no topic '{name}' in the log{hint}")
    if topic.sample is None and topic.problem:
        raise InputError(f"topic '{name}': {topic.problem}; name another topic")
    if not isinstance(topic.sample, Odometry | StampedPose):
        raise UsageError(f"topic '{name}' of type {topic.channel.type} states no poses; name one that does")


def _check_frames(survey: LogSurvey, frame: str, child: str) -> None:
    frames = survey.frames.frames
    if frame not in frames or not survey.frames.connected(frame, child):
        names = ", ".join(frames) or "none"
        raise UsageError(f"tf:{frame}: no transform joins '{frame}' and '{child}'; frames in the log: {names}")
    if not survey.frames.moves_between(frame, child):
        raise InputError(f"tf:{frame}: '{child}' never moves in '{frame}': nothing localized the robot in this log")
