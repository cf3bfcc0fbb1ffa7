"""Topics that look like what a run needs: what cannot be used is named with the reason, never said not to be there."""

from __future__ import annotations

import numpy as np
import pytest

from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.recording.roles import assign
from mclcli.io.recording.survey import LogSurvey, survey_log
from mclcli.io.recording.unusable import because, no_map, no_odometry, no_scan, obstacles, problem, told
from tests.io.ros_messages import GRID, ODOMETRY, SCAN, edge, raw

LASER, ODOM, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
MAP, CLOUD = "nav_msgs/msg/OccupancyGrid", "sensor_msgs/msg/PointCloud2"
UNFILLED = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": dict.fromkeys("xyzw", 0.0)}
COVARIANCE = {"covariance": np.zeros(36)}


def at(message: RawMessage, ns: int) -> RawMessage:
    return message._replace(log_time_ns=ns)


def survey(*messages: RawMessage) -> LogSurvey:
    return survey_log(messages)


def foreign(topic: str, kind: str, encoding: str = "cdr") -> RawMessage:
    return RawMessage(Channel(topic, kind, encoding), 0, b"\0\1\0\0abcd")


SCANS = [at(raw("cdr", LASER, SCAN, topic="/scan"), ns) for ns in (0, 10**9)]
DRIVE = [at(raw("cdr", ODOM, ODOMETRY, topic="/odom"), ns) for ns in (0, 10**9)]


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (UNFILLED, "its quaternion is 0, 0, 0, 0: the orientation was never filled in"),
        (UNFILLED | {"orientation": dict.fromkeys("xyzw", 1.0)}, "its quaternion is not of length 1"),
        (UNFILLED | {"position": {"x": np.nan, "y": 0.0, "z": 0.0}}, "its position is not finite, or beyond 1e9 m"),
    ],
)
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_odometry_without_a_pose_is_named_with_the_reason(encoding: str, pose: object, reason: str) -> None:
    found = survey(*SCANS, raw(encoding, ODOM, ODOMETRY | {"pose": {"pose": pose} | COVARIANCE}, topic="/odom"))
    parts = assign(found)
    assert parts.odometry == ""
    assert obstacles(found, parts.scan, parts.vision, parts.odometry) == [
        f"no odometry can be used: /odom of type {ODOM} cannot be used: {reason}"
    ]


def test_what_is_cut_short_is_named() -> None:
    cut = [message._replace(data=message.data[:40]) for message in (SCANS[0], DRIVE[0])]
    found = survey(*cut, raw("cdr", MAP, GRID, topic="/map")._replace(data=b"\0\1\0\0"))
    for said, name in ((no_scan(found), "/scan"), (no_odometry(found), "/odom"), (no_map(found), "/map")):
        assert f"{name} of type" in said
        assert "cut short" in said


@pytest.mark.parametrize(
    ("topic", "kind", "encoding", "reason"),
    [
        ("/points", CLOUD, "cdr", "as pointcloud_to_laserscan does"),
        ("/echoes", "sensor_msgs/msg/MultiEchoLaserScan", "cdr", "keep one echo of each beam"),
        ("/livox", "livox_ros_driver2/msg/CustomMsg", "cdr", "as pointcloud_to_laserscan does"),
        ("/scan", "foxglove.LaserScan", "protobuf", "mcl reads messages of ROS, not protobuf; convert it"),
        ("/scan", "foxglove::LaserScan", "json", "mcl reads messages of ROS, not json; convert it"),
        ("/scan", LASER, "json", "its encoding 'json' is not supported"),
        ("/scan", LASER, "cbor", "its encoding 'cbor' is not supported"),
        ("/scan", "", "cdr", "it has no schema, so nothing says its type"),
    ],
)
def test_what_might_be_a_scan_is_named_with_what_would_help(topic: str, kind: str, encoding: str, reason: str) -> None:
    found = survey(*DRIVE, foreign(topic, kind, encoding))
    (sentence,) = told(found, "scan")
    assert sentence.startswith(f"{topic} of type {kind} cannot be used" if kind else f"{topic} cannot be used")
    assert reason in sentence
    assert obstacles(found, (), (), "/odom") == [f"no laser scan can be used: {sentence}"]


