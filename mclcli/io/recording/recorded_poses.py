"""Poses that a log states: ground truth, another localizer's answer; from a topic, or from transforms by frame."""

from __future__ import annotations

import logging
from array import array
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.errors import AmbiguousRobotError, InputError, UsageError, nearest_name
from mclcli.geometry import se3
from mclcli.geometry.trajectory import in_order
from mclcli.io.recording.recording import open_recording
from mclcli.io.recording.robots import find_robots
from mclcli.io.recording.roles import RequestedRoles
from mclcli.io.recording.to_map import ToMap, map_frame
from mclcli.io.tables.tum import read_tum
from mclcli.records import Odometry, StampedPose, Transform
from mclcli.text import clean

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.geometry.frames import TransformTree
    from mclcli.geometry.trajectory import Trajectory
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.io.recording.to_map import MapFrame

_TF = "tf:"
_POSES = (Odometry, StampedPose, Transform)
_TOLD = 5  # bodies of a topic that are told by name
_UNKNOWN = np.full(9, np.nan).tolist()  # a covariance that is not told


def read_trajectory(source: str, *, map_frame_id: str = "", as_stated: bool = False) -> Trajectory:
    """Poses of ``FILE`` (TUM, or CSV with stamp, x, y, yaw), ``-``, ``LOG:TOPIC`` or ``LOG:tf:FRAME[:CHILD]``.

    A frame stands for the poses in it of the robot's base, or of frame CHILD, as transforms state them. Poses of a log
    that are stated in another frame than the map's are brought to it by the log's transforms at their stamps, unless
    wanted ``as_stated``. The map's frame is ``map_frame_id``, else that of the log's map, else ``map``.

    Raises
    ------
    UsageError
        If there is no such file, topic or frame.
    InputError
        If it states no pose that can be used, or nothing joins its frame and the map's.

    """
    return read_checked(source, map_frame_id=map_frame_id, as_stated=as_stated)[0]


def read_checked(
    source: str, *, strict: bool = False, map_frame_id: str = "", as_stated: bool = False, cure: str = ""
) -> tuple[Trajectory, bool]:
    """Poses as from ``read_trajectory``, and whether bytes or messages of the log were damaged.

    With ``strict``, damage of a log and rows of a file that are not as they should be are an InputError. ``cure`` ends
    the message about frames that nothing joins.
    """
    log, where = split_source(source)
    if not where:
        return read_tum(source, strict=strict), False
    if not Path(log).exists():
        raise UsageError(f"{log}: no such file; LOG:TOPIC names a topic of a log, FILE a TUM or CSV file")
    recording = open_recording(log, strict=strict)
    roles = _roles_for(recording, where)
    recording.keep_to(roles)
    frame = None if as_stated else map_frame(recording.survey, roles, map_frame_id, cure)
    try:
        poses = RecordedPoses(where, recording.survey, roles.base_frame, frame)
        for topic, record in recording.events(poses.topics):
            poses.take(topic, record)
        return poses.trajectory(), recording.tally.lossy
    except InputError as error:
        raise InputError(f"{log}: {error}") from None


def _roles_for(recording: Recording, where: str) -> Roles:
    """Roles of the log; of one with several robots, of the one whose topic or frame is named, or of the first."""
    try:
        return recording.roles()
    except AmbiguousRobotError as error:
        robots = [robot for robot in find_robots(recording.survey) if clean(robot.name) in error.names]
        named = where.removeprefix(_TF)
        meant = [r for r in robots if named.startswith(r.namespace) or set(named.split(":")) & set(r.frames.frames)]
        return recording.roles(RequestedRoles(robot=(meant or robots)[0].name))


def split_source(source: str) -> tuple[str, str]:
    """Log and topic (or ``tf:FRAME``) of ``LOG:TOPIC``; the topic is empty where a file is meant."""
    if source == "-" or Path(source).exists():
        return source, ""
    for place in (at for at in range(len(source) - 2, 0, -1) if source[at] == ":"):
        if Path(source[:place]).exists():
            return source[:place], source[place + 1 :]
    for mark in (f":{_TF}", ":/"):
        log, found, rest = source.partition(mark)
        if found and log:
            return log, f"{mark[1:]}{rest}"
    return source, ""


class _Stated(NamedTuple):
    """Whose poses a source states: of frame ``body`` in ``frame``; ``body`` is empty where nothing says whose."""

    frame: str
    body: str


