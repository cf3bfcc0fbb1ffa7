"""What a log may do to a filter: time or odometry that jumps, operators that state poses, clocks that lag."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.filter.start import AroundPose, Opening, Patience, WhenTold
from mclcli.geometry import se2, se3
from mclcli.motion.odometry import OdometryParameters
from mclcli.records import StampedPose
from tests.replay.replays import BOTH, START, drive, ns, odom, run, scan, seen, tree
from tests.support import transform

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from tests.replay.replays import Event

LIMITS = OdometryParameters()
BY_THE_WALL = np.array([9.85, 5.0, 0.0])


def told(seconds: float, *pose: float, frame: str = "map") -> Event:
    return "/initialpose", StampedPose(ns(seconds), frame, np.array(pose), np.zeros((3, 3)))


def later(events: list[Event], seconds: float) -> list[Event]:
    """The same drive again at another time."""
    moved = []
    for topic, record in events:
        fields = {name: getattr(record, name) for name in type(record).__dataclass_fields__}  # type: ignore[attr-defined]
        moved.append((topic, type(record)(**(fields | {"stamp_ns": fields["stamp_ns"] + ns(seconds)}))))
    return moved


def test_time_that_jumps_back_begins_a_segment_anew() -> None:
    points, tally = run([*later(drive(3), 100), *drive(2)])
    assert [point.segment for point in points] == [0] * 6 + [1] * 4
    assert tally.segments == 2
    first = next(point for point in points if point.segment == 1)
    assert first.step is not None
    np.testing.assert_allclose(first.estimate.pose, START, atol=1e-9)
    steps = [point.step.step for point in points if point.step]
    assert steps == list(range(len(steps)))
    assert {point.step.segment for point in points if point.step} == {0, 1}


def test_a_scan_that_jumps_before_odometry_does_belongs_to_the_new_segment() -> None:
    points, tally = run([*later(drive(3), 100), scan(0.1), scan(0.2), *drive(2)])
    assert [point.stamp_ns for point in points if point.segment == 1][:3] == [ns(0.1), ns(0.2), ns(0.6)]
    assert tally.used.total() + tally.skipped.total() == 7 + 2 + 5


def test_one_old_scan_among_new_ones_is_counted_and_nothing_else() -> None:
    points, tally = run([*drive(3), scan(0.3), odom(3.5, 3.5), scan(3.6), odom(4, 4)])
    assert {point.segment for point in points} == {0}
    assert tally.skipped["/scan", "stamp older than readings already used"] == 1


def test_disorder_of_less_than_a_second_is_no_jump() -> None:
    points, tally = run([odom(0, 0), odom(1, 1), odom(0.2, 0.2), scan(0.5), odom(2, 2)])
    assert tally.segments == 1
    assert points[0].odom_from_base[0] == pytest.approx(0.5)


def test_transforms_begin_segments_too_where_they_are_the_odometry() -> None:
    def tf(seconds: float, x: float) -> Event:
        return "/tf", (transform(ns(seconds), "odom", "base_link", se3.from_planar([x, 0, 0])),)

    frames = tree(("base_link", "laser", np.eye(4)))
    for seconds in (0, 1):
        frames.add(tf(seconds, float(seconds))[1][0])  # type: ignore[index]
    one = [event for i in range(4) for event in (tf(i, float(i)), scan(i + 0.1))]
    points, tally = run([*one, tf(4, 4.0), *one, tf(4, 4.0)], odometry="tf", frames=frames)
    assert [point.segment for point in points] == [0] * 4 + [1] * 4
    assert tally.segments == 2


def test_odometry_that_is_reset_does_not_carry_the_robot_away() -> None:
    """Somebody restarts the driver at x = 2: from there on it counts from 0 again."""
    driven = [(0.1 * i, 0.1 * i - (2.0 if i > 20 else 0.0)) for i in range(41)]
    events = [event for t, x in driven for event in (odom(t, x), scan(t))]
    points, tally = run(events, odometry_limits=LIMITS)
    assert tally.odometry_jumps == 1
    assert points[-1].estimate.pose[0] == pytest.approx(START[0] + 3.9, abs=1e-9)  # the step of the reset is missing
    assert points[-1].odom_from_base[0] == pytest.approx(2.0)  # as recorded
    believed, _ = run(events, odometry_limits=OdometryParameters(0.0, 0.0))
    assert believed[-1].estimate.pose[0] == pytest.approx(START[0] + 2.0, abs=1e-9)


@pytest.mark.parametrize(
    ("step", "seconds", "jumps"), [(0.99, 0.001, 0), (1.01, 0.001, 1), (4.9, 0.5, 0), (5.1, 0.5, 1)]
)
def test_what_counts_as_a_jump(step: float, seconds: float, jumps: int) -> None:
    _, tally = run([odom(0, 0), odom(seconds, step)], odometry_limits=LIMITS)
    assert tally.odometry_jumps == jumps


def test_a_turn_too_fast_is_a_jump() -> None:
    _, tally = run([odom(0, 0), odom(0.05, 0, 0, 1.4), odom(0.1, 0, 0, 3.0)], odometry_limits=LIMITS)
    assert tally.odometry_jumps == 1


def test_the_filter_begins_anew_where_the_operator_says() -> None:
    events = [*drive(2), told(2.05, 4.0, 2.0, 1.0), odom(3, 3), scan(3), odom(4, 4)]
    points, tally = run(sorted(events, key=lambda e: e[1].stamp_ns), follow="/initialpose")  # type: ignore[attr-defined]
    last = points[-1]
    assert last.stamp_ns == ns(3)
    moved = se2.between([2.05, 0, 0], [3, 0, 0])
    np.testing.assert_allclose(last.estimate.pose, se2.compose([4.0, 2.0, 1.0], moved), atol=1e-9)
    assert last.step is not None
    assert tally.restarts == 1
    assert [point.step.step for point in points if point.step] == list(range(tally.updates))


def test_an_operators_pose_is_ignored_unless_followed() -> None:
    points, tally = run([*drive(2), told(1.2, 4.0, 2.0, 1.0)])
    assert tally.restarts == 0
    np.testing.assert_allclose(points[-1].estimate.pose[:2], [START[0] + 1.5, START[1]], atol=1e-9)


def test_a_run_may_wait_to_be_told() -> None:
    events = [odom(0, 0), scan(0.1), odom(1, 1), told(0.6, 5, 5, 0), scan(0.8), odom(2, 2)]
    points, tally = run(events, follow="/initialpose", start=WhenTold())
    assert [point.stamp_ns for point in points] == [ns(0.8)]
    np.testing.assert_allclose(points[0].estimate.pose, [5.2, 5.0, 0.0], atol=1e-9)
    assert tally.skipped["/scan", "before the first pose given"] == 1


def test_a_pose_stated_in_the_odometrys_frame_is_refused() -> None:
    _, tally = run([*drive(2), told(1, 0, 0, 0, frame="odom")], follow="/initialpose")
    assert tally.restarts == 0
    assert tally.skipped["/initialpose", "given in frame 'odom', not in the map's"] == 1


@pytest.mark.parametrize("offset", [-0.25, 0.3])
def test_an_offset_moves_the_stamps_of_scans_and_of_nothing_else(offset: float) -> None:
    events = [odom(0, 0), seen(0.9), scan(1), odom(2, 2)]
    points, _ = run(events, scan_offset_ns=ns(offset))
    assert [point.stamp_ns for point in points] == [ns(1 + offset)]
    assert points[0].odom_from_base[0] == pytest.approx(1 + offset)


def test_with_deskew_each_beam_is_scored_from_where_the_robot_was() -> None:
    """A robot that turns by 90° a second sees three beams 0.1 s apart, all near a wall."""
    events = [odom(0, 0), scan(0.5, time_increment=0.1), odom(1, 1.0, 0, math.pi / 2)]
    start = AroundPose(BY_THE_WALL, np.zeros((3, 3)))
    plain, swept = (run(events, deskew=deskew, start=start)[0][0].step for deskew in (False, True))
    assert plain is not None
    assert swept is not None
    assert swept.log_likelihoods[0, 0] == pytest.approx(beam_by_beam(events), abs=1e-12)
    assert plain.log_likelihoods[0, 0] != pytest.approx(beam_by_beam(events), abs=1e-3)


def beam_by_beam(events: list[Event]) -> float:
    """Log-likelihood of the scan's beams, each as a scan of its own."""
    total = 0.0
    full = events[1][1]
    for number in range(3):
        one = np.full(3, np.nan)
        one[number] = full.ranges[number]  # type: ignore[attr-defined]
        alone = [odom(0, 0), scan(0.5 + 0.1 * number), odom(1, 1.0, 0, math.pi / 2)]
        fields = {name: getattr(alone[1][1], name) for name in type(full).__dataclass_fields__}  # type: ignore[attr-defined]
        alone[1] = ("/scan", type(full)(**(fields | {"ranges": one})))
        then = se2.between(se2.interpolate([0, 0, 0], [1, 0, math.pi / 2], 0.5), odom_at(0.5 + 0.1 * number))
        step = run(alone, start=AroundPose(se2.compose(BY_THE_WALL, then), np.zeros((3, 3))))[0][0].step
        assert step is not None
        total += float(step.log_likelihoods[0, 0])
    return total


