"""Which odometry of a log to believe: what each source says of itself, of the others, and what the scans say of it.

A source is a topic of ``nav_msgs/Odometry``, or the transforms above the base. What speaks against one is a doubt; the
one with the lightest doubts is used.
"""

from __future__ import annotations

import difflib
import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.geometry import se2, se3
from mclcli.io.recording.kinds import TF
from mclcli.records import LaserScan, Odometry
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.io.recording.robots import Robot
    from mclcli.io.recording.samples import EvenSample
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.io.recording.transforms import TransformSurvey
    from mclcli.records import Transform

_STILL_M, _STILL_RAD = 1e-6, 1e-6  # poses that differ by no more are the same
_MOVED_M, _MOVED_RAD = 0.1, 0.1  # another source that goes so far was moving
_SPEED, _TURN = 0.02, 0.02  # [m/s, rad/s] a twist above these means motion
_SPELL_NS = 5_000_000_000  # standing still is looked into if it lasts so long
_ROUGH_M, _ROUGH_RAD = 0.05, 0.05  # from one message to the next
_CHANGED_M = 0.1  # readings that differ by more are not noise


class Moment(NamedTuple):
    """What a source says at a stamp: ``pose`` (3,), and the speed [m/s] and turn rate [rad/s] beside it."""

    stamp_ns: int
    pose: FloatArray
    speed: float
    turn: float


class Doubt(NamedTuple):
    """Something that speaks against a source: how heavy it is (the source is wrong from 3 on), and what."""

    weight: int
    what: str


@final
@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """Odometry by ``name``, a topic or ``tf``: poses of frame ``child`` in ``frame``; ``runs`` are consecutive."""

    name: str
    frame: str
    child: str
    runs: list[list[Moment]]
    doubts: tuple[Doubt, ...] = ()

    @property
    def moments(self) -> list[Moment]:
        """All that is known, by stamp."""
        return sorted((moment for run in self.runs for moment in run), key=lambda moment: moment.stamp_ns)

    @property
    def weight(self) -> int:
        """How much speaks against it."""
        return max((doubt.weight for doubt in self.doubts), default=0)


def sources_of(survey: LogSurvey, robot: Robot, odom_frame: str, map_frames: Collection[str]) -> list[Source]:
    """What may be a robot's odometry, best first; ``odom_frame`` is the frame of that among transforms, or empty."""
    found = [_of_topic(survey, name) for name in robot.odometry]
    if odom_frame and robot.base:
        found.append(_of_transforms(survey, robot, odom_frame))
    found = [replace(source, doubts=tuple(_of_roughness(source))) for source in found]
    judged = [_judge(survey, robot, source, found, map_frames) for source in found]
    return sorted(judged, key=lambda source: _rank(source, robot))


def _of_topic(survey: LogSurvey, name: str) -> Source:
    topic = survey.topics[name]
    sample = topic.sample
    assert isinstance(sample, Odometry)  # noqa: S101 - by type
    runs = []
    for messages in topic.kept_runs():
        records = [record for record in messages if isinstance(record, Odometry)]
        runs.append([Moment(o.stamp_ns, o.pose, math.hypot(*o.twist[:2]), abs(o.twist[2])) for o in records])
    return Source(name, sample.frame_id, sample.child_frame_id, runs)


def _of_transforms(survey: LogSurvey, robot: Robot, odom_frame: str) -> Source:
    """The edge below odometry's frame: it carries the motion, also where others follow it."""
    chain = robot.frames.ancestors(robot.base)
    child = chain[chain.index(odom_frame) - 1] if odom_frame in chain[1:] else robot.base
    samples = [space.sampled.get((odom_frame, child)) for space in survey.transforms.values()]
    sample = next((s for s in samples if s is not None), None)
    return Source(TF, odom_frame, robot.base, _runs_of(sample) if sample else [])


def _runs_of(sample: EvenSample[Transform]) -> list[list[Moment]]:
    return [[Moment(t.stamp_ns, se3.to_planar(t.parent_from_child), 0.0, 0.0) for t in run] for run in sample.runs]


def _rank(source: Source, robot: Robot) -> tuple[int, bool, bool, float, int, str]:
    """Fewer doubts first; then topics of the robot's own namespace, and those that are named like odometry."""
    likeness = difflib.SequenceMatcher(None, "odom", source.name.removeprefix(robot.namespace).strip("/")).ratio()
    own = source.name.startswith(robot.namespace)
    return source.weight, source.name == TF, not own, -likeness, len(source.name), source.name


