"""``mcl info``: what a log holds."""

from __future__ import annotations

import dataclasses
import datetime as dt
import json
import shlex
import sys
from typing import TYPE_CHECKING, Any, final

import click

from mclcli.cli import options
from mclcli.errors import ExitCode
from mclcli.text import clean

if TYPE_CHECKING:
    from mclcli.io.recording.diagnosis import Diagnosis
    from mclcli.io.recording.recording import Recording
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
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
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
    recording = sampled or Recording(log, whole=True, diagnosis=diagnosis)
    parts = roles.assign(recording.survey, roles.RequestedRoles())
    facts = describe(recording, diagnosis, parts, info.logs)
    click.echo(json.dumps(facts, indent=2) if info.as_json else "\n".join(_lines(facts)))
    return ExitCode.DAMAGED if recording.tally.lossy else ExitCode.COMPLETE


def describe(
    recording: Recording | SampledLog, diagnosis: Diagnosis, parts: Roles, logs: tuple[str, ...]
) -> dict[str, Any]:
    """Everything ``mcl info`` knows, as plain values."""
    span, clocks = recording.survey.span_ns, recording.clocks
    lidars = [_lidar(recording, parts, topic) for topic in parts.scan]
    topics = [recording.survey.topics[name] for name in sorted(recording.survey.topics)]
    return {
        "files": list(recording.log.names),
        "start": None if span is None else clocks.first_ns * 1e-9,
        "start_utc": None if span is None or clocks.simulated else _utc(clocks.first_ns),
        "duration": None if span is None else (span[1] - span[0]) * 1e-9,
        "clocks": {"log_time_minus_stamp": clocks.offset_ns * 1e-9, "said": clocks.describe()},
        "messages": sum(topic.count for topic in topics),
        "checks": [dataclasses.asdict(file) for file in recording.tally.files],
        "topics": [_topic(topic, parts, diagnosis) for topic in topics],
        "roles": {
            "scan": list(parts.scan),
            "odometry": parts.odometry,
            "vision": list(parts.vision),
            "truth": parts.truth,
            "map": parts.map,
            "base_frame": parts.base_frame,
            "odom_frame": parts.odom_frame,
            "reasons": parts.reasons,
        },
        "lidars": lidars,
        "frames": {frame: recording.survey.frames.parent(frame) for frame in recording.survey.frames.frames},
        "damage": [damage.describe(clocks.first_logged_ns if span else None) for damage in recording.tally.damages],
        "problems": [*_apart(recording), *diagnosis.problems(clocks), *_loose(recording, parts, lidars)],
        "run": _run_line(recording.survey, parts, logs),
    }


def _apart(recording: Recording | SampledLog) -> list[str]:
    """Logs that do not follow one another."""
    from mclcli.io.logs.spans import strands

    return [f"{clean(strand.why)}: run as a segment of its own" for strand in strands(recording.tally.spans)[1:]]


def _loose(recording: Recording | SampledLog, parts: Roles, lidars: list[dict[str, Any]]) -> list[str]:
    """Frames that do not connect, and lidars that are not on the base."""
    from mclcli.io.recording.diagnosis import loose_frames

    unmounted = [lidar for lidar in lidars if lidar["base_from_sensor"] is None]
    return [
        *loose_frames(recording.survey.frames),
        *(
            f"{clean(lidar['topic'])}: no transform from '{clean(parts.base_frame)}' to '{clean(lidar['frame'])}'"
            for lidar in unmounted
        ),
    ]


def _utc(stamp_ns: int) -> str | None:
    try:
        return dt.datetime.fromtimestamp(stamp_ns * 1e-9, dt.UTC).isoformat(timespec="milliseconds")
    except (OverflowError, ValueError, OSError):
        return None


def _topic(topic: TopicSurvey, parts: Roles, diagnosis: Diagnosis) -> dict[str, Any]:
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
        "problem": topic.problem,
    }


