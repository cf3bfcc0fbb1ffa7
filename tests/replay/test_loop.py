"""Messages in, track points out: what waits, what is scored when, and what is counted instead."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import Localizer
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.start import AlongPoses, AroundPose
from mclcli.geometry import se2, se3
from mclcli.records import LaserScan, StampedPose
from mclcli.replay.loop import replay
from mclcli.replay.measuring import has_moved
from tests.replay.replays import LIDAR, NOISY, START, drive, ns, odom, run, scan, setup

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tests.replay.replays import Event


def test_a_scan_waits_until_odometry_has_passed_it() -> None:
    given: list[int] = []
    events = [odom(0, 0), scan(0.5), scan(0.7), odom(0.6, 0.6), odom(1, 1)]

    def feed() -> Iterable[Event]:
        for number, event in enumerate(events):
            given.append(number)
            yield event

    after = [(point.stamp_ns, given[-1]) for point in replay(feed(), setup())]
    assert after == [(ns(0.5), 3), (ns(0.7), 4)]


def test_odometry_is_interpolated_at_the_stamp() -> None:
    points, _ = run([odom(0, 0), scan(0.25), odom(1, 2, 0, 1.0)])
    expected = se2.interpolate([0, 0, 0], [2, 0, 1.0], 0.25)
    np.testing.assert_allclose(points[0].odom_from_base, expected, atol=1e-12)


def test_a_scan_at_the_very_ends_of_odometry_is_used() -> None:
    points, tally = run([scan(0), odom(0, 0), odom(1, 1), scan(1)])
    assert [point.stamp_ns for point in points] == [0, ns(1)]
    assert not tally.skipped


def test_scans_outside_odometry_are_counted_with_their_reason() -> None:
    events = [scan(0.5), scan(0.9), odom(1, 0), scan(1.5), odom(2, 1), scan(2.1), scan(2.2), scan(2.3)]
    points, tally = run(events)
    assert len(points) == 1
    assert tally.used == {"/scan": 1}
    assert tally.skipped == {("/scan", "before the odometry's start"): 2, ("/scan", "after the odometry's end"): 3}


def test_every_scan_is_either_used_or_counted() -> None:
    events = [scan(-1), *drive(5), scan(0.3), scan(99.5, range_max=0.0), scan(99), ("/other", scan(1)[1])]
    points, tally = run(events)
    given = sum(topic == "/scan" for topic, _ in events)
    assert len(points) == tally.used["/scan"]
    assert tally.used.total() + tally.skipped.total() == given


def test_a_scan_that_comes_late_and_old_is_counted() -> None:
    _, tally = run([odom(0, 0), scan(0.8), odom(1, 1), scan(0.4), odom(2, 2)])
    assert tally.skipped == {("/scan", "stamp older than readings already used"): 1}


def test_scans_recorded_out_of_order_while_waiting_are_used_in_order() -> None:
    points, tally = run([odom(0, 0), scan(0.8), scan(0.4), odom(1, 1)])
    assert [point.stamp_ns for point in points] == [ns(0.4), ns(0.8)]
    assert not tally.skipped


def test_the_window_limits_what_is_used_and_ends_the_reading_early() -> None:
    taken = []

    def feed() -> Iterable[Event]:
        for event in drive(60):
            taken.append(event)
            yield event

    points, tally = run(feed(), window_ns=(ns(1), ns(2)))
    assert [point.stamp_ns for point in points] == [ns(1.1), ns(1.6)]
    assert tally.skipped["/scan", "outside --start and --duration"] >= 2
    assert len(taken) < 15


def test_no_transform_to_the_sensor_is_counted_by_name() -> None:
    _, tally = run([odom(0, 0), scan(0.5, frame_id="roof"), odom(1, 1)])
    assert tally.skipped == {("/scan", "no transform from 'base_link' to 'roof' at its stamp"): 1}


@pytest.mark.parametrize("frame", ["roof", ""])
def test_a_stated_mount_needs_no_transform(frame: str) -> None:
    points, tally = run([odom(0, 0), scan(0.5, frame_id="roof"), odom(1, 1)], mounts={frame: np.eye(4)})
    assert len(points) == 1
    assert not tally.skipped


def test_scans_that_make_no_sense_are_counted() -> None:
    points, tally = run([odom(0, 0), scan(0.2, range_max=0.0), scan(0.4), odom(1, 1)])
    assert len(points) == 1
    assert tally.skipped == {("/scan", "scan with range_max 0"): 1}


def test_the_gate_opens_for_motion_and_for_turning_and_for_the_first_scan() -> None:
    places = [(0, 0.0, 0.0), (1, 0.4, 0.0), (2, 0.6, 0.0), (3, 0.6, 0.2), (4, 0.6, 0.35), (5, 0.6, 0.35)]
    events = [event for t, x, yaw in places for event in (odom(t, x, 0, yaw), scan(t))]
    points, tally = run(events)
    assert [point.step is not None for point in points] == [True, False, True, False, True, False]
    assert tally.updates == 3
    assert tally.distance == pytest.approx(0.6)


def test_slow_motion_adds_up_until_the_gate_opens() -> None:
    points, _ = run([event for t in range(21) for event in (odom(t, 0.06 * t), scan(t))])
    assert [n for n, point in enumerate(points) if point.step] == [0, 9, 18]


def test_between_updates_the_track_follows_odometry() -> None:
    events = [odom(0, 5, 5, 1.0), scan(0), odom(1, 5.1, 5.2, 1.1), scan(1), odom(2, 5.2, 5.3, 1.2), scan(2)]
    points, _ = run(events)
    assert [point.step is None for point in points] == [False, True, True]
    np.testing.assert_allclose(points[0].estimate.pose, START, atol=1e-12)
    for point, pose in zip(points[1:], ([5.1, 5.2, 1.1], [5.2, 5.3, 1.2]), strict=True):
        moved = se2.between([5, 5, 1.0], pose)
        np.testing.assert_allclose(point.estimate.pose, se2.compose(START, moved), atol=1e-9)


def test_one_increment_per_update_moves_the_particles_without_noise_along_odometry() -> None:
    points, _ = run(drive(4))
    for point in points:
        np.testing.assert_allclose(point.estimate.pose, np.add(START, [point.odom_from_base[0] - 0.1, 0, 0]), atol=1e-9)


def test_a_step_is_the_localizers_own() -> None:
    points, _ = run([odom(0, 0), scan(0), odom(1, 1)])
    step = points[0].step
    assert step is not None
    scored = LIDAR.measure(scan(0)[1], se3.from_planar([0.1, 0, 0]))  # type: ignore[arg-type]
    np.testing.assert_array_equal(step.log_likelihoods, [scored.log_likelihood(step.poses)])
    assert step.stamp_ns == points[0].stamp_ns
    assert isinstance(points[0].scan, LaserScan)


def test_gaps_in_odometry_are_counted() -> None:
    _, tally = run([odom(0, 0), odom(1, 1), odom(2.5, 2), odom(3, 3), odom(6, 4), scan(5)])
    assert (tally.odometry_gaps, tally.longest_gap_ns) == (2, ns(3))


def test_the_run_starts_at_the_first_stated_pose() -> None:
    start = AlongPoses([StampedPose(ns(1), "map", START, np.zeros((3, 3)))])
    points, tally = run(drive(3), start=start)
    assert points[0].stamp_ns == ns(1.1)
    assert tally.skipped["/scan", "before the first pose given"] == 2
    np.testing.assert_allclose(points[0].estimate.pose, np.add(START, [0.1, 0, 0]), atol=1e-9)


def test_long_logs_need_odometry_of_the_last_seconds_only() -> None:
    points, tally = run(drive(100, speed=0.01))
    assert len(points) == 200
    assert tally.used["/scan"] == 200


def test_the_same_seed_gives_the_same_track_and_another_one_does_not() -> None:
    def track(seed: int) -> bytes:
        localizer = Localizer(NOISY, FilterParameters(update_min_d=0.5), seed, KldParameters(20, 20))
        spread = AroundPose(START, np.eye(3) * 0.01)
        return b"".join(point.estimate.pose.tobytes() for point in run(drive(4), localizer=localizer, start=spread)[0])

    assert track(5) == track(5)
    assert track(5) != track(6)


def test_a_setup_can_be_replayed_again() -> None:
    once = setup()
    first, second = (b"".join(p.estimate.pose.tobytes() for p in replay(drive(3), once)) for _ in range(2))
    assert first == second


def test_no_message_at_all_is_no_track() -> None:
    points, tally = run([])
    assert points == []
    assert tally.used.total() == tally.skipped.total() == 0


@pytest.mark.parametrize(
    ("increment", "moved"),
    [
        ([0.2, 0.1, 0.1], False),
        ([0.25, 0.0, 0.0], True),
        ([-0.25, 0.0, 0.0], True),
        ([0.2, 0.2, 0.0], True),
        ([0.0, 0.0, 0.2], True),
        ([0.0, 0.0, -0.2], True),
        ([0.0, 0.0, 0.0], False),
    ],
)
def test_the_gate(increment: list[float], moved: bool) -> None:  # noqa: FBT001
    assert has_moved(np.array(increment), 0.25, 0.2) is moved
