"""Which topic plays which part, and what is said about it."""

from __future__ import annotations

import pytest

from mclcli.errors import InputError, UsageError
from mclcli.io.recording.roles import RequestedRoles, Roles, assign
from mclcli.io.recording.survey import LogSurvey
from tests.io.surveys import LASER, MARKERS, ODOM, log_of


def test_the_only_topics_of_their_type_get_the_parts() -> None:
    roles = assign(
        log_of(("/scan", LASER), ("/odom", ODOM), ("/aruco", MARKERS), ("/map", "nav_msgs/msg/OccupancyGrid"))
    )
    assert (roles.scan, roles.odometry, roles.vision, roles.map) == (("/scan",), "/odom", ("/aruco",), "/map")
    assert (roles.odom_frame, roles.base_frame, roles.truth) == ("odom", "base_footprint", "")
    assert "only" in roles.reasons["scan"]


def test_of_several_the_name_nearest_to_the_part_wins_and_the_others_are_named() -> None:
    roles = assign(log_of(("/back/cliff", LASER), ("/scan", LASER), ("/wheel_odometry/raw", ODOM), ("/odom", ODOM)))
    assert (roles.scan, roles.odometry) == (("/scan",), "/odom")
    assert "/back/cliff" in roles.reasons["scan"]
    assert "/wheel_odometry/raw" in roles.reasons["odometry"]


def test_the_order_of_topics_does_not_matter() -> None:
    topics = (("/scan", LASER), ("/scan_2", LASER), ("/odom", ODOM), ("/odometry/filtered", ODOM))
    assert assign(log_of(*topics)) == assign(log_of(*reversed(topics)))


@pytest.mark.parametrize(
    "name", ["/ground_truth", "/gt", "/robot/gt_pose", "/mocap/odom", "/vicon/base/base", "/optitrack", "/GroundTruth"]
)
def test_what_is_named_like_a_reference_is_never_odometry(name: str) -> None:
    roles = assign(log_of(("/scan", LASER), (name, ODOM)))
    assert roles.odometry == ""
    assert roles.truth == name


@pytest.mark.parametrize("name", ["/gtsam/odom", "/weight/odom"])
def test_two_letters_within_a_word_make_no_reference(name: str) -> None:
    assert assign(log_of((name, ODOM))).odometry == name


def test_without_an_odometry_topic_moving_transforms_serve() -> None:
    roles = assign(log_of(("/scan", LASER), moving=(("map", "odom"), ("odom", "base_link"))))
    assert (roles.odometry, roles.odom_frame, roles.base_frame) == ("tf", "odom", "base_link")


def test_the_highest_moving_frame_below_the_map_serves_where_none_is_called_odom() -> None:
    roles = assign(log_of(("/scan", LASER), moving=(("map", "wheels"), ("wheels", "base_link"))))
    assert (roles.odometry, roles.odom_frame) == ("tf", "wheels")


def test_the_maps_frame_may_have_another_name() -> None:
    log = log_of(("/scan", LASER), moving=(("hall", "wheels"), ("wheels", "base_link")))
    assert assign(log).odom_frame == "hall"
    assert assign(log, RequestedRoles(map_frame="hall")).odom_frame == "wheels"


def test_a_recorded_map_to_base_is_no_odometry() -> None:
    assert assign(log_of(("/scan", LASER), moving=(("map", "base_link"),))).odometry == ""


def test_wishes_overrule() -> None:
    found = log_of(
        ("/scan", LASER), ("/scan_2", LASER), ("/odom", ODOM), ("/gt", ODOM), moving=(("odom", "base_link"),)
    )
    roles = assign(found, RequestedRoles(scan=("/scan_2", "/scan"), odometry="/gt", base_frame="base_link"))
    assert (roles.scan, roles.odometry, roles.base_frame) == (("/scan_2", "/scan"), "/gt", "base_link")
    assert assign(found, RequestedRoles(odometry="tf", base_frame="base_link")).odom_frame == "odom"


@pytest.mark.parametrize(
    ("requested", "said"),
    [
        (RequestedRoles(scan=("/scna",)), "did you mean '/scan'"),
        (RequestedRoles(scan=("/scna",)), "no topic '/scna' in the log"),
        (RequestedRoles(odometry="/qqqqqqq"), "no topic '/qqqqqqq' in the log; it has"),
        (RequestedRoles(odometry="/scan"), "not of type nav_msgs/msg/Odometry"),
        (RequestedRoles(vision=("/image",)), "mcl cannot use messages of type sensor_msgs/msg/Image"),
    ],
)
def test_a_wish_that_cannot_be_met_is_an_error_in_one_line(requested: RequestedRoles, said: str) -> None:
    found = log_of(("/scan", LASER), ("/odom", ODOM), ("/image", "sensor_msgs/msg/Image"))
    with pytest.raises(UsageError) as caught:
        assign(found, requested)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_odometry_frame_that_is_not_above_the_base_is_an_error() -> None:
    found = log_of(("/scan", LASER), moving=(("odom", "base_link"),))
    with pytest.raises(InputError, match="'wheels' is not above 'base_link'"):
        assign(found, RequestedRoles(odometry="tf", odom_frame="wheels"))


def test_an_empty_log_has_no_parts_to_give() -> None:
    assert assign(LogSurvey()) == Roles()