def odom_at(seconds: float) -> FloatArray:
    return se2.interpolate([0, 0, 0], [1, 0, math.pi / 2], seconds)


def test_a_scan_to_deskew_waits_for_its_last_beam() -> None:
    events = [odom(0, 0), scan(0.5, time_increment=0.1), odom(0.6, 0.6), odom(0.69, 0.69)]
    _, tally = run(events, deskew=True)
    assert tally.skipped == {("/scan", "after the odometry's end"): 1}
    points, _ = run([*events, odom(0.7, 0.7)], deskew=True)
    assert len(points) == 1


@dataclass(frozen=True)
class Patient:
    """A start that wants to see so many readings first."""

    wanted: int

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray | Patience:
        del rng
        assert opening.stamp_ns == opening.observations[0].reading.stamp_ns
        assert opening.path.covers(opening.observations[-1].reading.stamp_ns)
        if len(opening.observations) < self.wanted and not opening.complete:
            return Patience.HOLD
        return np.tile(START, (n, 1))


def test_a_start_may_look_at_several_readings_and_none_is_lost() -> None:
    plain, _ = run(drive(4))
    held, tally = run(drive(4), start=Patient(5))
    assert [point.stamp_ns for point in held] == [point.stamp_ns for point in plain]
    np.testing.assert_array_equal([p.estimate.pose for p in held], [p.estimate.pose for p in plain])
    assert not tally.skipped.keys() - {("/scan", "after the odometry's end")}