def _judge(
    survey: LogSurvey, robot: Robot, source: Source, sources: list[Source], map_frames: Collection[str]
) -> Source:
    """The source with all that speaks against it; only smooth others are witnesses."""
    others = [other for other in sources if other is not source and not other.doubts]
    doubts = (
        *source.doubts,
        *_of_frames(source, robot, map_frames),
        *_of_parents(survey, robot, source),
        *_of_standing(survey, robot, source, others),
        *_of_orientation(source, others),
    )
    return replace(source, doubts=doubts)


def _of_frames(source: Source, robot: Robot, map_frames: Collection[str]) -> Iterator[Doubt]:
    if source.name != TF and source.frame in map_frames:
        yield Doubt(3, f"its poses are told in '{clean(source.frame)}', the map's own frame")
    child = source.child
    if source.name == TF or not child or not robot.base or child == robot.base:
        return
    if child not in robot.frames.frames or not robot.frames.connected(child, robot.base):
        yield Doubt(1, f"no transform joins its frame '{clean(child)}' to the base '{clean(robot.base)}'")
    elif robot.frames.moves_between(child, robot.base):
        yield Doubt(2, f"its frame '{clean(child)}' moves on the base '{clean(robot.base)}'")


def _of_parents(survey: LogSurvey, robot: Robot, source: Source) -> Iterator[Doubt]:
    if source.name == TF:
        chain = set(robot.frames.ancestors(robot.base))
        spaces = [space for space in survey.transforms.values() if not chain.isdisjoint(space.tree.contested)]
        yield from (
            Doubt(2, f"{told}; what is told below '{clean(space.tree.parent(child) or '')}' is used")
            for space in spaces
            for child, told in contested(space).items()
            if child in chain
        )


def contested(space: TransformSurvey) -> dict[str, str]:
    """What to say of each frame that two nodes state below different parents."""
    return {
        child: f"two nodes state '{clean(child)}', below {' and '.join(repr(clean(name)) for name in parents)} by turns"
        for child, parents in space.tree.contested.items()
    }


def problems_of(survey: LogSurvey, robots: Iterable[Robot]) -> list[str]:
    """A line for each frame of a robot's odometry whose transforms contradict each other: two parents, or zigzags.

    Other edges are not looked at: a wheel turns by any angle from one message to the next.
    """
    chains = [robot.frames.ancestors(robot.base) for robot in robots if robot.base]
    edges = {(parent, child) for chain in chains for child, parent in itertools.pairwise(chain) if parent != "map"}
    lines: list[str] = []
    for space in survey.transforms.values():
        told = contested(space)
        lines += told.values()
        for parent, child in sorted(edges & space.sampled.keys()):
            if child not in told:
                doubts = _of_roughness(Source(TF, parent, child, _runs_of(space.sampled[parent, child])))
                lines += [f"transform from '{clean(parent)}' to '{clean(child)}': {doubt.what}" for doubt in doubts]
    return lines


def _of_standing(survey: LogSurvey, robot: Robot, source: Source, others: list[Source]) -> Iterator[Doubt]:
    """Spells in which the poses stay the same to the digit although something says that the robot drives."""
    moments = source.moments
    if not moments:
        return
    span = moments[-1].stamp_ns - moments[0].stamp_ns
    for first, last in _spells(moments):
        length = moments[last].stamp_ns - moments[first].stamp_ns
        if length < min(_SPELL_NS, max(span, 1)):
            continue
        why = _sign_of_motion(survey, robot, moments[first : last + 1], others)
        if why:
            whole = first == 0 and last == len(moments) - 1
            when = "" if whole else f" for {length * 1e-9:.0f} s from stamp {moments[first].stamp_ns * 1e-9:.1f} on"
            yield Doubt(4 if length > 0.1 * span else 2, f"its pose stands still{when}, although {why}")
            return


def _spells(moments: list[Moment]) -> Iterator[tuple[int, int]]:
    """First and last index of spells without any motion, longest first."""
    spells, begin = [], 0
    for index in range(1, len(moments) + 1):
        if index == len(moments) or not _same(moments[begin].pose, moments[index].pose):
            if index - begin > 1:
                spells.append((begin, index - 1))
            begin = index
    yield from sorted(spells, key=lambda spell: moments[spell[0]].stamp_ns - moments[spell[1]].stamp_ns)


def _same(a: FloatArray, b: FloatArray) -> bool:
    return bool((np.abs(a - b) <= (_STILL_M, _STILL_M, _STILL_RAD)).all())


