"""What ``mcl run`` says of odometry that was set back in a gap, and what it does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

from tests.battery import content
from tests.battery.bases import mcap_log
from tests.cli.support import mcl
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from pathlib import Path

STORE = STORES["cdr"]
PAUSE = 6 * 10**9


def paused(gap: float, *, reset: bool) -> tuple[content.Known, ...]:
    """The base log, paused at 6 s; meanwhile the robot stood, and odometry was set back or was not."""
    shift = round(gap * 1e9)
    origin = content.pose_at(PAUSE / 1e9)
    found = []
    for known in content.messages("cdr"):
        if known.log_ns - content.START_NS < PAUSE:
            found.append(known)
            continue
        message: Any = STORE.deserialize_cdr(known.data, content.TYPES[known.topic])
        for part in getattr(message, "transforms", [message]):
            if hasattr(part, "header"):
                stamp_ns = part.header.stamp.sec * 10**9 + part.header.stamp.nanosec + shift
                part.header.stamp.sec, part.header.stamp.nanosec = stamp_ns // 10**9, stamp_ns % 10**9
        if reset and known.topic == "/odom":
            set_back(message.pose.pose, origin)
        data = bytes(STORE.serialize_cdr(message, content.TYPES[known.topic]))
        found.append(known._replace(log_ns=known.log_ns + shift, data=data))
    return tuple(found)


def set_back(pose: Any, origin: tuple[float, float, float]) -> None:
    x, y = pose.position.x - origin[0], pose.position.y - origin[1]
    cos, sin = math.cos(origin[2]), math.sin(origin[2])
    pose.position.x, pose.position.y = cos * x + sin * y, cos * y - sin * x
    yaw = 2 * math.atan2(pose.orientation.z, pose.orientation.w) - origin[2]
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def run(folder: Path, gap: float, *words: object, reset: bool = True) -> Any:
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    (folder / "x.mcap").write_bytes(mcap_log("cdr", paused(gap, reset=reset)))
    known = ("--map", folder / "room.yaml", "--init", content.INIT, "--particles", 200, "--odom", "/odom")
    return mcl("run", folder / "x.mcap", *known, "--track", "-", *words)


@pytest.mark.parametrize("gap", [1.5, 60.0, 86_400.0])
def test_the_summary_says_when_and_how_far_and_what_was_done(tmp_path: Path, gap: float) -> None:
    told = run(tmp_path, gap)
    line = f"odometry /odom jumps by 1.5 m in a gap of {gap + 0.1:.1f} s at 5.9 s of the log (reset)"
    went_on = "; the filter went on from where it was (--init global or --recovery locate search again)"
    assert line + went_on in told.err
    assert told.err.count("jumps") == 1
    assert "interpolated" not in told.err
    assert "updates over 11.6 s" in told.err  # of both segments, without the gap
    assert set(told.table["segment"]) == {0.0, 1.0}
    last = content.pose_at(told.table["stamp"][-1] - content.START_NS / 1e9 - gap)
    assert math.dist((told.table["x"][-1], told.table["y"][-1]), last[:2]) < 0.2


def test_a_robot_that_stood_through_a_pause_draws_no_remark(tmp_path: Path) -> None:
    told = run(tmp_path, 60.0, reset=False)
    assert "jump" not in told.err
    assert "reset" not in told.err
    assert set(told.table["segment"]) == {0.0}


def test_recovery_searches_where_what_is_seen_does_not_fit(tmp_path: Path) -> None:
    """A robot that was not carried is not searched for."""
    told = run(tmp_path, 60.0, "--recovery", "locate")
    assert "; the filter went on from where it was\n" in told.err