@final
class RecordedPoses:
    """Poses that one ``source`` of a log states, collected while the log goes by.

    The source is a topic, ``tf:FRAME``: poses of ``child`` in a frame, or ``tf:FRAME:CHILD``. Poses are brought to the
    map's ``frame``; without one they stay as they are stated. What is said of a body that a fixed transform joins to
    ``child`` is said of ``child``. ``topics`` are those whose messages are needed.
    """

    def __init__(self, source: str, survey: LogSurvey, child: str, frame: MapFrame | None = None) -> None:
        by_frames = source.startswith(_TF)
        self._source = source if by_frames else survey.topic_named(source)
        self._stated = _frames_named(source, child) if by_frames else _frames_told(survey, self._source, child)
        if by_frames:
            _check_frames(survey, source, self._stated)
        self._child, self._frames = child, survey.frames
        self._to_map = None if frame is None else ToMap(survey, frame, self._source)
        self.topics = frozenset(survey.transform_topics if by_frames else (self._source,))
        if self._to_map is not None:
            self._to_map.require(self._stated.frame)
            self.topics |= self._to_map.topics_for([self._stated.frame])
        self._tree: TransformTree | None = survey.frames.replayed() if by_frames else None
        self._last_ns = -(2**63)
        self._others: set[tuple[str, str]] = set()
        self._stamps, self._poses, self._covariances = array("q"), array("d"), array("d")

    def take(self, topic: str, record: object) -> None:
        """Take one decoded message in, of whichever topic."""
        if topic not in self.topics:
            return
        if isinstance(record, tuple):
            if self._to_map is not None:
                self._to_map.take_transforms(record)
            if self._tree is not None:
                self._follow(self._tree, record)
            self._keep()
        if topic != self._source:
            return
        for transform in record if isinstance(record, tuple) else (record,):
            if isinstance(transform, Transform):
                self._take_body(transform)
        if isinstance(record, StampedPose):
            self._append(record)
        elif isinstance(record, Odometry):
            self._append(StampedPose(record.stamp_ns, record.frame_id, record.pose), record.child_frame_id)

    def trajectory(self) -> Trajectory:
        """Everything collected, in order of time; of equal stamps the last one counts.

        Raises
        ------
        InputError
            If there is nothing.

        """
        poses, spreads = self._conclude()
        complete = spreads if np.isfinite(spreads).all() else None
        return in_order(np.array(self._stamps, dtype=np.int64), poses, complete)

    def poses(self) -> list[StampedPose]:
        """Everything collected, in the order of the log; frames are the map's, and not named.

        Raises
        ------
        InputError
            If there is nothing.

        """
        poses, spreads = self._conclude()
        known = [spread if np.isfinite(spread).all() else None for spread in spreads]
        return [StampedPose(*found) for found in zip(self._stamps, [""] * len(known), poses, known, strict=True)]

    def _conclude(self) -> tuple[FloatArray, FloatArray]:
        """Poses (N, 3) and covariances (N, 3, 3), NaN where there are none; says what was done to them."""
        self._keep(complete=True)
        if not self._stamps:
            left_out = self._to_map.nothing if self._to_map else ""
            raise InputError(f"'{self._source}' states no pose that can be used; {left_out or 'name another topic'}")
        if self._to_map is not None:
            self._to_map.tell()
        if self._others:
            names = ", ".join(sorted(f"'{child}' in '{parent}'" for parent, child in self._others)[:_TOLD])
            used = f"poses of '{self._stated.body}' in '{self._stated.frame}'"
            if self._stated.body != self._child:
                raise InputError(f"'{self._source}' states {used}, and of {names}; name one as tf:FRAME:CHILD")
            logging.getLogger("mclcli").info("%s: %s are used; it also states %s", self._source, used, names)
        return np.array(self._poses).reshape(-1, 3), np.array(self._covariances).reshape(-1, 3, 3)

    def _append(self, pose: StampedPose, body: str = "") -> None:
        """Take one pose in, of a body or of the child itself."""
        pose = _seated(pose, body, self._child, self._frames)
        if self._to_map is None:
            self._store(pose)
        else:
            self._to_map.take(pose)
            self._keep()

    def _keep(self, *, complete: bool = False) -> None:
        for pose in () if self._to_map is None else self._to_map.ready(complete=complete):
            if pose is not None:
                self._store(pose)

    def _store(self, pose: StampedPose) -> None:
        self._stamps.append(pose.stamp_ns)
        self._poses.extend(pose.pose.tolist())
        self._covariances.extend(_UNKNOWN if pose.covariance is None else pose.covariance.ravel().tolist())

    def _take_body(self, transform: Transform) -> None:
        """One pose told as a transform, if it is of the body that the topic's poses are of."""
        if (transform.parent, transform.child) == self._stated:
            self._append(_pose_of(transform.stamp_ns, self._stated.frame, transform.parent_from_child), transform.child)
        else:
            self._others.add((transform.parent, transform.child))

    def _follow(self, tree: TransformTree, transforms: tuple[Transform, ...]) -> None:
        """One pose each time that the latest moment grows at which all transforms in between are known."""
        for transform in transforms:
            tree.add(transform)
        stamp_ns = tree.latest_common(*self._stated)
        if stamp_ns is None or stamp_ns <= self._last_ns:
            return
        matrix = tree.lookup(*self._stated, stamp_ns)
        if matrix is not None:
            self._last_ns = stamp_ns
            self._append(_pose_of(stamp_ns, self._stated.frame, matrix), self._stated.body)
            tree.forget_before(stamp_ns)


