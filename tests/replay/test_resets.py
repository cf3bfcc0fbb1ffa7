"""Odometry that is set back or jumps, in gaps or not: a new segment; the robot is searched for or goes on."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.filter.start import AroundPose
from mclcli.geometry import se2, se3
from mclcli.motion.odometry import OdometryParameters, OdometryPath
from mclcli.records import Odometry
from tests.replay.replays import START, ns, odom, run, scan, tree
from tests.support import transform

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.records import TrackPoint
    from mclcli.replay.tally import ReplayTally
    from tests.replay.replays import Event

LIMITS = OdometryParameters()
BEAMS = 36
ELSEWHERE = np.array([8.0, 5.0, 2.0])
GAPS = [1.5, 60.0, 86_400.0]
BEFORE, AFTER = 3.0, 3.0


def fitting(seconds: float, pose: FloatArray, topic: str = "/scan") -> Event:
    """A scan all round from a pose in the room, each beam ending within a wall."""
    x, y, yaw = se2.compose(pose, [0.1, 0.0, 0.0])
    angles = np.arange(BEAMS) * (2 * math.pi / BEAMS) - 3.1
    cos, sin = np.cos(angles + yaw), np.sin(angles + yaw)
    to_x = np.where(cos > 0, 11.3 - x, 0.7 - x) / cos
    to_y = np.where(sin > 0, 7.3 - y, 0.7 - y) / sin
    record: Any = scan(seconds)[1]
    ranges = np.minimum(to_x, to_y)
    fields = {"ranges": ranges, "angle_min": -3.1, "angle_increment": 2 * math.pi / BEAMS, "range_max": 30.0}
    return topic, dataclasses.replace(record, **fields)


def at(seconds: float, begin: FloatArray) -> FloatArray:
    """The robot's way: ahead at 0.5 m/s in a slight bend."""
    return se2.compose(begin, se2.exp([0.5 * seconds, 0.0, 0.15 * seconds]))


def drive(begin: float, seconds: float, truth: FloatArray, stated: FloatArray, frame: str = "odom") -> list[Event]:
    """10 Hz of odometry that begins at ``stated``, with fitting scans, of a robot that begins at ``truth``."""
    events: list[Event] = []
    for number in range(round(seconds * 10) + 1):
        t = number / 10
        topic, record = odom(begin + t, *at(t, stated))
        assert isinstance(record, Odometry)
        events += [(topic, dataclasses.replace(record, frame_id=frame)), fitting(begin + t, at(t, truth))]
    return events


