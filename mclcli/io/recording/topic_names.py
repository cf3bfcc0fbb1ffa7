"""Names of topics and frames as a robot's parameters have them, found again in a log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.io.recording.kinds import MAP, SCAN
from mclcli.records import Odometry

if TYPE_CHECKING:
    from mclcli.io.recording.survey import LogSurvey

_TYPES = {"scan_topic": SCAN, "map_topic": MAP}
_PLACEHOLDER = "<robot_namespace>"  # nav2's launch files put the robot's namespace there


def find(survey: LogSurvey, parameter: str, name: str, namespace: str = "") -> str:
    """The topic or frame of a log that ``scan_topic``, ``map_topic``, ``base_frame_id`` or ``odom_frame_id`` means.

    Names are relative to the robot's namespace; whether the log was recorded with it is not known, so both are tried,
    and at last the only topic of the type that ends so. Empty if there is none.
    """
    plain = name.replace(_PLACEHOLDER, namespace).strip("/")
    spellings = [f"{namespace.strip('/')}/{plain}".strip("/"), plain]
    if parameter in _TYPES:
        return _find_topic(survey, _TYPES[parameter], spellings, absolute=name.startswith("/"))
    known = _frames(survey) if parameter == "base_frame_id" else _odometry_frames(survey)
    return next((frame for frame in reversed(spellings) if frame in known), "")


def _find_topic(survey: LogSurvey, types: tuple[str, ...], spellings: list[str], *, absolute: bool) -> str:
    topics = {topic.channel.topic.strip("/"): topic.channel.topic for topic in survey.of_type(*types)}
    for spelling in reversed(spellings) if absolute else spellings:
        if spelling in topics:
            return topics[spelling]
    ending = [topic for topic in topics.values() if topic.endswith(f"/{spellings[-1]}")]
    return ending[0] if len(ending) == 1 else ""


def _odometry(survey: LogSurvey) -> list[Odometry]:
    return [topic.sample for topic in survey.topics.values() if isinstance(topic.sample, Odometry)]


def _frames(survey: LogSurvey) -> set[str]:
    return {*survey.frames.frames, *(frame for o in _odometry(survey) for frame in (o.frame_id, o.child_frame_id))}


def _odometry_frames(survey: LogSurvey) -> set[str]:
    """Frames that odometry is told in, or could be: those above a moving frame."""
    tree = survey.frames
    above = {tree.parent(frame) or "" for frame in tree.frames if tree.moves(frame)}
    return {*(o.frame_id for o in _odometry(survey)), *above} - {""}
