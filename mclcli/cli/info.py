"""``mcl info``: what a log holds."""

from __future__ import annotations

import dataclasses
import datetime as dt
import json
import shlex
import sys
from typing import TYPE_CHECKING, Any, final

import click

from mclcli.cli import completion, console, info_lidars, options
from mclcli.errors import AmbiguousRobotError, ExitCode
from mclcli.text import clean, counted

if TYPE_CHECKING:
    from mclcli.io.recording.diagnosis import Diagnosis
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.robots import Robot
    from mclcli.io.recording.roles import Roles
    from mclcli.io.recording.sampling import SampledLog
    from mclcli.io.recording.survey import LogSurvey, TopicSurvey


@final
@dataclasses.dataclass(frozen=True, slots=True)
class InfoOptions:
    """What ``mcl info`` is asked for."""

    logs: tuple[str, ...]
    as_json: bool
    deep: bool


@click.command("info", short_help="What a log holds, which topic plays which part, and how to run it.")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, shell_complete=completion.files)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@click.option("--deep", is_flag=True, help="Read a log above 1 GiB whole, and verify every checksum in it.")
@options.common
@options.into(InfoOptions)
def command(info: InfoOptions) -> ExitCode:
    """Show which topic plays which part and why, counts, rates, laser geometry, frames, and the `mcl run` line.

    It also says what is wrong: files not closed, damage, gaps, jumps of time, odd stamps, frames that do not connect.
    Of indexed MCAP above 1 GiB it reads the index and a sample of the chunks.
    """
    from mclcli.io.logs import open_log
    from mclcli.io.recording import roles, sampling
    from mclcli.io.recording.diagnosis import Diagnosis
    from mclcli.io.recording.recording import Recording

    stdin, diagnosis = sys.stdin.buffer if "-" in info.logs else None, Diagnosis()
    log = open_log(info.logs, stdin=stdin)
    sampled = None if info.deep else sampling.sample(log, diagnosis)
    recording = sampled or Recording(log, whole=True, diagnosis=diagnosis, watch=console.look)
    try:
        parts = roles.assign(recording.survey)
    except AmbiguousRobotError as error:
        parts = roles.assign(recording.survey, roles.RequestedRoles(robot=error.names[0]))
    facts = describe(recording, diagnosis, parts, info.logs)
    click.echo(json.dumps(facts, indent=2) if info.as_json else "\n".join(_lines(facts)))
    return ExitCode.DAMAGED if recording.tally.lossy else ExitCode.COMPLETE


def describe(
    recording: Recording | SampledLog, diagnosis: Diagnosis, parts: Roles, logs: tuple[str, ...]
) -> dict[str, Any]:
    """Everything ``mcl info`` knows, as plain values."""
    from mclcli.io.recording.robots import find_robots
    from mclcli.io.recording.unusable import obstacles

    span, clocks = recording.survey.span_ns, recording.clocks
    lidars = [info_lidars.facts_of(recording, parts, topic) for topic in parts.scan]
    topics = [recording.survey.topics[name] for name in sorted(recording.survey.topics)]
    frames = _named_frames(recording.survey)
    tree = parts.frames if parts.robot else recording.survey.frames
    cannot_run = obstacles(recording.survey, parts.scan, parts.vision, parts.odometry)
    facts = {
        "files": list(recording.log.names),
        "start": None if span is None else clocks.first_ns * 1e-9,
        "start_utc": None if span is None or clocks.simulated else _utc(clocks.first_ns),
        "duration": None if span is None else (span[1] - span[0]) * 1e-9,
        "clocks": {"log_time_minus_stamp": clocks.offset_ns * 1e-9, "said": clocks.describe()},
        "messages": sum(topic.count for topic in topics),
        "checks": [dataclasses.asdict(file) for file in recording.tally.files],
        "topics": [_topic(recording.survey, topic, parts, diagnosis) for topic in topics],
        "robots": [_robot(robot) for robot in find_robots(recording.survey)],
        "roles": {
            "robot": parts.robot,
            "scan": list(parts.scan),
            "odometry": parts.odometry,
            "vision": list(parts.vision),
            "truth": parts.truth,
            "map": parts.map,
            "base_frame": parts.base_frame if parts.base_frame in frames else None,
            "odom_frame": parts.odom_frame if parts.odom_frame in frames else None,
            "reasons": parts.reasons,
        },
        "lidars": lidars,
        "frames": {frame: tree.parent(frame) for frame in tree.frames},
        "damage": [damage.describe(clocks.first_logged_ns if span else None) for damage in recording.tally.damages],
        "problems": [
            *_apart(recording),
            *diagnosis.problems(clocks),
            *_noted(recording),
            *_odd(recording, parts, lidars),
        ],
        "run": None if cannot_run else _run_line(recording.survey, parts, lidars, logs),
        "cannot_run": cannot_run,
    }
    return {name: _plain(value) for name, value in facts.items()}


