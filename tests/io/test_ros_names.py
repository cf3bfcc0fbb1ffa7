"""Names from a robot's parameters in a log that may have been recorded with or without its namespace."""

from __future__ import annotations

import pytest

from mclcli.io.recording.topic_names import find
from tests.io.surveys import LASER, MARKERS, ODOM, log_of

MAP = "nav_msgs/msg/OccupancyGrid"


@pytest.mark.parametrize(
    ("topics", "name", "namespace", "found"),
    [
        (["/scan"], "scan", "", "/scan"),
        (["/scan"], "/scan", "", "/scan"),
        (["/scan"], "scan", "/robot1", "/scan"),
        (["/scan", "/robot1/scan"], "scan", "/robot1", "/robot1/scan"),
        (["/scan", "/robot1/scan"], "/scan", "/robot1", "/scan"),
        (["/robot1/scan", "/robot2/scan"], "scan", "/robot2", "/robot2/scan"),
        (["/robot1/scan"], "<robot_namespace>/scan", "/robot1", "/robot1/scan"),
        (["/robot1/scan"], "<robot_namespace>/scan", "", "/robot1/scan"),
        (["/robot1/scan"], "scan", "", "/robot1/scan"),
        (["/robot1/scan", "/robot2/scan"], "scan", "", ""),
        (["/scan_filtered"], "scan", "", ""),
        (["/my_scan"], "scan", "", ""),
        ([], "scan", "", ""),
    ],
)
def test_scans(topics: list[str], name: str, namespace: str, found: str) -> None:
    log = log_of(*((topic, LASER) for topic in topics), ("/markers", MARKERS))
    assert find(log, "scan_topic", name, namespace) == found


def test_a_topic_of_another_type_does_not_count() -> None:
    log = log_of(("/scan", MARKERS), ("/map", MAP))
    assert find(log, "scan_topic", "scan") == ""
    assert find(log, "map_topic", "map") == "/map"


@pytest.mark.parametrize(
    ("parameter", "name", "namespace", "found"),
    [
        ("base_frame_id", "base_link", "", "base_link"),
        ("base_frame_id", "/base_link", "", "base_link"),
        ("base_frame_id", "base_footprint", "", "base_footprint"),  # of /odom
        ("base_frame_id", "base_link", "/robot1", "base_link"),
        ("base_frame_id", "base", "/robot1", "robot1/base"),
        ("base_frame_id", "wheel", "", ""),
        ("odom_frame_id", "odom", "", "odom"),
        ("odom_frame_id", "wheels", "", "wheels"),
        ("odom_frame_id", "base_link", "", ""),  # nothing moves below it
    ],
)
def test_frames(parameter: str, name: str, namespace: str, found: str) -> None:
    log = log_of(("/odom", ODOM), moving=(("wheels", "base_link"), ("wheels", "robot1/base")))
    assert find(log, parameter, name, namespace) == found