def two_parts(
    gap: float,
    truth: FloatArray,
    stated: FloatArray,
    frame: str = "odom",
    odom_start: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[Event]:
    """3 s from START with odometry from its origin; after a gap 3 s from ``truth`` with odometry from ``stated``."""
    first = drive(0.0, BEFORE, START, np.array(odom_start))
    return [*first, *drive(BEFORE + gap, AFTER, truth, stated, frame)]


def search(pose: FloatArray) -> AroundPose:
    return AroundPose(pose, np.diag(np.square([0.01, 0.01, 0.01])))


def off(points: Sequence[TrackPoint], gap: float, truth: FloatArray) -> float:
    """How far the last point is from the truth [m]."""
    last = points[-1]
    assert last.stamp_ns == ns(BEFORE + gap + AFTER - 0.1) or last.stamp_ns == ns(BEFORE + gap + AFTER)
    true = at(last.stamp_ns / 1e9 - BEFORE - gap, truth)
    return math.dist(last.estimate.pose[:2], true[:2])


def outcome(events: list[Event], **changes: Any) -> tuple[list[TrackPoint], ReplayTally]:
    return run(events, odometry_limits=LIMITS, **changes)


LAST = at(BEFORE, START)  # where the first part ends
STATED = {
    "set back": np.zeros(3),
    "set back but for the yaw": np.array([0.0, 0.0, 1.3]),
    "of another frame": np.array([5.0, 3.0, 1.0]),
    "set back a while ago": np.array([0.3, -0.2, 0.4]),
}


@pytest.mark.parametrize("stated", STATED)
@pytest.mark.parametrize("gap", [0.1, *GAPS])
def test_a_robot_that_was_carried_is_searched_for(gap: float, stated: str) -> None:
    start = search(START)
    for changes in ({"search": search(ELSEWHERE)}, {"start": start, "search": search(ELSEWHERE)}):
        points, tally = outcome(two_parts(gap, ELSEWHERE, STATED[stated]), **changes)
        assert off(points, gap, ELSEWHERE) < 0.2
        assert {point.segment for point in points} == {0, 1}
        (reset,) = tally.resets
        assert reset.searched
        assert (reset.jump.before_ns, reset.jump.after_ns) == (ns(BEFORE), ns(BEFORE + gap))
        assert (tally.segments, tally.time_jumps) == (2, 0)


@pytest.mark.parametrize("stated", STATED)
@pytest.mark.parametrize("gap", [0.1, *GAPS])
def test_a_robot_that_stood_meanwhile_goes_on_where_it_was(gap: float, stated: str) -> None:
    points, tally = outcome(two_parts(gap, LAST, STATED[stated]))
    assert off(points, gap, LAST) < 0.2
    (reset,) = tally.resets
    assert not reset.searched
    assert {point.segment for point in points} == ({0} if gap < 1.0 else {0, 1})
    steps = [point.step.step for point in points if point.step]
    assert steps == list(range(len(steps)))


@pytest.mark.parametrize("gap", [0.1, *GAPS, 20.0])
@pytest.mark.parametrize("moved", [0.0, 0.3, 3.0])
def test_a_robot_whose_odometry_goes_on_is_not_called_reset(gap: float, moved: float) -> None:
    """It stood, or drove on while the recording was paused, and its odometry knows how far."""
    step = np.array([min(moved, 0.5 if gap < 1.0 else moved), 0.0, 0.2])
    truth, stated = se2.compose(LAST, step), se2.compose(at(BEFORE, np.zeros(3)), step)
    for changes in ({}, {"search": search(ELSEWHERE)}):
        points, tally = outcome(two_parts(gap, truth, stated), **changes)
        assert off(points, gap, truth) < 0.3
        assert (tally.resets, tally.segments, tally.odometry_jumps) == ([], 1, 0)


def test_a_start_that_presupposes_nothing_searches_after_every_reset_in_a_gap() -> None:
    """However well what is seen fits where the robot was."""
    asked = []

    class Finder:
        def place(self, opening: Any, n: int, rng: np.random.Generator) -> FloatArray:
            del rng
            asked.append(opening.stamp_ns)
            return np.tile(START if opening.stamp_ns < ns(BEFORE) else LAST, (n, 1))

    finder = Finder()
    outcome(two_parts(60.0, LAST, np.zeros(3)), start=finder, search=finder)
    assert asked == [0, ns(BEFORE + 60.0)]
    asked.clear()
    outcome(two_parts(0.1, LAST, np.zeros(3)), start=finder, search=finder)
    assert asked == [0]  # in 0.1 s nobody carries a robot away


def test_another_frame_of_odometry_after_a_gap_is_a_reset_however_near() -> None:
    stated = se2.compose(at(BEFORE, np.zeros(3)), [0.2, 0.0, 0.0])
    _, tally = outcome(two_parts(60.0, LAST, stated, frame="odom_of_another"))
    assert len(tally.resets) == 1
    _, tally = outcome(two_parts(0.1, LAST, stated, frame="odom_of_another"))
    assert tally.resets == []


def test_what_is_seen_while_odometry_is_set_back_is_counted_and_not_used() -> None:
    events = two_parts(60.0, ELSEWHERE, np.zeros(3))
    amid = [fitting(BEFORE + 10.0 + i, LAST) for i in range(5)]
    cut = next(i for i, (_, record) in enumerate(events) if record.stamp_ns > ns(BEFORE))  # type: ignore[attr-defined]
    points, tally = outcome([*events[:cut], *amid, *events[cut:]], search=search(ELSEWHERE))
    assert tally.skipped["/scan", "while odometry was set back"] == 5
    assert off(points, 60.0, ELSEWHERE) < 0.2


def test_odometry_that_jumps_all_the_time_is_no_row_of_resets() -> None:
    """Two sources on one topic: one of them 5 m away."""
    events = drive(0.0, 3.0, START, np.zeros(3))
    both = [e for event in events for e in ([event, elsewhere(event)] if event[0] == "/odom" else [event])]
    points, tally = outcome(both)
    assert (tally.segments, len(tally.resets)) == (1, 1)
    assert tally.odometry_jumps > 50
    assert len(points) > 25


def elsewhere(event: Event) -> Event:
    record: Any = event[1]
    return event[0], dataclasses.replace(
        record, stamp_ns=record.stamp_ns + 1000, pose=np.add(record.pose, [5.0, 0.0, 0.0])
    )


def test_transforms_that_are_the_odometry_are_set_back_too() -> None:
    def tf(record: Any) -> Event:
        return "/tf", (transform(record.stamp_ns, "odom", "base_link", se3.from_planar(record.pose)),)

    events = [
        tf(record) if topic == "/odom" else (topic, record) for topic, record in two_parts(60.0, ELSEWHERE, np.zeros(3))
    ]
    frames = tree(("base_link", "laser", se3.from_planar([0.1, 0, 0])))
    for event in events[:4:2]:
        frames.add(event[1][0])  # type: ignore[index]
    points, tally = outcome(events, odometry="tf", frames=frames, search=search(ELSEWHERE))
    assert len(tally.resets) == 1
    assert off(points, 60.0, ELSEWHERE) < 0.2


def test_who_believes_all_odometry_gets_it() -> None:
    points, tally = run(two_parts(60.0, LAST, np.zeros(3)), odometry_limits=OdometryParameters(0.0, 0.0))
    assert (tally.resets, tally.segments) == ([], 1)
    assert off(points, 60.0, LAST) > 1.0


@pytest.mark.parametrize(
    ("step", "seconds", "said"),
    [
        ((3.0, 0.0, 0.0), 0.1, "jump"),
        ((0.0, 0.0, 2.0), 0.1, "jump"),
        ((0.9, 0.0, 0.0), 0.1, ""),
        ((1.2, 0.0, 0.0), 0.2, "doubt"),
        ((3.0, 0.0, 0.0), 0.5, "doubt"),
        ((3.0, 0.0, 0.0), 60.0, "doubt"),
        ((0.9, 0.0, 0.4), 60.0, ""),
        ((0.0, 0.0, 0.6), 60.0, "doubt"),
        ((0.0, 0.0, 0.6), 0.1, ""),
        ((-1.0, -2.0, -0.5), 60.0, "jump"),  # to the origin
        ((-0.9995, -2.0, -0.5), 60.0, "jump"),
        ((-0.9, -2.0, -0.5), 60.0, "doubt"),
    ],
)
def test_what_a_step_of_odometry_is(step: tuple[float, float, float], seconds: float, said: str) -> None:
    """After a step of 0.05 m in 0.1 s that ends at (1, 2, 0.5)."""
    path = OdometryPath(LIMITS)
    for stamp, x in ((0.0, 0.95), (0.1, 1.0)):
        path.append(ns(stamp), np.array([x, 2.0, 0.5]))
    path.append(ns(0.1 + seconds), np.array([1.0, 2.0, 0.5]) + step)
    assert ("jump" if path.jump else "doubt" if path.doubt else "") == said


@pytest.mark.parametrize("interval", [0.02, 0.1, 0.5, 2.0])
def test_a_robot_that_drives_through_the_origin_is_not_reset(interval: float) -> None:
    path = OdometryPath(LIMITS)
    for number in range(-5, 6):
        path.append(ns(number * interval), np.array([0.4 * number * interval, 0.0, 0.0]))
        if interval < 1.0:
            assert path.jump is None
        assert path.doubt is None


@pytest.mark.parametrize("fast", [2.0, 5.0])
def test_fast_robots_with_slow_odometry_are_believed(fast: float) -> None:
    path = OdometryPath(LIMITS)
    for number in range(10):
        path.append(ns(number * 0.5), np.array([fast * number * 0.5 + 3.0, 1.0, 0.0]))
        assert path.jump is None
        assert path.doubt is None or number == 1
