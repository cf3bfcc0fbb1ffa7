"""Which of a robot's lidars to use where one is enough: the one that sees most of what lies ahead."""

from __future__ import annotations

import difflib
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mclcli.records import LaserScan

if TYPE_CHECKING:
    from mclcli.io.recording.robots import Robot
    from mclcli.io.recording.survey import LogSurvey

_STEP = 10  # [deg] fields of view that differ by less are alike
_RANGE = 5.0  # [m] the same for how far they see
_FAR = 30.0  # [m] farther does not matter indoors


class _View(NamedTuple):
    """What speaks for a lidar, the most important thing first; less is better."""

    unmounted: bool
    seldom: bool
    ahead: int
    around: int
    reach: int
    likeness: float
    length: int
    name: str


def by_view(survey: LogSurvey, robot: Robot) -> tuple[list[str], str]:
    """A robot's lidars, the one that sees most ahead first, and why that is the first."""
    if len(robot.scans) == 1:
        return [*robot.scans], "the only laser scan topic"
    views = sorted(_view(survey, robot, name) for name in robot.scans)
    names = [view.name for view in views]
    others = ", ".join(names[1:])
    if views[0][:5] == views[1][:5]:
        return names, f"of the laser scan topics nearest to 'scan'; not {others}"
    if views[0][:2] != views[1][:2]:
        what = "whose place on the base is known" if views[1].unmounted else "that is recorded most of the time"
        return names, f"the laser scan topic {what}; not {others}"
    return names, f"the laser scan topic that sees most ahead ({-views[0].ahead * _STEP} of 180 deg); not {others}"


def _view(survey: LogSurvey, robot: Robot, name: str) -> _View:
    topic = survey.topics[name]
    scan = topic.sample
    assert isinstance(scan, LaserScan)  # noqa: S101 - by type
    mount = robot.frames.nominal(robot.base, scan.frame_id)
    angles = scan.angle_min + np.arange(scan.ranges.size) * scan.angle_increment
    angles = angles[np.isfinite(angles)]
    beams = np.stack([np.cos(angles), np.sin(angles)])
    x, y = beams if mount is None else mount[:2, :2] @ beams
    degrees = np.unique(np.round(np.degrees(np.arctan2(y, x))).astype(int) % 360)
    ahead = np.count_nonzero((degrees < 90) | (degrees >= 270))
    span = survey.span_ns or (0, 0)
    reach = scan.range_max if math.isfinite(scan.range_max) and scan.range_max > 0 else _FAR
    plain = name.removeprefix(robot.namespace).strip("/")
    return _View(
        mount is None,
        topic.last_ns - topic.first_ns < 0.5 * (span[1] - span[0]),
        -round(ahead / _STEP),
        -round(degrees.size / _STEP),
        -round(min(reach, _FAR) / _RANGE),
        -difflib.SequenceMatcher(None, "scan", plain).ratio(),
        len(name),
        name,
    )