def _robot(robot: Robot) -> dict[str, Any]:
    return {
        "name": robot.name,
        "base_frame": robot.base or None,
        "scan": list(robot.scans),
        "vision": list(robot.vision),
        "odometry": [*robot.odometry, *(["tf"] if robot.moves else [])],
        "complete": robot.is_complete,
    }


def _apart(recording: Recording | SampledLog) -> list[str]:
    """Logs that do not follow one another."""
    from mclcli.io.logs.spans import strands

    return [f"{clean(strand.why)}: run as a segment of its own" for strand in strands(recording.tally.spans)[1:]]


def _named_frames(survey: LogSurvey) -> set[str]:
    """Frames that the log itself names, in transforms or in odometry."""
    from mclcli.records import Odometry

    samples = [topic.sample for topic in survey.topics.values() if isinstance(topic.sample, Odometry)]
    return {*survey.frames.frames, *(frame for o in samples for frame in (o.frame_id, o.child_frame_id) if frame)}


def _noted(recording: Recording | SampledLog) -> list[str]:
    """What was changed or left out in the messages that were decoded, beside what the times and lidars tell."""
    from mclcli.io.messages.conversion import STAMP_ZERO
    from mclcli.io.messages.decoding import ANGLE_MAX

    return [
        f"{clean(topic)}: {what}{f' ({count} times)' * (count > 1)}"
        for topic, notes in sorted(recording.survey.tally.notes.items())
        for what, count in notes.items()
        if what not in {STAMP_ZERO, ANGLE_MAX}
    ]


def _odd(recording: Recording | SampledLog, parts: Roles, lidars: list[dict[str, Any]]) -> list[str]:
    """Frames that do not connect or contradict each other, doubtful odometry, lidars that are not on the base."""
    from mclcli.io.recording.diagnosis import loose_frames
    from mclcli.io.recording.odometry_sources import problems_of
    from mclcli.io.recording.robots import find_robots

    tree = parts.frames if parts.robot else recording.survey.frames
    named, robots = _named_frames(recording.survey), find_robots(recording.survey)
    others = [robot.base for robot in robots if robot.base and not tree.connected(robot.base, parts.base_frame)]
    lines = [
        *loose_frames(tree, others),
        *problems_of(recording.survey, robots),
        *(f"odometry: {line}" for line in parts.doubts),
    ]
    for lidar in lidars:
        name, frame = clean(lidar["topic"]), clean(lidar["frame"])
        if lidar["base_from_sensor"] is None:
            base = f"from '{clean(parts.base_frame)}' " if parts.base_frame in named else ""
            known = "" if tree.frames else "the log has no transforms: "
            lines.append(f"{name}: {known}no transform {base}to '{frame}'; --mount says where the lidar sits")
        lines += [f"{name}: {what}" for what in lidar["odd"]]
    return lines


def _utc(stamp_ns: int) -> str | None:
    try:
        return dt.datetime.fromtimestamp(stamp_ns * 1e-9, dt.UTC).isoformat(timespec="milliseconds")
    except (OverflowError, ValueError, OSError):
        return None


def _topic(survey: LogSurvey, topic: TopicSurvey, parts: Roles, diagnosis: Diagnosis) -> dict[str, Any]:
    from mclcli.io.recording.unusable import problem

    name = topic.channel.topic
    times = diagnosis.times(name)
    role = next((role for role in ("odometry", "truth", "map") if getattr(parts, role) == name), "")
    role = "scan" if name in parts.scan else "vision" if name in parts.vision else role
    return {
        "topic": name,
        "type": topic.channel.type,
        "messages": topic.count,
        "rate": topic.rate,
        "interval": times.interval,
        "longest_gap": topic.longest_gap_ns * 1e-9,
        "gaps": len(times.gaps),
        "time_jumps": len(times.jumps) or len(times.stamp_jumps),
        "log_time_minus_stamp": times.lag,
        "not_stamped": times.zero_stamps,
        "role": role,
        "why": parts.reasons.get(role, ""),
        "problem": problem(survey, topic) or topic.problem,
    }


def _run_line(survey: LogSurvey, parts: Roles, lidars: list[dict[str, Any]], logs: tuple[str, ...]) -> str:
    """The command that runs this log, with everything said that has to be; what only the user knows in capitals."""
    from mclcli.io.recording import roles

    words = ["mcl", "run", *logs]
    if parts.robot and "robot" not in parts.reasons:
        words += ["--robot", parts.robot]
    if not parts.map and parts.scan:
        words += ["--map", "MAP.yaml"]
    if parts.vision:
        words += ["--landmarks", "LANDMARKS.csv"]
    for frame in dict.fromkeys(lidar["frame"] for lidar in lidars if lidar["base_from_sensor"] is None):
        words += ["--mount", f"{frame}=X,Y,YAW"]
    start = roles.initialpose(survey, parts.namespace) or parts.truth or "X,Y,YAW"
    words += ["--init", start, "--track", "track.csv", "--picture", "track.png"]
    if parts.truth:
        words += ["--truth", parts.truth]
    return shlex.join(words)


