"""``mcl run``: Monte Carlo Localization over a log."""

from __future__ import annotations

import sys
import time
from collections import Counter
from typing import TYPE_CHECKING

import click

from mclcli.cli.options import into
from mclcli.cli.run.options import RunOptions, run_options
from mclcli.errors import ExitCode, InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from mclcli.cli.chosen import Chosen
    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.references import References
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles
    from mclcli.replay.loop import ReplayTally, Setup
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid


@click.command("run", short_help="Run Monte Carlo Localization over a log.")
@run_options
@into(RunOptions)
def command(options: RunOptions) -> ExitCode:
    """Track a robot through LOG: a file, a rosbag2 folder, several of them as one log, or - for a stream on stdin.

    With no output named, the track goes to stdout as CSV unless that is a terminal.
    """
    from mclcli.cli.chosen import choose_settings, tell_refused
    from mclcli.cli.run import report
    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.references import References, lines_of, report_of
    from mclcli.io.traces.output import open_output
    from mclcli.replay.loop import ReplayTally, replay

    began = time.perf_counter()
    chosen = choose_settings(options.parameters, {}, _from_flags(options))
    settings, recording = chosen.settings, _open(options)
    parts = _assign_roles(options, recording, chosen)
    grid, setup, landmarks = _set_up(options, recording, parts, chosen)
    tell_refused(recording)
    references = References(options.truth, options.versus, recording, setup)
    inputs = options.input_files
    if options.picture:
        open_output(options.picture, binary=True, inputs=inputs)  # refuses now what it would refuse at the end
    tally = ReplayTally()
    with Outputs(options, recording, setup, settings, grid, landmarks, inputs) as outputs:
        events = _events(recording, setup, outputs, references)
        with report.progress(recording) as show:
            for point in replay(events, setup, tally):
                outputs.write(point)
                show(point)
        _require_updates(tally, setup, recording)
    summary = report.summarise(recording, setup, tally, outputs.track, time.perf_counter() - began)
    report.show(summary)
    findings = references.findings(outputs.track)
    compared = lines_of(findings)
    report.show(compared, report_of(findings))
    if options.picture:
        title = f"Track of {', '.join(recording.log.names)}"
        subtitle = compared[0] if compared else report.extent(tally, outputs.track)
        report.draw(options.picture, inputs, grid, outputs, findings, title, subtitle)
    return ExitCode.DAMAGED if recording.tally.lossy else ExitCode.COMPLETE


def _from_flags(options: RunOptions) -> dict[str, object]:
    given = {"particles": options.particles, "recovery": options.recovery}
    return {name: value for name, value in given.items() if value is not None}


def _open(options: RunOptions) -> Recording:
    from mclcli.io.logs import open_log
    from mclcli.io.recording.recording import Recording

    stdin = sys.stdin.buffer if "-" in options.logs else None
    return Recording(open_log(options.logs, stdin=stdin), strict=options.strict)


def _assign_roles(options: RunOptions, recording: Recording, chosen: Chosen) -> Roles:
    """Roles of the log's topics and frames; says so where there was a choice."""
    from mclcli.cli import console
    from mclcli.cli.chosen import names_in
    from mclcli.io.recording import roles

    topics = options.topics
    if topics.vision and topics.landmarks is None:
        raise UsageError("--vision needs --landmarks: where the landmarks stand")
    overruled = {"scan_topic"} if topics.scans else set[str]()
    if options.map_file is not None:
        overruled.add("map_topic")
    names = names_in(recording.survey, chosen, overruled)
    requested = roles.RequestedRoles(
        scan=topics.scans or ((names["scan_topic"],) if names["scan_topic"] else ()),
        odometry=topics.odom or "",
        vision=topics.vision,
        map=names["map_topic"],
        base_frame=names["base_frame_id"],
        odom_frame=names["odom_frame_id"],
        map_frame=chosen.settings.frames.global_frame_id,
    )
    parts = roles.assign(recording.survey, requested)
    for role in ("scan", "odometry"):
        if "not " in (reason := parts.reasons.get(role, "")):
            console.remark(f"{role}: {' '.join(getattr(parts, role)) if role == 'scan' else parts.odometry}, {reason}")
    return parts


def _set_up(
    options: RunOptions, recording: Recording, parts: Roles, chosen: Chosen
) -> tuple[OccupancyGrid | None, Setup, Landmarks | None]:
    from mclcli.cli.chosen import warn_of_turned_map
    from mclcli.cli.run.start import find_initialpose, read_start, start_of_file, window_ns
    from mclcli.cli.searching import search_for
    from mclcli.io.maps.field_cache import cached_field
    from mclcli.replay import setup as assemble

    grid = _find_map(options, recording, parts)
    warn_of_turned_map(grid, chosen.settings)
    landmarks = _read_landmarks(options.topics.landmarks)
    start = start_of_file(chosen, grid) if options.init is None else read_start(options.init, recording)
    anywhere = start is None and options.init != "uniform" and not options.follow_initialpose
    start, proposal = search_for(chosen.settings, grid, landmarks, parts, start, anywhere=anywhere)
    setup = assemble.prepare(
        recording.survey,
        parts,
        grid=grid,
        landmarks=landmarks,
        settings=chosen.settings,
        start=start,
        proposal=proposal,
        follow=find_initialpose(recording) if options.follow_initialpose else "",
        deskew=options.deskew,
        scan_offset_ns=options.scan_offset_ns,
        seed=options.seed,
        temperature=options.sensors.temperature,
        mounts=options.sensors.mounts,
        window_ns=window_ns(options.start, options.duration_ns, recording.first_ns),
        make_field=lambda *what, **how: cached_field(*what, **how)[0],
        threads=options.threads,
    )
    return grid, setup, landmarks


def _read_landmarks(path: Path | None) -> Landmarks | None:
    if path is None:
        return None
    from mclcli.io.tables.landmarks_file import read_landmarks

    return read_landmarks(path)


def _find_map(options: RunOptions, recording: Recording, parts: Roles) -> OccupancyGrid | None:
    """The map asked for, else the one that the log holds."""
    from mclcli.cli import console
    from mclcli.world.occupancy import OccupancyGrid

    if options.map_file is not None:
        return options.map_limits.load(options.map_file)
    if not parts.map:
        return None
    grid = recording.survey.topics[parts.map].sample
    assert isinstance(grid, OccupancyGrid)  # noqa: S101 - roles go by type
    console.remark(f"map: from the log's topic {parts.map}")
    for what in recording.survey.tally.notes.get(parts.map, {}):
        console.remark(f"{parts.map}: {what}")
    return grid


def _events(
    recording: Recording, setup: Setup, outputs: Outputs, references: References
) -> Iterator[tuple[str, object]]:
    """Decoded messages that take part; transforms are passed on to traces that keep them."""
    needed = (
        setup.topics
        | references.topics
        | (set(recording.survey.transform_topics) if outputs.keeps_transforms else set())
    )
    for topic, record in recording.events(needed):
        if isinstance(record, tuple):
            outputs.pass_on(record)
        references.take(topic, record)
        yield topic, record


def _require_updates(tally: ReplayTally, setup: Setup, recording: Recording) -> None:
    if tally.updates:
        return
    trigger = next(iter(setup.instruments))
    unread = {(topic, why): n for topic in setup.topics for why, n in recording.tally.skipped.get(topic, {}).items()}
    skipped = (tally.skipped + Counter(unread)).most_common(3)
    reasons = "; ".join(f"{count} {topic}: {why}" for (topic, why), count in skipped)
    raise InputError(f"no message of {trigger} could be used ({reasons or 'there is none'}); `mcl info` shows the log")
