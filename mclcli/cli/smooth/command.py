"""``mcl smooth``: the best track that a log can give."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING

import click

from mclcli.cli.options import into
from mclcli.cli.smooth.options import SmoothOptions, from_arguments, smooth_options
from mclcli.errors import ExitCode, InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from mclcli.cli.run.outputs import Target
    from mclcli.cli.run.preparing import Prepared
    from mclcli.cli.run.references import References
    from mclcli.replay.smoothing import Smoothed
    from mclcli.replay.tally import ReplayTally


@click.command("smooth", short_help="The best track of a log: every scan and all of its odometry at once.")
@smooth_options
@into(from_arguments)
def command(options: SmoothOptions) -> ExitCode:
    """Find the most probable track of LOG: a file, a rosbag2 folder, several of them as one log, or - for stdin.

    The filter runs first; then all scans and all odometry together say where the robot was at each scan, told by what
    came before it and by what came after. The summary says whether the track may serve as a reference.
    """
    from mclcli.cli import console
    from mclcli.cli.run import report as run_report
    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.preparing import prepare
    from mclcli.cli.run.references import References, lines_of, report_of
    from mclcli.cli.smooth import report
    from mclcli.replay.loop import ReplayTally

    ready = prepare(options.run)
    references = References(options.run.truth, None, ready.recording, ready.setup, ready.frame)
    inputs = options.run.input_files
    targets = _targets(options, inputs)
    tally = ReplayTally()
    found, seconds = _smooth(ready, references, tally)
    with Outputs(options.run, ready, targets, inputs, caveat=report.caveat(found)) as outputs:
        for point in found.points():
            outputs.write(point)
    run_report.show(report.summary(found, seconds, ready.recording.first_ns))
    if ready.told is not None:
        ready.told.tell()
    findings = references.findings(outputs.track)
    run_report.show([*lines_of(findings), *report.verdict(found)], report_of(findings))
    if options.as_json:
        click.echo(json.dumps(report.facts(found), indent=2))
    if options.run.picture:
        title = f"Smoothed track of {', '.join(ready.recording.log.names)}"
        subtitle = (lines_of(findings) or [run_report.extent(tally, outputs.track)])[0]
        lost = report.stretches_of(found)
        run_report.draw(options.run.picture, inputs, ready.grid, outputs, findings, lost, title, subtitle)
    if report.is_doubtful(found):
        console.error(
            f"the track is probably lost, or off the map, on {100 * report.lost_share(found):.0f} % of the way; what "
            "starts lost stays lost: give --init X,Y,YAW or --recovery locate, or a map of all places"
        )
    if ready.recording.tally.lossy:
        return ExitCode.DAMAGED
    return ExitCode.AMBIGUOUS if report.is_doubtful(found) else ExitCode.COMPLETE


def _targets(options: SmoothOptions, inputs: Sequence[Path]) -> list[Target]:
    """Where the track goes; refuses now what would be refused at the end."""
    from mclcli.cli.run.outputs import checked
    from mclcli.io.traces.formats import format_of
    from mclcli.io.traces.output import open_output

    quiet = options.as_json or options.run.picture
    targets = checked([("smoothed", name) for name in options.run.tracks], () if quiet else [("smoothed", "-")])
    if options.as_json and ("smoothed", "-") in targets:
        raise UsageError("--json: standard output holds the track already; give -o a name")
    for role, name in targets:
        open_output(name, binary=format_of(role, name).binary, inputs=inputs)
    if options.run.picture:
        open_output(options.run.picture, binary=True, inputs=inputs)
    return targets


def _smooth(ready: Prepared, references: References, tally: ReplayTally) -> tuple[Smoothed, float]:
    """The track, and how long it took once the filter was done [s]."""
    from mclcli.cli.run import report as run_report
    from mclcli.cli.run.ends import Ends
    from mclcli.cli.run.preparing import require_updates
    from mclcli.cli.run.progress import progress
    from mclcli.geometry.trajectory import Track
    from mclcli.io.maps.field_cache import cached_field
    from mclcli.replay.loop import replay
    from mclcli.replay.smoothing import Smoothing

    if ready.grid is None:
        raise InputError("smoothing needs a map; give --map")
    if ready.setup.map_topic:
        raise InputError(f"the log changes its map on {ready.setup.map_topic}; smoothing takes one: give --map")
    began = time.perf_counter()
    smoothing, filtered, ends = Smoothing(ready.setup), Track(whole=False), Ends()
    events = smoothing.passing(ready.events(references))
    with progress(ready.recording, tally) as show:
        for point in replay(events, ready.setup, tally):
            smoothing.take(point)
            filtered.append(point)
            ends.take(point)
            show(point)
    require_updates(tally, ready.setup, ready.recording)
    seconds = time.perf_counter() - began
    run_report.tell_summary(run_report.summary_of(ready.recording, ready.setup, tally, filtered, ends, seconds))
    began = time.perf_counter()
    found = smoothing.finish(ready.grid, lambda *what, **how: cached_field(*what, **how)[0])
    return found, time.perf_counter() - began
