"""Robots that share a log, and robots of which only parts were recorded."""

from __future__ import annotations

import time

import pytest

from mclcli.errors import AmbiguousRobotError, UsageError
from mclcli.geometry import se3
from mclcli.io.recording.robots import find_robots
from mclcli.io.recording.roles import RequestedRoles, assign
from tests.io import drives
from tests.io.drives import Drive, surveyed
from tests.io.surveys import LASER, ODOM, log_of

BACKWARDS = (-0.2, 0.0, 3.0)
ONE, TWO = Drive("/robot1"), Drive("/robot2", lead=3.0, mount=BACKWARDS)
SHARED = Drive("/robot1", "robot1/", tf_space=""), Drive("/robot2", "robot2/", lead=3.0, mount=BACKWARDS, tf_space="")


def named(number: int) -> RequestedRoles:
    return RequestedRoles(scan=(f"/robot{number}/scan",))


@pytest.mark.parametrize("odometry", ["", "tf"])
@pytest.mark.parametrize("number", [1, 2])
def test_a_scan_brings_the_transforms_and_odometry_of_its_namespace(number: int, odometry: str) -> None:
    survey = surveyed(ONE.messages(), TWO.messages())
    roles = assign(survey, RequestedRoles(scan=(f"/robot{number}/scan",), odometry=odometry))
    assert roles.odometry == (odometry or f"/robot{number}/odom")
    assert roles.robot == f"robot{number}"
    assert set(roles.transform_topics) == {f"/robot{number}/tf_static", f"/robot{number}/tf"}
    mount = roles.frames.lookup("base_link", "laser", 0)
    assert mount is not None
    assert se3.to_planar(mount).tolist() == pytest.approx((ONE, TWO)[number - 1].mount)


def test_transforms_of_a_robot_that_has_nothing_else_are_left_alone() -> None:
    static = [message for message in TWO.messages() if message.topic.endswith("tf_static")]
    roles = assign(surveyed(ONE.messages(), static))
    assert (roles.scan, roles.odometry, roles.robot) == (("/robot1/scan",), "/robot1/odom", "")
    mount = roles.frames.lookup("base_link", "laser", 0)
    assert mount is not None
    assert se3.to_planar(mount).tolist() == pytest.approx(ONE.mount)


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize(
    "ask",
    [
        lambda n: RequestedRoles(scan=(f"/robot{n}/scan",)),
        lambda n: RequestedRoles(base_frame=f"robot{n}/base_link"),
        lambda n: RequestedRoles(robot=f"robot{n}"),
        lambda n: RequestedRoles(robot=f"/robot{n}/"),
        lambda n: RequestedRoles(odometry=f"/robot{n}/odom"),
    ],
    ids=["scan", "base", "name", "namespace", "odometry"],
)
def test_frames_with_prefixes_are_robots_too(number: int, ask: object) -> None:
    survey = surveyed(*(drive.messages() for drive in SHARED))
    roles = assign(survey, ask(number))  # type: ignore[operator]
    assert (roles.scan, roles.odometry) == ((f"/robot{number}/scan",), f"/robot{number}/odom")
    assert (roles.base_frame, roles.odom_frame) == (f"robot{number}/base_link", f"robot{number}/odom")


@pytest.mark.parametrize("drives_", [(ONE, TWO), SHARED])
def test_of_two_whole_robots_one_has_to_be_named(drives_: tuple[Drive, Drive]) -> None:
    survey = surveyed(*(drive.messages() for drive in drives_))
    assert [robot.name for robot in find_robots(survey)] == ["robot1", "robot2"]
    with pytest.raises(AmbiguousRobotError, match=r"2 robots, robot1, robot2; .* --robot NAME"):
        assign(survey)
    with pytest.raises(UsageError, match="no robot 'robot3' in the log; it has robot1, robot2"):
        assign(survey, RequestedRoles(robot="robot3"))


def test_the_only_robot_with_odometry_is_meant() -> None:
    mute = Drive("/robot2", lead=3.0, with_odometry=False, with_tf=False)
    roles = assign(surveyed(ONE.messages(), mute.messages()))
    assert roles.robot == "robot1"
    assert "the only one with sensors and odometry; not robot2" in roles.reasons["robot"]


def test_robots_without_transforms_are_told_apart_by_their_namespaces() -> None:
    logs = [[m for m in drive.messages() if not m.topic.rpartition("/")[2].startswith("tf")] for drive in (ONE, TWO)]
    roles = assign(surveyed(*logs), named(2))
    assert (roles.odometry, roles.robot) == ("/robot2/odom", "robot2")


def test_namespaces_of_sensors_make_no_robots() -> None:
    messages = Drive().messages()
    topic, mount = "/front_lidar/scan", (0.1, 0.0, 0.0)
    front = drives.every(0.2, 10.0, lambda t: drives.at(t, topic, drives.SCAN, drives.scan(t, mount, "front")))
    static = [drives.at(0.0, "/tf_static", drives.TF, drives.transform(0.0, "base_link", "front", (0.1, 0.0, 0.0)))]
    survey = surveyed(messages, front, static)
    assert [robot.name for robot in find_robots(survey)] == [""]
    assert assign(survey).robot == ""


def test_transforms_of_two_namespaces_are_joined_where_one_chain_needs_both() -> None:
    """The driver of a lidar tells its own mount, on a mast that the robot tells of."""
    messages = [m for m in Drive().messages() if m.topic != "/tf_static"]
    mast = drives.at(0.0, "/tf_static", drives.TF, drives.transform(0.0, "base_link", "mast", (0.1, 0.0, 0.0)))
    lidar = drives.at(0.0, "/lidar/tf_static", drives.TF, drives.transform(0.0, "mast", "laser", (0.0, 0.2, 0.0)))
    roles = assign(surveyed(messages, [mast, lidar]))
    mount = roles.frames.lookup("base_link", "laser", 0)
    assert mount is not None
    assert se3.to_planar(mount).tolist() == pytest.approx([0.1, 0.2, 0.0])
    assert "/lidar/" in roles.reasons["frames"]


def test_a_robot_without_a_namespace_beside_one_that_has_one() -> None:
    survey = surveyed(Drive().messages(), TWO.messages())
    assert [robot.name for robot in find_robots(survey)] == ["/", "robot2"]
    root, other = (assign(survey, RequestedRoles(robot=name)) for name in ("/", "robot2"))
    assert (root.scan, root.odometry) == (("/scan",), "/odom")
    assert (other.scan, other.odometry) == (("/robot2/scan",), "/robot2/odom")
    assert other.reasons["odometry"] == "the only odometry topic"
    assert assign(survey, RequestedRoles(odometry="/odom")).scan == ("/scan",)


def test_very_many_topics_are_looked_through_in_no_time() -> None:
    """All are not compared with all; what is named is always looked at."""
    count = 400
    survey = log_of(
        *((f"/r{i}/scan", LASER) for i in range(count)),
        *((f"/r{i}/odom", ODOM) for i in range(count)),
        moving=((f"odom{i}", f"base{i}") for i in range(count)),  # type: ignore[arg-type]
    )
    began = time.process_time()
    roles = assign(survey, RequestedRoles(scan=("/r399/scan",)))
    assert time.process_time() - began < 20.0
    assert roles.scan == ("/r399/scan",)
