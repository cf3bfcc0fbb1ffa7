"""Poses in other frames than the map's, brought to it by the transforms at their stamps."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.errors import InputError
from mclcli.geometry import se2, se3
from mclcli.io.recording.roles import Roles
from mclcli.io.recording.to_map import MapFrame, ToMap, map_frame
from mclcli.records import StampedPose
from mclcli.world.occupancy import OccupancyGrid
from tests.io.surveys import log_of
from tests.support import SECOND, transform

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.records import Transform

TF = "tf2_msgs/msg/TFMessage"
GRID = "nav_msgs/msg/OccupancyGrid"
FRAMES = "frames in the log: map, odom"
WORLD_FROM_MAP = np.array([5.0, -3.0, 0.9])
ROLES = Roles(odometry="/odom", map="/map")


def drift(seconds: float) -> FloatArray:
    """Where odometry's frame is in the map: it drifts."""
    return np.array([1.0 + 0.1 * seconds, 2.0, 0.02 * seconds])


def edge(seconds: float, parent: str, child: str, pose: FloatArray, *, static: bool = False) -> Transform:
    return transform(round(seconds * SECOND), parent, child, se3.from_planar(pose), static=static)


def survey_of(*edges: Transform, map_is: str | None = None) -> LogSurvey:
    """Survey of a log with these transforms, and with a map in a frame."""
    survey = log_of(("/tf", TF), *((("/map", GRID),) if map_is is not None else ()))
    if map_is is not None:
        survey.topics["/map"].sample = OccupancyGrid(np.zeros((1, 1), np.int8), 1.0, np.zeros(3), map_is)
    for item in edges:
        survey.of_transforms("/tf").add("/tf", [item])
    return survey


MOVING = tuple(edge(s, "map", "odom", drift(s)) for s in range(11))
DRIVEN = tuple(edge(s, "odom", "base_link", np.array([0.3 * s, 0.0, 0.0])) for s in range(11))
FIXED = edge(0.0, "world", "map", WORLD_FROM_MAP, static=True)


def pose(seconds: float, frame: str, x: float = 1.0) -> StampedPose:
    return StampedPose(round(seconds * SECOND), frame, np.array([x, 0.5, 0.3]), np.diag([0.04, 0.01, 0.02]))


def target_of(survey: LogSurvey, given: str = "") -> MapFrame:
    return map_frame(survey, ROLES, given)


@pytest.mark.parametrize(
    ("edges", "map_is", "given", "target", "relations"),
    [
        (
            MOVING + DRIVEN,
            None,
            "",
            "map",
            {"map": "the map's", "odom": "joined", "base_link": "joined", "gt": "loose"},
        ),
        ((*MOVING, FIXED), None, "", "map", {"world": "joined", "": "the map's"}),
        (DRIVEN, None, "", "", {"map": "the map's", "world": "taken", "odom": "loose", "base_link": "loose"}),
        (DRIVEN, None, "odom", "odom", {"odom": "the map's"}),
        (DRIVEN, None, "/hall", "", {"hall": "the map's", "map": "the map's", "gt": "taken"}),
        (DRIVEN, "floor", "", "", {"floor": "the map's", "gt": "taken"}),
        ((*MOVING, FIXED), "world", "", "world", {"map": "joined", "world": "the map's"}),
        ((*MOVING, FIXED), "floor", "", "map", {"map": "the map's", "floor": "the map's", "world": "joined"}),
        (MOVING + DRIVEN, "odom", "", "map", {"map": "the map's", "odom": "joined"}),
        (DRIVEN, "odom", "", "", {"map": "the map's", "odom": "loose"}),
        ((*MOVING, edge(0.0, "odom", "window", drift(1.0), static=True)), "window", "", "map", {"window": "joined"}),
        (tuple(edge(s, "world", "odom", drift(s)) for s in range(3)) + DRIVEN, None, "", "world", {"gt": "loose"}),
        ((), None, "", "", {"odom": "loose", "base_link": "loose", "world": "taken"}),
    ],
)
def test_what_the_maps_frame_is(
    edges: tuple[Transform, ...], map_is: str | None, given: str, target: str, relations: dict[str, str]
) -> None:
    survey = survey_of(*edges, map_is=map_is)
    found = replace(target_of(survey, given), own_may_be=False)
    assert found.target == target
    assert {frame: found.relation(survey.frames, frame) for frame in relations} == relations


def test_the_robots_own_frame_may_be_the_maps_where_no_transform_shows_another() -> None:
    survey = survey_of(*DRIVEN)
    assert target_of(survey).relation(survey.frames, "odom") == "taken"  # Stage's /base_pose_ground_truth says that
    survey = survey_of(*DRIVEN, edge(0.0, "map", "station", drift(0.0), static=True))
    assert target_of(survey).relation(survey.frames, "odom") == "loose"


def brought(survey: LogSurvey, *events: StampedPose | Transform) -> list[StampedPose | None]:
    """Poses as they come out, of events in the order of the log."""
    way = ToMap(survey, target_of(survey), "/gt")
    found: list[StampedPose | None] = []
    for event in events:
        way.take(event) if isinstance(event, StampedPose) else way.take_transforms((event,))
        found += way.ready()
    return found + list(way.ready(complete=True))


def test_a_pose_waits_for_the_transforms_of_its_stamp() -> None:
    survey = survey_of(*MOVING)
    (found,) = brought(survey, MOVING[0], pose(0.5, "odom"), MOVING[1])
    assert found is not None
    assert found.frame_id == "map"
    np.testing.assert_allclose(found.pose, se2.compose(drift(0.5), pose(0.5, "odom").pose), atol=1e-12)