def _pose_of(stamp_ns: int, frame: str, matrix: FloatArray) -> StampedPose:
    return StampedPose(stamp_ns, frame, se3.to_planar(matrix), matrix=matrix)


def _seated(pose: StampedPose, body: str, child: str, frames: TransformTree) -> StampedPose:
    """Pose of ``child`` where that of a body it is fixed to is told; any other body is taken for it."""
    if body in {"", child} or not frames.connected(body, child) or frames.moves_between(body, child):
        return pose
    body_from_child = frames.lookup(body, child, pose.stamp_ns)
    if body_from_child is None or not se3.to_planar(body_from_child).any():
        return pose
    in_space = se3.from_planar(pose.pose) if pose.matrix is None else pose.matrix
    return _pose_of(pose.stamp_ns, pose.frame_id, in_space @ body_from_child)


def _frames_told(survey: LogSurvey, name: str, child: str) -> _Stated:
    """Whose poses a topic states in which frame, from its first message."""
    topic = survey.topics.get(name)
    if topic is None:
        hint = nearest_name(name, list(survey.topics)) or f"; it has {', '.join(sorted(survey.topics)) or 'none'}"
        raise UsageError(f"no topic '{name}' in the log{hint}")
    sample = topic.sample
    if sample is None and topic.problem:
        raise InputError(f"topic '{name}': {topic.problem}; name another topic")
    if isinstance(sample, Odometry | StampedPose):
        return _Stated(sample.frame_id, "")
    bodies = [
        _Stated(t.parent, t.child)
        for t in (sample if isinstance(sample, tuple) else (sample,))
        if isinstance(t, Transform)
    ]
    if not bodies:
        poses = [other for other, found in sorted(survey.topics.items()) if isinstance(found.sample, _POSES)]
        raise UsageError(
            f"topic '{name}' of type {topic.channel.type} states no poses that can be used; name one that does: "
            f"{', '.join(poses) or 'the log has none'}"
        )
    chosen = [told for told in bodies if told.body == child] or bodies
    if len(chosen) > 1:
        names = ", ".join(f"tf:{frame}:{body}" for frame, body in chosen[:_TOLD])
        raise UsageError(f"topic '{name}' states poses of {len(chosen)} frames; name one: {names}")
    return chosen[0]


def _frames_named(source: str, child: str) -> _Stated:
    frame, _, body = source.removeprefix(_TF).partition(":")
    return _Stated(frame.lstrip("/"), body.lstrip("/") or child)


def _check_frames(survey: LogSurvey, source: str, stated: _Stated) -> None:
    (frame, child), frames = stated, survey.frames.frames
    if frame not in frames or not survey.frames.connected(frame, child):
        names = ", ".join(frames) or "none"
        raise UsageError(f"{source}: no transform joins '{frame}' and '{child}'; frames in the log: {names}")
    if not survey.frames.moves_between(frame, child):
        raise InputError(f"{source}: '{child}' never moves in '{frame}': nothing localized the robot in this log")
