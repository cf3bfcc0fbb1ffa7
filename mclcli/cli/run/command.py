"""``mcl run``: Monte Carlo Localization over a log."""

from __future__ import annotations

import time

import click

from mclcli.cli.options import into
from mclcli.cli.run.options import RunOptions, run_options
from mclcli.errors import ExitCode


@click.command("run", short_help="Run Monte Carlo Localization over a log.")
@run_options
@into(RunOptions)
def command(options: RunOptions) -> ExitCode:
    """Track a robot through LOG: a file, a rosbag2 folder, several of them as one log, or - for a stream on stdin.

    With no output named, the track goes to stdout as CSV unless that is a terminal.
    """
    from mclcli.cli.run import report
    from mclcli.cli.run.outputs import Outputs, targets_of
    from mclcli.cli.run.preparing import prepare, require_updates
    from mclcli.cli.run.references import References, lines_of, report_of
    from mclcli.io.traces.output import open_output
    from mclcli.replay.loop import ReplayTally, replay

    began = time.perf_counter()
    ready = prepare(options)
    recording, setup = ready.recording, ready.setup
    references = References(options.truth, options.versus, recording, setup, ready.frame)
    inputs = options.input_files
    if options.picture:
        open_output(options.picture, binary=True, inputs=inputs)  # refuses now what it would refuse at the end
    tally = ReplayTally()
    with Outputs(options, ready, targets_of(options), inputs) as outputs:
        with report.progress(recording, tally) as show:
            events = ready.events(references, outputs.pass_on if outputs.keeps_transforms else None)
            for point in replay(events, setup, tally):
                outputs.write(point)
                show(point)
        require_updates(tally, setup, recording)
    summary = report.summarise(recording, setup, tally, outputs.track, time.perf_counter() - began)
    report.show(summary)
    if ready.told is not None:
        ready.told.tell()
    findings = references.findings(outputs.track)
    compared = lines_of(findings)
    report.show(compared, report_of(findings))
    if options.picture:
        title = f"Track of {', '.join(recording.log.names)}"
        subtitle = compared[0] if compared else report.extent(tally, outputs.track)
        report.draw(options.picture, inputs, ready.grid, outputs, findings, tally.lost, title, subtitle)
    return ExitCode.DAMAGED if recording.tally.lossy else ExitCode.COMPLETE
