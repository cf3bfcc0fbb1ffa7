"""``mcl run``: Monte Carlo Localization over a log."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mclcli.cli import options
from mclcli.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.cli.options import Chosen
    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.references import References
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles
    from mclcli.replay.loop import ReplayTally, Setup
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid

DAMAGED = 3


@click.command("run", short_help="Run Monte Carlo Localization over a log.")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@click.option("--map", "map_file", type=click.Path(path_type=Path), help="Map, a map_server YAML; else the log's own.")
@click.option(
    "-o",
    "--output",
    "traces",
    multiple=True,
    metavar="TRACE",
    help="Weight trace: .csv, .csv.gz, .mcap, or - for CSV on stdout; repeatable.",
)
@click.option(
    "--track",
    "tracks",
    multiple=True,
    metavar="FILE",
    help="A pose per scan: .csv, .tum, or - for CSV on stdout; repeatable.",
)
@click.option("--steps", metavar="FILE", help="A row per update, CSV; - is stdout.")
@click.option("--picture", metavar="F.png", help="Draw map, track, reference and final particles.")
@click.option(
    "--init",
    metavar="WHERE",
    help="X,Y,YAW[,SXY,SYAW], uniform over the free cells, global (where a search finds the scans), a TOPIC of the "
    "log or FILE.tum.  [default: global]",
)
@click.option(
    "--seed",
    metavar="N",
    type=click.IntRange(min=0, max=2**64 - 1),
    default=0,
    show_default=True,
    help="Seed of every random stream.",
)
@click.option(
    "--particles", metavar="N|MIN:MAX", help="Number of particles; of two, KLD sampling chooses between them."
)
@click.option(
    "--recovery",
    type=click.Choice(["off", "uniform", "locate"]),
    help="Where particles are drawn anew when readings fit worse than they used to: nowhere, anywhere, or where a "
    "search finds the readings.",
)
@click.option(
    "--follow-initialpose",
    is_flag=True,
    help="Begin anew at every pose that the log's /initialpose states, as the robot did.",
)
@click.option("--deskew", is_flag=True, help="Score each beam of a scan from where the robot was at the beam's time.")
@click.option("--scan-offset", metavar="S", help="Seconds to add to the stamps of laser scans; may be negative.")
@click.option(
    "--scan", "scans", multiple=True, metavar="TOPIC", help="Laser scan topic; the first one given triggers updates."
)
@click.option("--odom", metavar="TOPIC|tf", help="Odometry topic, or tf.")
@click.option("--vision", multiple=True, metavar="TOPIC", help="Topic of landmark sightings; needs --landmarks.")
@click.option("--landmarks", type=click.Path(path_type=Path), help="Landmarks, CSV or YAML: id, x, y[, z].")
@click.option(
    "--start", metavar="TIME", help="First scan to use: seconds into the log, @SECONDS, 14:32:05 or ISO 8601."
)
@click.option("--duration", metavar="S", help="How long to go on, in seconds.")
@click.option("--strict", is_flag=True, help="Stop at the first damage in the log.")
@click.option(
    "--truth", metavar="FILE.tum|TOPIC", help="Reference for picture and report, as for mcl eval; never an input."
)
@click.option(
    "--versus", metavar="TOPIC|tf:FRAME", help="What the robot itself believed, /amcl_pose or tf:map: since when apart?"
)
@options.parameters
@options.model
@options.map_limits
@options.threads
@options.common
def command(**arguments: Any) -> int:
    """Track a robot through LOG: a file, a rosbag2 folder, several of them as one log, or - for a stream on stdin.

    With no output named, the track goes to stdout as CSV unless that is a terminal.
    """
    from mclcli.cli import log_roles
    from mclcli.cli.run import report
    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.references import References, lines_of, report_of
    from mclcli.io.traces.output import open_output
    from mclcli.replay.loop import ReplayTally, replay

    began = time.perf_counter()
    chosen = options.choose_settings(arguments, {}, _from_flags(arguments))
    settings, recording = chosen.settings, _open(arguments)
    parts = log_roles.assign_roles(arguments, recording, chosen)
    grid, setup, landmarks = _set_up(arguments, recording, parts, chosen)
    references = References(arguments["truth"], arguments["versus"], recording, setup)
    inputs = _inputs(arguments)
    if arguments["picture"]:
        open_output(arguments["picture"], binary=True, inputs=inputs)  # refuses now what it would refuse at the end
    tally = ReplayTally()
    with Outputs(arguments, recording, setup, settings, grid, landmarks, inputs) as outputs:
        events = _events(recording, setup, outputs, references)
        with report.progress(recording) as show:
            for point in replay(events, setup, tally):
                outputs.write(point)
                show(point)
        _require_updates(tally, setup)
    summary = report.summarise(recording, setup, tally, outputs.track, time.perf_counter() - began)
    report.show(summary)
    findings = references.findings(outputs.track)
    compared = lines_of(findings)
    report.show(compared, report_of(findings))
    if arguments["picture"]:
        title = f"Track of {', '.join(recording.log.names)}"
        subtitle = compared[0] if compared else report.extent(tally, outputs.track)
        report.draw(arguments["picture"], inputs, grid, outputs, findings, title, subtitle)
    return DAMAGED if recording.tally.lossy else 0


def _inputs(arguments: dict[str, Any]) -> list[Path]:
    """Files that are read, none of which may be written."""
    named = (*arguments["logs"], *(arguments[name] for name in ("map_file", "landmarks", "params", "init", "truth")))
    return [Path(name) for name in named if name and (name == "-" or Path(name).exists())]


def _from_flags(arguments: dict[str, Any]) -> dict[str, object]:
    return {name: arguments[name] for name in ("particles", "recovery") if arguments[name] is not None}


def _open(arguments: dict[str, Any]) -> Recording:
    from mclcli.io.logs import open_log
    from mclcli.io.recording.recording import Recording

    stdin = sys.stdin.buffer if "-" in arguments["logs"] else None
    return Recording(open_log(arguments["logs"], stdin=stdin), strict=arguments["strict"])


def _set_up(
    arguments: dict[str, Any], recording: Recording, parts: Roles, chosen: Chosen
) -> tuple[OccupancyGrid | None, Setup, Landmarks | None]:
    from mclcli.cli.log_roles import start_of_file
    from mclcli.cli.run.start import find_initialpose, read_offset, read_start, read_window
    from mclcli.cli.searching import search_for
    from mclcli.io.maps.field_cache import cached_field
    from mclcli.replay import setup as assemble

    grid = _find_map(arguments, recording, parts)
    landmarks = _read_landmarks(arguments["landmarks"])
    start = start_of_file(chosen, grid) if arguments["init"] is None else read_start(arguments["init"], recording)
    start, proposal = search_for(arguments, chosen.settings, grid, landmarks, parts, start)
    setup = assemble.prepare(
        recording.survey,
        parts,
        grid=grid,
        landmarks=landmarks,
        settings=chosen.settings,
        start=start,
        proposal=proposal,
        follow=find_initialpose(recording) if arguments["follow_initialpose"] else "",
        deskew=arguments["deskew"],
        scan_offset_ns=read_offset(arguments["scan_offset"]),
        seed=arguments["seed"],
        temperature=arguments["temperature"],
        mounts=arguments["mounts"],
        window_ns=read_window(arguments["start"], arguments["duration"], recording.first_ns),
        make_field=lambda *what, **how: cached_field(*what, **how)[0],
        threads=arguments["threads"],
    )
    return grid, setup, landmarks


def _read_landmarks(path: Path | None) -> Landmarks | None:
    if path is None:
        return None
    from mclcli.io.tables.landmarks_file import read_landmarks

    return read_landmarks(path)


def _find_map(arguments: dict[str, Any], recording: Recording, parts: Roles) -> OccupancyGrid | None:
    """The map asked for, else the one that the log holds."""
    from mclcli.cli import console
    from mclcli.io.maps.map_yaml import load_map
    from mclcli.world.occupancy import OccupancyGrid

    if arguments["map_file"] is not None:
        return load_map(
            arguments["map_file"], max_cells=arguments["max_cells"], allow_outside=arguments["allow_outside"]
        )
    if not parts.map:
        return None
    grid = recording.survey.topics[parts.map].sample
    assert isinstance(grid, OccupancyGrid)  # noqa: S101 - roles go by type
    console.remark(f"map: from the log's topic {parts.map}")
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


def _require_updates(tally: ReplayTally, setup: Setup) -> None:
    if tally.updates:
        return
    reasons = "; ".join(f"{count} {topic}: {why}" for (topic, why), count in tally.skipped.most_common(3))
    trigger = next(iter(setup.instruments))
    raise InputError(f"no message of {trigger} could be used ({reasons or 'there is none'}); `mcl info` shows the log")
