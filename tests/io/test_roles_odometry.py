"""Odometry that cannot be right: which source is taken instead, and what is said of the one that is used."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.io.recording.odometry_sources import problems_of
from mclcli.io.recording.robots import find_robots
from mclcli.io.recording.roles import RequestedRoles, assign
from tests.io import drives
from tests.io.drives import ODOMETRY, TF, Drive, at, every, surveyed

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.cli.support import Message
    from tests.io.drives import Pose

SECONDS = 10.0
NOISE = np.random.default_rng(7).normal(0.0, 0.4, (1000, 3))


def source(
    topic: str, tell: Callable[[float], Pose], frame: str = "odom", child: str = "base_link", step: float = 0.05
) -> list[Message]:
    """Odometry on a topic that tells the pose ``tell(t)``."""
    return every(step, SECONDS, lambda t: at(t, topic, ODOMETRY, drives.odometry(t, tell(t), frame, child)))


def gps(t: float) -> Pose:
    x, y, _ = drives.pose(t)
    return x + NOISE[round(t * 20), 0], y + NOISE[round(t * 20), 1], 0.0


def smooth_gps(t: float) -> Pose:
    x, y, _ = drives.pose(t)
    return x, y, 0.0


def camera(t: float) -> Pose:
    x, y, yaw = se2.compose(drives.odom(t), NOISE[round(t * 20)]).tolist()
    return x, y, yaw


def without_odometry(**changes: float) -> list[Message]:
    return Drive(with_odometry=False, **changes).messages()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("good", "bad", "said"),
    [
        ("/odometry/filtered", source("/odometry/gps", gps, child="", step=0.2), "/odometry/gps (it zigzags"),
        ("/odometry/filtered", source("/odometry/gps", smooth_gps, child=""), "orientation never turns"),
        ("/wheel/odometry", source("/odom_map", drives.pose, frame="map"), "told in 'map', the map's own frame"),
        ("/wheels/ticks", source("/odom", camera, "cam_odom", "cam_link"), "zigzags by"),
        ("/wheels/ticks", source("/odom", drives.odom, "cam_odom", "cam_link"), "no transform joins its frame"),
        ("/wheels/ticks", source("/odom", lambda _: (1.0, 2.0, 0.3)), "stands still, although"),
    ],
    ids=["noisy positions", "positions", "on the map", "noise", "another frame", "frozen"],
)
def test_a_source_that_cannot_be_right_is_passed_over_with_the_reason(good: str, bad: list[Message], said: str) -> None:
    roles = assign(surveyed(Drive(with_odometry=False, with_tf=False).messages(), source(good, drives.odom), bad))
    assert roles.odometry == good
    assert said in roles.reasons["odometry"]
    assert roles.doubts == ()


def test_a_frozen_topic_beside_good_transforms() -> None:
    log = surveyed(without_odometry(), source("/odom", lambda _: (0.0, 0.0, 0.0)))
    roles = assign(log)
    assert roles.odometry == "tf"
    assert "/odom (its pose stands still, although the transform of the base moves)" in roles.reasons["odometry"]
    (doubt,) = assign(log, RequestedRoles(odometry="/odom")).doubts
    assert doubt.startswith("/odom: its pose stands still")
    assert doubt.endswith("tf has no such fault (--odom tf)")


@pytest.mark.parametrize(
    ("speed", "said"), [(0.5, "its own twist says that the robot drives"), (0.0, "/scan sees changes")]
)
def test_what_is_used_for_want_of_better_is_told(speed: float, said: str) -> None:
    roles = assign(surveyed(Drive(with_tf=False, odom=lambda _: (0.0, 0.0, 0.0), speed=speed).messages()))
    assert roles.odometry == "/odom"
    (doubt,) = roles.doubts
    assert said in doubt
    assert "the log has no better source" in doubt


def test_odometry_that_freezes_at_some_moment_is_told_with_the_moment() -> None:
    log = Drive(seconds=30.0, with_tf=False, odom=lambda t: drives.odom(min(t, 8.0))).messages()
    (doubt,) = assign(surveyed(log)).doubts
    assert "stands still for 2" in doubt
    assert "from stamp" in doubt


def test_a_robot_that_rests_or_drives_straight_ahead_is_not_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    straight = every(
        0.05, SECONDS, lambda t: at(t, "/odom", ODOMETRY, drives.odometry(t, (0.5 * t, 0.0, 0.0), speed=0.5))
    )
    assert assign(surveyed(Drive(with_odometry=False, with_tf=False).messages(), straight)).doubts == ()
    monkeypatch.setattr(drives, "pose", lambda _: (4.0, 2.0, 0.1))
    resting = Drive(odom=lambda _: (0.0, 0.0, 0.0)).messages()
    assert assign(surveyed(resting)).doubts == ()


@pytest.mark.parametrize("rate", [1.0, 0.1, 0.02])
def test_an_ordinary_drive_is_not_doubted_at_any_rate(rate: float) -> None:
    log = surveyed(Drive(with_odometry=False, with_tf=False).messages(), source("/odom", drives.odom, step=rate))
    assert assign(log).doubts == ()


def drifting(t: float) -> Pose:
    x, y, yaw = se2.compose(drives.odom(t), [0.09 * t, 0.0, 0.05 * t]).tolist()
    return x, y, yaw


def second_broadcaster(parent: str) -> list[Message]:
    def drifted(t: float) -> Message:
        return at(t + 0.02, "/tf", TF, drives.transform(t + 0.02, parent, "base_link", drifting(t)))

    return every(0.05, SECONDS, drifted)


def test_two_nodes_on_one_edge_are_told() -> None:
    log = surveyed(Drive().messages(), second_broadcaster("odom"))
    assert assign(log).odometry == "/odom"
    (problem,) = problems_of(log, find_robots(log))
    assert "transform from 'odom' to 'base_link'" in problem
    assert "two nodes broadcast it" in problem
    (doubt,) = assign(log, RequestedRoles(odometry="tf")).doubts
    assert "two nodes broadcast it" in doubt
    assert doubt.endswith("/odom has no such fault (--odom /odom)")


def test_of_two_parents_the_frame_of_odometry_counts_and_it_is_told() -> None:
    log = surveyed(Drive().messages(), second_broadcaster("odom_combined"))
    (problem,) = problems_of(log, find_robots(log))
    assert "two nodes state 'base_link', below 'odom' and 'odom_combined' by turns" in problem
    roles = assign(log, RequestedRoles(odometry="tf"))
    assert (roles.odom_frame, roles.frames.parent("base_link")) == ("odom", "odom")
    assert any("below 'odom' is used" in doubt for doubt in roles.doubts)
    chosen = assign(log, RequestedRoles(odometry="tf", odom_frame="odom_combined"))
    assert (chosen.odom_frame, chosen.frames.parent("base_link")) == ("odom_combined", "odom_combined")


def test_a_mount_that_trembles_is_fixed_and_one_that_pans_is_not() -> None:
    log = [message for message in Drive().messages() if message.topic != "/tf_static"]

    def pan(by: float) -> list[Message]:
        def turned(t: float) -> Message:
            mount = 0.1, 0.0, by * math.sin(t)
            return at(t, "/tf", TF, drives.transform(t, "base_link", "laser", mount))

        return every(0.05, SECONDS, turned)

    assert not assign(surveyed(log, pan(1e-5))).frames.moves_between("base_link", "laser")
    assert assign(surveyed(log, pan(0.5))).frames.moves_between("base_link", "laser")


def test_a_wheel_that_turns_is_no_second_broadcaster() -> None:
    def spun(t: float) -> Message:
        return at(t, "/tf", TF, drives.transform(t, "base_link", "wheel", (0.0, 0.2, math.remainder(31.0 * t, 6.28))))

    log = surveyed(Drive().messages(), every(0.05, SECONDS, spun))
    assert problems_of(log, find_robots(log)) == []
    assert assign(log).doubts == ()
