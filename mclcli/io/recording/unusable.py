"""Topics that look like what a run needs and cannot be used, each with the reason; and why a log cannot be run.

That a log has none of something is said only where no topic looks like it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal

from mclcli.io.messages.decoding import DECODABLE, NOT_RIGID
from mclcli.io.recording import cameras
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from mclcli.io.logs.base import Channel
    from mclcli.io.recording.survey import LogSurvey, TopicSurvey

Part = Literal["scan", "odometry", "map", "vision", "transforms"]

_CLOUD = "cut a sensor_msgs/LaserScan out of it, as pointcloud_to_laserscan does"
_LASER = "convert it to sensor_msgs/LaserScan"
_ODOMETRY = "convert it to nav_msgs/Odometry"
_TF = "convert it to tf2_msgs/TFMessage"
_MAP = "convert it to nav_msgs/OccupancyGrid, or name a map with --map"
_LOOKS: dict[Part, dict[str, str]] = {
    "scan": {
        "LaserScan": _LASER,
        "MultiEchoLaserScan": "keep one echo of each beam in a sensor_msgs/LaserScan, as laser_proc does",
        "PointCloud2": _CLOUD,
        "PointCloud": _CLOUD,
        "CustomMsg": _CLOUD,  # Livox
        "VelodyneScan": _CLOUD,
        "PacketMsg": _CLOUD,  # Ouster
    },
    "odometry": {
        "Odometry": _ODOMETRY,
        "PoseInFrame": _ODOMETRY,
        "PosesInFrame": _ODOMETRY,
        "TFMessage": _TF,
        "tfMessage": _TF,
        "FrameTransform": _TF,
        "FrameTransforms": _TF,
    },
    "map": {"OccupancyGrid": _MAP, "Grid": _MAP, "VoxelGrid": _MAP, "GridMap": _MAP, "Costmap": _MAP},
    "vision": {
        kind.rpartition("/")[2]: "its ids and poses are needed as a type that mcl reads"
        for kind in (*cameras.PIXELS, *cameras.RAYS)
    },
    "transforms": {"TFMessage": _TF, "tfMessage": _TF, "FrameTransform": _TF, "FrameTransforms": _TF},
}
"""What may play a part, by the last word of its type, and what would help where mcl does not read the type."""
_TOLD = 5  # reasons for one part
_LATE_NS = 1_000_000_000  # by which messages may be recorded later than they were stamped


def problem(survey: LogSurvey, topic: TopicSurvey) -> str:
    """Why nothing of a topic can be used, empty if something can, or if it looks like nothing that is needed."""
    if topic.sample is None:
        return topic.problem or _unread(topic.channel)
    rigid = topic.sample != () or NOT_RIGID not in survey.tally.notes.get(topic.channel.topic, {})
    return "" if rigid else "none of its transforms is rigid: quaternions not of length 1, or no finite translations"


def _unread(channel: Channel) -> str:
    """Why messages were not even tried; empty if they look like nothing that is needed."""
    if not channel.type:
        return "it has no schema, so nothing says its type; a metadata.yaml beside the log may"
    cure = next((cures[last] for cures in _LOOKS.values() if (last := _last_word(channel)) in cures), "")
    if not cure:
        return ""
    if channel.encoding not in {"cdr", "ros1"}:
        return f"mcl reads messages of ROS, not {channel.encoding[:40] or 'of an unnamed encoding'}; {cure}"
    return f"mcl does not read this type; {cure}" if channel.type not in DECODABLE else "no message of it was read"


def told(survey: LogSurvey, part: Part, only: Collection[str] = ()) -> list[str]:
    """A sentence for each reason why topics that look like a part cannot play it, those alike together.

    Of some types ``only``, and then only of those with messages; or of all.
    """
    reasons: dict[tuple[str, str], list[str]] = {}
    for name, topic in sorted(survey.topics.items()):
        if only and topic.channel.type not in only:
            continue
        if (not topic.channel.type or _last_word(topic.channel) in _LOOKS[part]) and (why := problem(survey, topic)):
            reasons.setdefault((topic.channel.type, why), []).append(name)
    for name, channel in sorted(survey.silent.items()):
        if not only and _last_word(channel) in _LOOKS[part]:
            reasons.setdefault((channel.type, "it has no message"), []).append(name)
    return [_sentence(names, kind, why) for (kind, why), names in reasons.items()][:_TOLD]


def refused(survey: LogSurvey) -> list[str]:
    """Sentences about scans, odometry and transforms of which nothing can be used, although mcl reads their type."""
    return [*told(survey, "scan", only=DECODABLE), *told(survey, "odometry", only=DECODABLE)]


def because(survey: LogSurvey, part: Part) -> str:
    """The sentences of ``told`` behind a semicolon, to follow what is missing; empty if there are none."""
    return "".join(f"; {sentence}" for sentence in told(survey, part))


def no_odometry(survey: LogSurvey) -> str:
    """Why there is no odometry."""
    passed_over = [topic.channel.topic for topic in survey.of_type("nav_msgs/msg/Odometry")]
    sentences = told(survey, "odometry")
    if passed_over:
        names = _names(passed_over)
        sentences.insert(0, f"{names} is not taken for odometry; --odom {clean(passed_over[0])} takes it all the same")
    if sentences:
        return f"no odometry can be used: {'; '.join(sentences)}"
    return "the log has no odometry: no nav_msgs/Odometry topic, and no moving transform above the base"


def no_scan(survey: LogSurvey) -> str:
    """Why there is neither a laser scan nor a landmark."""
    sentences = [*told(survey, "scan"), *(s for s in told(survey, "vision") if s not in told(survey, "scan"))]
    if sentences:
        return f"no laser scan can be used: {'; '.join(sentences)}"
    types = sorted({clean(topic.channel.type, 60) for topic in survey.topics.values()})
    return f"the log has no laser scan; it holds {', '.join(types) or 'no message at all'}"


def no_map(survey: LogSurvey) -> str:
    """Why the log has no map."""
    passed_over = [topic.channel.topic for topic in survey.of_type("nav_msgs/msg/OccupancyGrid")]
    sentences = told(survey, "map")
    if passed_over:
        use = f"--set map_topic={clean(passed_over[0])} takes it all the same"
        sentences.insert(0, f"{_names(passed_over)} is not taken for the map; {use}")
    return f"no map: {'; '.join(sentences) or 'the log has no nav_msgs/OccupancyGrid'}; name one with --map"


def obstacles(survey: LogSurvey, scan: Sequence[str], vision: Sequence[str], odometry: str) -> list[str]:
    """Why a log cannot be run with these topics, whatever map, landmarks and mounts are given; empty if it can."""
    reasons = []
    if not scan and not vision:
        reasons.append(no_scan(survey))
    elif not scan and all(cameras.is_without_calibration(survey, topic) for topic in vision):
        names = _names(vision)
        reasons.append(f"no sensor can be used: {names} tells pixels, and no sensor_msgs/CameraInfo of that camera")
    if not odometry:
        reasons.append(no_odometry(survey))
    elif odometry in survey.topics and survey.complete and (scan or vision):
        reasons += _apart(survey.topics[odometry], [survey.topics[name] for name in scan or vision])
    return reasons


def _apart(odometry: TopicSurvey, sensors: list[TopicSurvey]) -> list[str]:
    """That odometry cannot be interpolated where a sensor measured, by their log times."""
    name = clean(odometry.channel.topic)
    if odometry.count == 1:
        return [f"odometry {name} has one message: nothing lies between two"]
    names = _names([sensor.channel.topic for sensor in sensors])
    if all(sensor.first_ns > odometry.last_ns + _LATE_NS for sensor in sensors):
        return [f"odometry {name} ends before the first message of {names}"]
    if all(sensor.last_ns < odometry.first_ns - _LATE_NS for sensor in sensors):
        return [f"odometry {name} begins after the last message of {names}"]
    return []


def _sentence(names: list[str], kind: str, why: str) -> str:
    of = f" of type {clean(kind, 100)}" if kind else ""
    return f"{_names(names)}{of} cannot be used: {clean(why, 400)}"


def _names(names: Sequence[str]) -> str:
    listed = [clean(name, 100) for name in names]
    more = f" and {len(listed) - _TOLD} more" if len(listed) > _TOLD else ""
    return ", ".join(listed[:_TOLD]) + more


def _last_word(channel: Channel) -> str:
    """Name of a type without its package, however the two are joined."""
    return re.split(r"[/.:]+", channel.type)[-1].removesuffix("_")