def test_what_does_not_move_holds_before_it_was_sent() -> None:
    (found,) = brought(survey_of(FIXED), pose(-100.0, "world"))
    assert found is not None
    np.testing.assert_allclose(se2.compose(WORLD_FROM_MAP, found.pose), [1.0, 0.5, 0.3], atol=1e-12)
    turned = np.array([[math.cos(0.9), math.sin(0.9)], [-math.sin(0.9), math.cos(0.9)]])
    assert found.covariance is not None
    np.testing.assert_allclose(found.covariance[:2, :2], turned @ np.diag([0.04, 0.01]) @ turned.T, atol=1e-12)


def test_poses_outside_the_transforms_are_counted_and_keep_the_order() -> None:
    survey = survey_of(*MOVING)
    poses = [
        pose(-1.0, "odom"),
        pose(3.5, "odom", 2.0),
        pose(4.0, "map", 3.0),
        pose(20.0, "odom"),
        pose(5.0, "map", 4.0),
    ]
    found = brought(survey, poses[0], *MOVING[:5], poses[1], poses[2], *MOVING[5:], *poses[3:])
    assert [None if one is None else one.stamp_ns for one in found] == [
        None,
        3.5 * SECOND,
        4 * SECOND,
        None,
        5 * SECOND,
    ]
    assert found[2] is poses[2]  # as it was stated, to the bit


def test_time_that_jumps_back_is_another_drive() -> None:
    again = [edge(s, "map", "odom", drift(s) + np.array([10.0, 0.0, 0.0])) for s in range(4)]
    first, second = brought(survey_of(*MOVING), *MOVING[:4], pose(2.5, "odom"), *again, pose(2.5, "odom"))
    assert first is not None
    assert second is not None
    assert second.pose[0] - first.pose[0] == pytest.approx(10.0)


def test_a_frame_with_another_axis_up() -> None:
    standing = transform(0, "map", "mocap", se3.from_rpy([1.0, 2.0, 0.0], math.pi / 2, 0.0, 0.0), static=True)
    in_space = se3.from_rpy([3.0, 0.0, -4.0], 0.0, 0.7, 0.0)  # y is up: the ground is x and -z, yaw turns about y
    stated = StampedPose(0, "mocap", se3.to_planar(in_space), None, in_space)
    (found,) = brought(survey_of(standing), stated)
    assert found is not None
    np.testing.assert_allclose(found.pose, [4.0, 6.0, 0.7], atol=1e-12)


def test_what_was_done_is_told(caplog: pytest.LogCaptureFixture) -> None:
    survey = survey_of(*MOVING, FIXED)
    way = ToMap(survey, target_of(survey), "/gt")
    for one in (*(pose(0.1 * s, "world") for s in range(20)), pose(0.0, "map"), pose(9.0, "gone"), pose(99.0, "odom")):
        way.take(one)
    assert sum(one is not None for one in way.ready(complete=True)) == 21
    with caplog.at_level(logging.INFO, "mclcli"):
        way.tell()
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [
        ("INFO", "/gt: 20 poses in frame 'world' brought to 'map' by the transforms at their stamps"),
        ("WARNING", f"/gt: 1 pose in frame 'gone' left out: no transform joins 'map' and 'gone'; {FRAMES}, world"),
        ("WARNING", "/gt: 1 pose in frame 'odom' left out: no transform to 'map' at their stamps"),
    ]
    assert way.nothing.startswith("1 pose in frame 'gone' left out: no transform joins")


def test_poses_in_the_maps_frame_are_not_worth_a_word(caplog: pytest.LogCaptureFixture) -> None:
    survey = survey_of(*MOVING)
    way = ToMap(survey, target_of(survey), "/gt")
    way.take(pose(1.0, "map"))
    assert len(list(way.ready())) == 1
    with caplog.at_level(logging.DEBUG, "mclcli"):
        way.tell()
    assert not caplog.records
    assert way.nothing == ""
    assert way.topics_for(["map", ""]) == frozenset()
    assert way.topics_for(["odom"]) == {"/tf"}


def test_of_a_stream_nobody_knows_yet_what_will_move() -> None:
    survey = survey_of(FIXED, *MOVING[:1])
    assert ToMap(survey, target_of(survey), "/gt").topics_for(["odom", "world"]) == frozenset()
    survey.complete = False
    assert ToMap(survey, target_of(survey), "/gt").topics_for(["odom"]) == {"/tf"}


def test_a_frame_that_nothing_joins_is_refused_by_name() -> None:
    survey = survey_of(*MOVING)
    way = ToMap(survey, map_frame(survey, ROLES, cure="say --so {frame}"), "/gt")
    with pytest.raises(InputError) as caught:
        way.require("world")
    told = "topic '/gt' states poses in frame 'world'; no transform joins 'map' and 'world'"
    assert str(caught.value) == f"{told}; {FRAMES}; say --so world"


def test_old_transforms_are_forgotten_but_not_those_that_a_pose_waits_for() -> None:
    survey = survey_of(*MOVING)
    way = ToMap(survey, target_of(survey), "/gt")
    many = [edge(0.1 * s, "map", "odom", drift(0.1 * s)) for s in range(2500)]
    way.take_transforms(many[:100])
    way.take(pose(9.95, "odom"))
    way.take_transforms(many[100:])
    (found,) = way.ready()
    assert found is not None
    np.testing.assert_allclose(found.pose, se2.compose(drift(9.95), pose(0.0, "odom").pose), atol=1e-9)
    way.take(pose(200.0, "odom"))
    assert next(way.ready()) is not None