def test_what_looks_like_nothing_needed_is_no_reason() -> None:
    found = survey(foreign("/log", "rcl_interfaces/msg/Log"), foreign("/image", "sensor_msgs/msg/Image"))
    assert [problem(found, topic) for topic in found.topics.values()] == ["", ""]
    assert no_scan(found) == "the log has no laser scan; it holds rcl_interfaces/msg/Log, sensor_msgs/msg/Image"
    assert no_odometry(found).startswith("the log has no odometry: no nav_msgs/Odometry topic")
    assert no_map(found) == "no map: the log has no nav_msgs/OccupancyGrid; name one with --map"


def test_topics_alike_are_told_together_and_not_without_end() -> None:
    found = survey(*(foreign(f"/points{number}", CLOUD) for number in range(8)))
    (sentence,) = told(found, "scan")
    assert sentence.startswith("/points0, /points1, /points2, /points3, /points4 and 3 more of type")


def test_a_topic_without_a_message_is_there() -> None:
    found = survey(*SCANS)
    found.silent = {"/odom": Channel("/odom", ODOM, "cdr"), "/log": Channel("/log", "rcl_interfaces/msg/Log", "cdr")}
    assert no_odometry(found) == f"no odometry can be used: /odom of type {ODOM} cannot be used: it has no message"


def test_transforms_that_are_none_are_named() -> None:
    bad, good = (raw("cdr", TF, {"transforms": [edge(norm=norm)]}, topic="/tf") for norm in (0.0, 1.0))
    assert "/tf of type" in no_odometry(survey(*SCANS, bad))
    assert "none of its transforms is rigid" in because(survey(bad), "transforms")
    assert because(survey(bad, good), "transforms") == ""
    assert because(survey(raw("cdr", TF, {"transforms": []}, topic="/tf")), "transforms") == ""


def test_odometry_that_is_passed_over_is_named_with_the_way_to_take_it() -> None:
    found = survey(*SCANS, *(message._replace(channel=Channel("/truth", ODOM, "cdr")) for message in DRIVE))
    assert "--odom /truth takes it" in no_odometry(found)


def test_a_map_that_is_passed_over_is_named_with_the_way_to_take_it() -> None:
    assert "--set map_topic=/costmap takes it" in no_map(survey(raw("cdr", MAP, GRID, topic="/costmap")))


@pytest.mark.parametrize(
    ("odometry", "scans", "reason"),
    [
        ([0, 10**9], [0, 10**9], None),
        ([0, 10**9], [2 * 10**9 - 1, 3 * 10**9], None),
        ([5 * 10**9], [0, 10**10], "odometry /odom has one message: nothing lies between two"),
        ([0, 10**9], [3 * 10**9, 4 * 10**9], "odometry /odom ends before the first message of /scan"),
        ([5 * 10**9, 6 * 10**9], [0, 10**9], "odometry /odom begins after the last message of /scan"),
    ],
)
def test_odometry_at_other_times_than_the_scans_is_told(
    odometry: list[int], scans: list[int], reason: str | None
) -> None:
    messages = [at(DRIVE[0], ns) for ns in odometry] + [at(SCANS[0], ns) for ns in scans]
    found = survey(*messages)
    assert obstacles(found, ("/scan",), (), "/odom") == ([reason] if reason else [])
    found.complete = False
    assert obstacles(found, ("/scan",), (), "/odom") == []


def test_a_map_whose_origin_has_a_quaternion_of_zeros_is_not_turned_and_noted() -> None:
    found = survey(raw("cdr", MAP, GRID | {"info": GRID["info"] | {"origin": UNFILLED}}, topic="/map"))
    grid = found.topics["/map"].sample
    np.testing.assert_array_equal(getattr(grid, "origin", None), [0.0, 0.0, 0.0])
    assert found.tally.notes == {"/map": {"the quaternion of the map's origin is 0, 0, 0, 0: taken for no turn": 1}}