def _lidar(recording: Recording | SampledLog, parts: Roles, name: str) -> dict[str, Any]:
    """Geometry of a lidar from its first scan, and where it sits."""
    import numpy as np

    from mclcli.geometry import se3
    from mclcli.records import LaserScan

    scan = recording.survey.topics[name].sample
    assert isinstance(scan, LaserScan)  # noqa: S101 - roles go by type
    mount = recording.survey.frames.lookup(parts.base_frame, scan.frame_id, scan.stamp_ns)
    finite = np.isfinite(scan.ranges)
    return {
        "topic": name,
        "frame": scan.frame_id,
        "beams": int(scan.ranges.size),
        "angle_min": scan.angle_min,
        "angle_increment": scan.angle_increment,
        "range_min": scan.range_min if np.isfinite(scan.range_min) else None,
        "range_max": scan.range_max if np.isfinite(scan.range_max) else None,
        "time_increment": scan.time_increment,
        "no_return": int(np.isinf(scan.ranges).sum()),
        "invalid": int((~finite & ~np.isinf(scan.ranges)).sum()),
        "base_from_sensor": None if mount is None else list(se3.to_rpy(mount)),
    }


def _run_line(survey: LogSurvey, parts: Roles, logs: tuple[str, ...]) -> str:
    """The command that runs this log, with everything said that has to be."""
    from mclcli.io.recording import roles

    words = ["mcl", "run", *logs]
    if not parts.map and parts.scan:
        words += ["--map", "MAP.yaml"]
    if parts.vision:
        words += ["--landmarks", "LANDMARKS.csv"]
    start = roles.initialpose(survey) or parts.truth or "X,Y,YAW"
    words += ["--init", start, "--track", "track.csv", "--picture", "track.png"]
    if parts.truth:
        words += ["--truth", parts.truth]
    return shlex.join(words)


def _lines(facts: dict[str, Any]) -> list[str]:
    """The facts for people."""
    names = ", ".join(clean(name) for name in facts["files"])
    duration = facts["duration"]
    utc = f"{facts['start_utc']} " if facts["start_utc"] else ""
    when = "" if duration is None else f", {duration:.1f} s from {utc}(@{facts['start']:.9f})"
    lines = [f"{names}: {facts['messages']} messages on {len(facts['topics'])} topics{when}"]
    lines += [_check_line(file) for file in facts["checks"]]
    lines.append("")
    lines += _table([_row(topic) for topic in facts["topics"]])
    for lidar in facts["lidars"]:
        lines += ["", _lidar_line(lidar)]
    roles = facts["roles"]
    lines += ["", *_tree(facts["frames"], roles, facts["lidars"])]
    lines.append(
        f"odometry: {clean(roles['odometry']) or 'none'} ({clean(roles['odom_frame'])} to {clean(roles['base_frame'])})"
    )
    lines += [f"clocks: {facts['clocks']['said']}"] * bool(facts["clocks"]["said"])
    lines += [f"damage: {clean(text, 300)}" for text in facts["damage"]]
    lines += [f"problem: {clean(text, 300)}" for text in facts["problems"]]
    return [*lines, "", clean(facts["run"], 1000)]


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


def _lidar_line(lidar: dict[str, Any]) -> str:
    from math import degrees

    first, step = degrees(lidar["angle_min"]), degrees(lidar["angle_increment"])
    last = first + step * max(lidar["beams"] - 1, 0)
    mount = lidar["base_from_sensor"]
    where = "nothing says where it sits on the base (--mount)"
    if mount is not None:
        x, y, z, roll, pitch, yaw = mount
        angles = f"roll {degrees(roll):.1f}, pitch {degrees(pitch):.1f}, yaw {degrees(yaw):.1f} deg"
        where = f"at x {x:.3f}, y {y:.3f}, z {z:.3f} m, {angles}"
    return (
        f"lidar {clean(lidar['topic'])} in frame {clean(lidar['frame'])}: {lidar['beams']} beams from {first:.1f} to "
        f"{last:.1f} deg, {lidar['range_min']} to {lidar['range_max']} m; {where}"
    )


def _tree(parents: dict[str, str | None], roles: dict[str, Any], lidars: list[dict[str, Any]]) -> list[str]:
    """How the frames that matter hang together, root first."""
    ends = [lidar["frame"] for lidar in lidars] or [roles["base_frame"]]
    lines = [f"frames: {' > '.join(clean(frame) for frame in reversed(_chain(parents, end)))}" for end in ends]
    lines[0] += f" ({len(parents)} in all)"
    return lines


def _chain(parents: dict[str, str | None], frame: str) -> list[str]:
    chain = [frame]
    while (parent := parents.get(chain[-1])) is not None and parent not in chain:
        chain.append(parent)
    return chain