def test_a_start_has_to_answer_at_the_end_of_the_log() -> None:
    points, _ = run(drive(2), start=Patient(1000))
    assert len(points) == 4


def test_what_a_start_sees_has_its_mount_and_its_odometry() -> None:
    openings = []

    class Curious:
        def place(self, opening: Opening, n: int, rng: np.random.Generator) -> FloatArray | Patience:
            del rng
            openings.append(opening)
            return np.tile(START, (n, 1)) if len(opening.observations) == 3 else Patience.HOLD

    run([odom(0, 0), scan(0.5), seen(0.75), scan(1), odom(2, 2)], start=Curious(), instruments=BOTH)
    assert [o.topic for o in openings[-1].observations] == ["/scan", "/camera", "/scan"]
    np.testing.assert_allclose([o.odom_from_base[0] for o in openings[-1].observations], [0.5, 0.75, 1.0])
    np.testing.assert_allclose(openings[0].observations[0].base_from_sensor[:3, 3], [0.1, 0, 0])


@pytest.mark.parametrize("moving", [False, True])
def test_a_camera_that_is_late_finds_the_odometry_and_the_mount_of_its_stamp(*, moving: bool) -> None:
    """A sighting 0.9 s older than the scan that made the last update is placed where the robot and camera were."""

    def mast(seconds: float) -> Event:
        pose = se3.from_planar([0.0, 0.0, 0.2 * seconds if moving else 0.0])
        return "/tf", (transform(ns(seconds), "base_link", "camera", pose),)

    frames = tree(("base_link", "laser", np.eye(4)))
    for seconds in (0, 1):
        frames.add(mast(seconds)[1][0])  # type: ignore[index]
    driven = [event for i in range(9) for event in (mast(i / 2), odom(i / 2, i / 2), scan(i / 2 - 0.1))]
    late = next(number for number, (topic, _) in enumerate(driven) if topic == "/scan" and number > 20)
    events = [*driven[: late + 1], odom(3.6, 3.6), seen(driven[late][1].stamp_ns / ns(1) - 0.9), *driven[late + 1 :]]  # type: ignore[attr-defined]
    _, tally = run(events, instruments=BOTH, frames=frames, transform_topics=("/tf",))
    assert tally.used["/camera"] == 1
    assert not any(topic == "/camera" for topic, _ in tally.skipped)