def _lines(facts: dict[str, Any]) -> list[str]:
    """The facts for people."""
    names = ", ".join(clean(name) for name in facts["files"])
    duration = facts["duration"]
    at = f"@{facts['start']:.9f}" if duration is not None else ""
    since = f"{facts['start_utc']} ({at})" if facts["start_utc"] else at
    when = "" if duration is None else f", {duration:.1f} s from {since}"
    lines = [f"{names}: {counted(facts['messages'], 'message')} on {counted(len(facts['topics']), 'topic')}{when}"]
    lines += [_check_line(file) for file in facts["checks"]]
    lines.append("")
    lines += _table([_row(topic) for topic in facts["topics"]])
    robots, roles = facts["robots"], facts["roles"]
    if len(robots) > 1:
        lines += ["", *(_robot_line(robot) for robot in robots), f"what follows is of robot {clean(roles['robot'])}"]
    for lidar in facts["lidars"]:
        lines += ["", info_lidars.line_of(lidar)]
    lines += ["", *_tree(facts["frames"], roles, facts["lidars"])]
    lines.append(_odometry_line(roles))
    lines += [f"clocks: {facts['clocks']['said']}"] * bool(facts["clocks"]["said"])
    lines += [f"damage: {clean(text, 300)}" for text in facts["damage"]]
    lines += [f"problem: {clean(text, 300)}" for text in facts["problems"]]
    lines += [f"cannot be run: {clean(text, 1000)}" for text in facts["cannot_run"]]
    return [*lines, "", clean(facts["run"], 1000)] if facts["run"] else lines


def _robot_line(robot: dict[str, Any]) -> str:
    """One robot of several."""
    parts = [*robot["scan"], *robot["vision"], *robot["odometry"]]
    lacking = "" if robot["complete"] else "; nothing tells its odometry"
    return f"robot {clean(robot['name'])}: {', '.join(map(clean, parts))}{lacking} (--robot {clean(robot['name'])})"


def _check_line(file: dict[str, Any]) -> str:
    """What one file is."""
    closed = "closed" if file["closed"] else "not closed"
    return f"{clean(file['source'])}: {file['kind']}, {closed}, checksums: {file['checksums']}"


def _row(topic: dict[str, Any]) -> tuple[str, ...]:
    rate = "" if topic["rate"] is None else f"{topic['rate']:.1f} Hz"
    gap = f"gap {topic['longest_gap']:.1f} s" if topic["longest_gap"] > 1.0 else ""
    note = "; ".join(clean(text) for text in (topic["role"], topic["why"], topic["problem"]) if text)
    return clean(topic["topic"]), clean(topic["type"]), str(topic["messages"]), rate, gap, note


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    header = ("topic", "type", "messages", "rate", "longest gap", "role")
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (header, *rows)
    ]


def _odometry_line(roles: dict[str, Any]) -> str:
    """What odometry is used, between which frames; a frame that the log does not name is none of its own."""
    if not roles["odometry"]:
        return "odometry: none"
    odom, base = (
        clean(roles[name]) if roles[name] else "a frame without a name" for name in ("odom_frame", "base_frame")
    )
    return f"odometry: {clean(roles['odometry'])} ({odom} to {base})"


def _plain(value: Any) -> Any:
    """Facts with numbers as they were meant: no digits beyond the ninth behind the point, no minus before a zero."""
    if isinstance(value, float):
        return round(value, 9) + 0.0
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def _tree(parents: dict[str, str | None], roles: dict[str, Any], lidars: list[dict[str, Any]]) -> list[str]:
    """How the frames that matter hang together, root first."""
    if not parents:
        return ["frames: the log has no transforms"]
    ends = [end for end in (*(lidar["frame"] for lidar in lidars), roles["base_frame"]) if end in parents]
    ends = [*dict.fromkeys(ends[: max(len(lidars), 1)])] or sorted(parents)[:1]
    lines = [f"frames: {' > '.join(clean(frame) for frame in reversed(_chain(parents, end)))}" for end in ends]
    lines[0] += f" ({len(parents)} in all)"
    return lines


def _chain(parents: dict[str, str | None], frame: str) -> list[str]:
    chain = [frame]
    while (parent := parents.get(chain[-1])) is not None and parent not in chain:
        chain.append(parent)
    return chain
