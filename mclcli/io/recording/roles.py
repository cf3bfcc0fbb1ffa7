"""Which topic plays which part, by type, frames and names, and why."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.errors import InputError, UsageError, nearest_name
from mclcli.io.recording import cameras
from mclcli.io.recording.unusable import problem
from mclcli.records import Odometry

if TYPE_CHECKING:
    from mclcli.io.recording.survey import LogSurvey, TopicSurvey

SCAN = ("sensor_msgs/msg/LaserScan",)
ODOMETRY = ("nav_msgs/msg/Odometry",)
SIGHTINGS = (*cameras.RAYS, *cameras.PIXELS)
POSES = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
MAP = ("nav_msgs/msg/OccupancyGrid",)
TF = "tf"

_TRUTH = re.compile(r"truth|(^|[/_])gt([/_]|$)|mocap|vicon|optitrack", re.IGNORECASE)


@final
@dataclass(frozen=True, slots=True)
class Roles:
    """Who does what in a log. Topics are empty where nobody plays the part; ``reasons`` says why, role by role.

    ``odometry`` is a topic or ``tf``; ``odom_frame`` and ``base_frame`` are the ends of the odometry used.
    """

    scan: tuple[str, ...] = ()
    odometry: str = ""
    vision: tuple[str, ...] = ()
    truth: str = ""
    map: str = ""
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    reasons: dict[str, str] = field(default_factory=dict)


@final
@dataclass(frozen=True, slots=True)
class RequestedRoles:
    """What the user named; everything else is found."""

    scan: tuple[str, ...] = ()
    odometry: str = ""
    vision: tuple[str, ...] = ()
    map: str = ""
    base_frame: str = ""
    odom_frame: str = ""
    map_frame: str = "map"


def assign(survey: LogSurvey, requested: RequestedRoles = RequestedRoles()) -> Roles:
    """Give out the roles.

    Raises
    ------
    UsageError
        If a topic the user named is not in the log, or not of a type that fits.

    """
    reasons: dict[str, str] = {}
    scan = requested.scan or _nearest_to("scan", survey.of_type(*SCAN), "laser scan", reasons, "scan")
    odometry = requested.odometry or _find_odometry(survey, requested, reasons)
    vision = requested.vision or _find_vision(survey)
    named = () if odometry in {"", TF} else (odometry,)
    mapped = (requested.map,) if requested.map else ()
    for names, types in ((scan, SCAN), (vision, SIGHTINGS), (named, ODOMETRY), (mapped, MAP)):
        for name in names:
            _check(survey, name, types)
    cameras.explain(survey, vision, reasons)
    base, odom = _frames(survey, odometry, requested)
    return Roles(
        scan=scan,
        odometry=odometry,
        vision=vision,
        truth=_find_truth(survey, reasons),
        map=requested.map or _first(survey.of_type(*MAP)),
        odom_frame=odom,
        base_frame=base,
        reasons=reasons,
    )


def initialpose(survey: LogSurvey) -> str:
    """Topic on which an operator told the robot where it was, empty if there is none; the shortest of several names."""
    names = [topic.channel.topic for topic in survey.of_type("geometry_msgs/msg/PoseWithCovarianceStamped")]
    topics = sorted(name for name in names if name.rpartition("/")[2] == "initialpose")
    return min(topics, key=len, default="")


def is_truth(topic: str) -> bool:
    """Whether a topic is named like a reference: it is never used as odometry."""
    return bool(_TRUTH.search(topic))


def _nearest_to(word: str, topics: list[TopicSurvey], what: str, reasons: dict[str, str], role: str) -> tuple[str, ...]:
    """The topic whose name is most like a word; says so where there was a choice."""
    if not topics:
        return ()
    names = [topic.channel.topic for topic in topics]
    best = max(names, key=lambda name: (difflib.SequenceMatcher(None, word, name.strip("/")).ratio(), -len(name)))
    others = [name for name in names if name != best]
    reasons[role] = (
        f"the only {what} topic" if not others else f"of the {what} topics nearest to '{word}'; not {', '.join(others)}"
    )
    return (best,)


def _find_odometry(survey: LogSurvey, requested: RequestedRoles, reasons: dict[str, str]) -> str:
    topics = [topic for topic in survey.of_type(*ODOMETRY) if not is_truth(topic.channel.topic)]
    if topics:
        return _nearest_to("odom", topics, "odometry", reasons, "odometry")[0]
    base = _base_frame(survey, requested, None)
    if _odom_ancestor(survey, base, requested):
        reasons["odometry"] = "transforms above the base (no odometry topic)"
        return TF
    return ""


def _find_vision(survey: LogSurvey) -> tuple[str, ...]:
    """Every topic with landmarks; last those whose camera is not known: the first one may have to trigger updates."""
    names = [topic.channel.topic for topic in survey.of_type(*SIGHTINGS)]
    return tuple(sorted(names, key=lambda name: cameras.is_without_calibration(survey, name)))


def _find_truth(survey: LogSurvey, reasons: dict[str, str]) -> str:
    named = [t for t in survey.of_type(*POSES, *ODOMETRY) if is_truth(t.channel.topic)]
    if named:
        reasons["truth"] = "named like a reference; never an input"
    return _first(named)


def _first(topics: list[TopicSurvey]) -> str:
    return topics[0].channel.topic if topics else ""


def _check(survey: LogSurvey, name: str, types: tuple[str, ...]) -> None:
    topic = survey.topics.get(name)
    if topic is None:
        names = ", ".join(sorted(survey.topics)) or "none"
        raise UsageError(f"no topic '{name}' in the log{nearest_name(name, list(survey.topics))}; it has {names}")
    if topic.sample is None:
        why = problem(survey, topic) or f"mcl cannot use messages of type {topic.channel.type}"
        raise UsageError(f"topic '{name}': {why}; name another topic")
    if topic.channel.type not in types:
        hint = "give --odom another topic, or tf" if types == ODOMETRY else "name another topic"
        raise UsageError(f"topic '{name}': not of type {' or '.join(types)}; {hint}")


def _frames(survey: LogSurvey, odometry: str, requested: RequestedRoles) -> tuple[str, str]:
    sample = survey.topics[odometry].sample if odometry in survey.topics else None
    if sample is not None and not isinstance(sample, Odometry):
        raise UsageError(f"topic '{odometry}': not of type nav_msgs/msg/Odometry; give --odom another topic, or tf")
    base = _base_frame(survey, requested, sample)
    if sample is not None:
        return base, requested.odom_frame or sample.frame_id or "odom"
    return base, (_odom_ancestor(survey, base, requested) if odometry == TF else "") or "odom"


def _base_frame(survey: LogSurvey, requested: RequestedRoles, odometry: Odometry | None) -> str:
    """The frame asked for, else odometry's child, else base_link, else base_footprint."""
    frames = survey.frames.frames
    if requested.base_frame:
        return requested.base_frame
    if odometry is not None and odometry.child_frame_id:
        return odometry.child_frame_id
    return next((name for name in ("base_link", "base_footprint") if name in frames), "base_link")


def _odom_ancestor(survey: LogSurvey, base: str, requested: RequestedRoles) -> str:
    """The frame above the base that odometry is told in: ``odom``, else the highest moving one below ``map``."""
    chain = survey.frames.ancestors(base)
    if requested.odom_frame:
        if requested.odom_frame not in chain:
            raise InputError(
                f"frame '{requested.odom_frame}' is not above '{base}'; frames: {', '.join(survey.frames.frames)}"
            )
        return requested.odom_frame
    maps = {"map", "world", requested.map_frame}
    above = [p for f in chain if (p := survey.frames.parent(f)) and survey.frames.moves(f) and p not in maps]
    return next((frame for frame in above if "odom" in frame), above[-1] if above else "")