def _sign_of_motion(survey: LogSurvey, robot: Robot, still: list[Moment], others: list[Source]) -> str:
    """What says that the robot drove meanwhile; empty if nothing does."""
    if np.median([m.speed for m in still]) > _SPEED or np.median([m.turn for m in still]) > _TURN:
        return "its own twist says that the robot drives"
    first_ns, last_ns = still[0].stamp_ns, still[-1].stamp_ns
    for other in others:
        poses = [moment.pose for moment in other.moments if first_ns <= moment.stamp_ns <= last_ns]
        if len(poses) > 1 and _travel(poses):
            return f"{'the transform of the base' if other.name == TF else clean(other.name)} moves"
    for topic in robot.scans:
        if _changes(survey, robot, topic, first_ns, last_ns):
            return f"what {clean(topic)} sees changes"
    return ""


def _travel(poses: list[FloatArray]) -> bool:
    steps = [se2.between(poses[0], pose) for pose in poses]
    return any(math.hypot(x, y) > _MOVED_M or abs(yaw) > _MOVED_RAD for x, y, yaw in steps)


def _changes(survey: LogSurvey, robot: Robot, topic: str, first_ns: int, last_ns: int) -> bool:
    """Whether most readings of a lidar that is fixed on the base change between two stamps."""
    records = (record for run in survey.topics[topic].kept_runs() for record in run)
    scans = [s for s in records if isinstance(s, LaserScan) and first_ns <= s.stamp_ns <= last_ns]
    if len(scans) < 2 or robot.frames.moves_between(robot.base, scans[0].frame_id):
        return False
    return any(_differ(scans[0], scan) for scan in scans[1:])


def _differ(a: LaserScan, b: LaserScan) -> bool:
    if a.ranges.shape != b.ranges.shape:
        return False
    both = np.isfinite(a.ranges) & np.isfinite(b.ranges)
    far = np.abs(a.ranges[both] - b.ranges[both]) > _CHANGED_M + 0.05 * a.ranges[both]
    return bool(far.size > 10 and np.mean(far) > 0.5)


def _of_orientation(source: Source, others: list[Source]) -> Iterator[Doubt]:
    """Positions that go around corners without ever turning: GPS, or an orientation that nobody filled in."""
    moments = source.moments
    if len(moments) < 3 or any(abs(m.pose[2] - moments[0].pose[2]) > _STILL_RAD for m in moments):
        return
    steps = [b.pose[:2] - a.pose[:2] for a, b in zip(moments[:-1:3], moments[3::3], strict=False)]
    far = [step for step in steps if math.hypot(*step) > 2.0 * _ROUGH_M]
    courses = [math.atan2(step[1], step[0]) for step in far]
    bends = max((abs(math.remainder(c - courses[0], 2.0 * math.pi)) for c in courses), default=0.0)
    turning = [other for other in others if _turns(other)]
    if np.median([m.turn for m in moments]) > _TURN or (far and turning) or bends > 0.25 * math.pi:
        yield Doubt(3, "its positions move, its orientation never turns" if far else "its orientation never turns")


def _turns(source: Source) -> bool:
    moments = source.moments
    return any(abs(math.remainder(m.pose[2] - moments[0].pose[2], 2.0 * math.pi)) > 3.0 * _MOVED_RAD for m in moments)


def _of_roughness(source: Source) -> Iterator[Doubt]:
    """Poses that zigzag from message to message by more than they go forward: noise, or two nodes by turns."""
    runs = [run for run in source.runs if len(run) == 3 and run[0].stamp_ns < run[1].stamp_ns < run[2].stamp_ns]
    if len(runs) < 8:
        return
    kinks, is_wild = _kinks(runs)
    if np.count_nonzero(is_wild) < 0.2 * len(runs):
        return
    metres, radians = np.median(kinks[is_wild], axis=0)
    what = f"zigzags by {metres:.2f} m and {math.degrees(radians):.1f} deg from message to message"
    if source.name == TF:
        yield Doubt(3, f"it {what}: two nodes broadcast it, or it is noise")
    else:
        yield Doubt(3, f"it {what}: noise, or two nodes publish on it")


def _kinks(runs: list[list[Moment]]) -> tuple[FloatArray, BoolArray]:
    """How far (R, 2) [m, rad] the middle one of three poses lies off the way between the others; (R,) if no motion."""
    poses = np.array([[moment.pose for moment in run] for run in runs])
    stamps = np.array([[moment.stamp_ns for moment in run] for run in runs])
    fractions = (stamps[:, 1] - stamps[:, 0]) / (stamps[:, 2] - stamps[:, 0])
    off = se2.between(se2.interpolate(poses[:, 0], poses[:, 2], fractions), poses[:, 1])
    steps = se2.between(poses[:, 0], poses[:, 2])
    kinks, ways = (np.stack([np.hypot(p[:, 0], p[:, 1]), np.abs(p[:, 2])], axis=1) for p in (off, steps))
    return kinks, (kinks > np.maximum(ways, (_ROUGH_M, _ROUGH_RAD))).any(axis=1)
