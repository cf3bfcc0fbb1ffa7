"""Several sensors in one replay: when each is scored, from where, and through which transforms."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2, se3
from mclcli.geometry.frames import TransformTree
from tests.replay.replays import BOTH, CAMERA, LANDMARK, MODEL, START, drive, ns, odom, run, scan, seen, tree
from tests.support import odometry, transform

if TYPE_CHECKING:
    from tests.replay.replays import Event


def test_sightings_between_updates_are_scored_once_from_where_the_robot_was() -> None:
    """Two images while driving ahead; the particles are scored at the update, one metre on."""
    bearings = [math.atan2(0.0, 1.0), 0.05]
    events = [odom(0, 0), scan(0), odom(0.5, 0.5), seen(0.25, bearings[0]), seen(0.4, bearings[1]), odom(1, 1), scan(1)]
    events += [odom(2, 2), scan(2)]
    points, tally = run(events, instruments=BOTH)
    first, second, third = (point.step for point in points)
    assert first is not None
    assert second is not None
    assert third is not None
    assert tally.used == {"/scan": 3, "/camera": 2}
    assert first.sensors == second.sensors == ("lidar", "vision")
    expected = np.zeros(3)
    for stamp, bearing in zip((0.25, 0.4), bearings, strict=True):
        x, y = START[0] + stamp, START[1]  # 1 m/s without noise
        error = bearing - math.atan2(LANDMARK[1] - y, LANDMARK[0] - x)
        expected += MODEL.log_p(np.array([error]))[0]
    np.testing.assert_allclose(second.log_likelihoods[1], expected, rtol=0, atol=1e-9)
    assert [step.log_likelihoods[1].tolist() for step in (first, third)] == [[0.0] * 3] * 2
    assert [step.beams_used for step in (first, second, third)] == [3, 5, 3]


def test_a_turn_since_the_image_is_undone() -> None:
    seen_at = math.atan2(LANDMARK[1] - START[1], LANDMARK[0] - START[0]) - 0.5  # after turning by 0.5 rad
    events = [odom(0, 0), scan(0), odom(1, 0, 0, 0.5), seen(1, seen_at), odom(2, 0, 0, 1.5), scan(2)]
    points, _ = run(events, instruments=BOTH)
    step = points[-1].step
    assert step is not None
    np.testing.assert_allclose(step.log_likelihoods[1], MODEL.log_p(np.zeros(1))[0], rtol=0, atol=1e-9)


def test_topics_of_one_stamp_go_in_the_order_they_were_named() -> None:
    events = [odom(0, 0), seen(0.5), scan(0.5), odom(1, 1)]
    _, tally = run(events, instruments=BOTH)
    assert tally.used["/scan"] == 1  # the scan first: it begins the run, so the sighting counts too
    assert tally.used["/camera"] == 1


def test_without_a_lidar_sightings_make_the_updates() -> None:
    points, _ = run([odom(0, 0), seen(0.1), odom(1, 1), seen(1), odom(2, 2)], instruments={"/camera": CAMERA})
    assert [point.step is not None for point in points] == [True, True]
    assert points[0].scan is None


def test_without_a_lidar_a_small_move_makes_the_next_sighting_an_update() -> None:
    """Sightings from the same place repeat themselves; from another one they are news."""
    events = [odom(0, 0), seen(0), seen(0.001), odom(1, 0.03), seen(1), odom(2, 0.03), seen(2), odom(3, 0.06), seen(3)]
    points, tally = run(events, instruments={"/camera": CAMERA})
    assert [point.step.beams_used if point.step else None for point in points] == [1, None, 1, None, 1]
    assert tally.used == {"/camera": 5}


def test_an_image_that_comes_after_a_later_scan_was_used_still_counts() -> None:
    late = seen(0.4)
    events = [odom(0, 0), scan(0), odom(0.5, 1), scan(0.5), late, odom(1, 2), scan(1)]
    points, tally = run(events, instruments=BOTH)
    assert tally.used["/camera"] == 1
    assert not tally.skipped
    assert [point.step.beams_used if point.step else None for point in points] == [3, 3, 4]


def swing(seconds: float, yaw: float) -> Event:
    return "/tf", (transform(ns(seconds), "base_link", "camera", se3.from_planar([0, 0, yaw])),)


@pytest.mark.parametrize("pause", [0.5, 30.0], ids=["shortly before the update", "long before the update"])
def test_a_moving_mount_counts_as_it_was_at_the_image(pause: float) -> None:
    """The camera swings; an image taken half way is scored at the next update, however late that comes."""
    frames = tree(("base_link", "laser", np.eye(4)))
    survey = [transform(ns(t), "base_link", "camera", se3.from_planar([0, 0, t])) for t in (0.0, 1.0)]
    for moving in survey:
        frames.add(moving)
    events: list[Event] = [odom(0, 0), scan(0), swing(0, 0.0), swing(1, 1.0), seen(0.5, -0.5), odom(1, 0)]
    steps = int(pause * 2)
    for n in range(1, steps + 1):
        events += [odom(1 + n / 2, 0), scan(1 + n / 2), swing(1 + n / 2, 1.0)]
    events += [odom(pause + 2, 1), scan(pause + 2)]
    points, tally = run(events, instruments=BOTH, frames=frames)
    step = points[-1].step
    assert step is not None
    assert tally.used["/camera"] == 1
    assert step.beams_used == 4
    np.testing.assert_allclose(step.log_likelihoods[1], MODEL.log_p(np.zeros(1))[0], rtol=0, atol=1e-9)


def moved(seconds: float, parent: str, child: str, x: float, yaw: float = 0.0) -> Event:
    return "/tf", (transform(ns(seconds), parent, child, se3.from_planar([x, 0, yaw])),)


def test_odometry_from_transforms_goes_through_chains() -> None:
    frames = TransformTree(keep_history=False)
    record = [moved(t, "odom", "footprint", 1.0 * t, 0.1 * t) for t in (0, 1, 2, 3)]
    for _, transforms in record:
        frames.add(transforms[0])  # type: ignore[index]
    foot_from_base = se3.from_planar([0.2, 0.1, 0.3])
    frames.add(transform(0, "footprint", "base_link", foot_from_base, static=True))
    frames.add(transform(0, "base_link", "laser", np.eye(4), static=True))
    events: list[Event] = [record[0], record[1], scan(0.5), record[2], record[3], scan(2)]
    points, tally = run(events, odometry="tf", frames=frames)
    assert [point.stamp_ns for point in points] == [ns(0.5), ns(2)]
    expected = se2.compose([2.0, 0.0, 0.2], [0.2, 0.1, 0.3])
    np.testing.assert_allclose(points[1].odom_from_base, expected, atol=1e-12)
    assert not tally.skipped


def test_a_static_transform_at_the_end_of_a_log_holds_from_its_start() -> None:
    survey = TransformTree(keep_history=False)
    late = transform(ns(9), "base_link", "laser", np.eye(4), static=True)
    survey.add(late)
    points, tally = run([*drive(2), ("/tf_static", (late,))], frames=survey)
    assert len(points) == 4
    assert set(tally.skipped) == {("/scan", "after the odometry's end")}


def test_odometry_of_another_frame_of_the_robot_is_carried_to_the_base() -> None:
    frames = tree(("wheels", "base_link", se3.from_planar([0.5, 0, 0])), ("base_link", "laser", np.eye(4)))
    points, _ = run([odom(0, 1, 1, math.pi / 2, "wheels"), scan(0), odom(1, 1, 1, 0, "wheels")], frames=frames)
    np.testing.assert_allclose(points[0].odom_from_base, [1.0, 1.5, math.pi / 2], atol=1e-12)


def test_only_the_odometry_topic_that_was_chosen_counts() -> None:
    other: Event = ("/other_odom", odometry(ns(0.5), 77, 0, 0))
    points, _ = run([odom(0, 0), other, scan(0.5), odom(1, 1)])
    np.testing.assert_allclose(points[0].odom_from_base, [0.5, 0, 0], atol=1e-12)
