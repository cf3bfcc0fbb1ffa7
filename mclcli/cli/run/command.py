"""``mcl run``: Monte Carlo Localization over a log."""

from __future__ import annotations

import time
from functools import cache
from typing import TYPE_CHECKING

import click

from mclcli.cli.options import into
from mclcli.cli.run.options import RunOptions, run_options

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.cli.run.outcome import Outcome
    from mclcli.errors import ExitCode


@click.command("run", short_help="Run Monte Carlo Localization over a log.")
@run_options
@into(RunOptions)
def command(options: RunOptions) -> ExitCode:
    """Track a robot through LOG: a file, a rosbag2 folder, several of them as one log, or - for a stream on stdin.

    With no output named, the track goes to stdout as CSV unless that is a terminal.
    """
    from mclcli.cli import results

    results.keep_stdout_free((*options.traces, *options.tracks, options.steps), as_json=options.as_json)
    if options.seeds is not None:
        from mclcli.cli.run.seeds import run_each

        return run_each(options, _replay)
    outcome = _replay(options)
    if options.as_json:
        from mclcli.cli.run.facts import facts_of

        results.print_json(facts_of(outcome, options))
    return outcome.code


def _replay(options: RunOptions, said: Callable[[Outcome], None] | None = None) -> Outcome:
    """One run with everything that it writes; ``said`` tells the user what came of it, else a summary does."""
    from mclcli.cli.run import report
    from mclcli.cli.run.outcome import Outcome
    from mclcli.cli.run.outputs import Outputs, targets_of
    from mclcli.cli.run.preparing import prepare, require_updates
    from mclcli.cli.run.progress import progress
    from mclcli.cli.run.references import References
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
        with progress(recording, tally) as show:
            events = ready.events(references, outputs.pass_on if outputs.keeps_transforms else None)
            for point in replay(events, setup, tally):
                outputs.write(point)
                show(point)
        require_updates(tally, setup, recording)
    compare = cache(lambda: references.findings(outputs.track))
    seconds = time.perf_counter() - began
    outcome = Outcome(recording, setup, ready.settings, ready.grid, tally, outputs, compare, seconds)
    (said or report.tell)(outcome)
    if ready.told is not None:
        ready.told.tell()
    report.finish(options, outcome, in_full=said is None)
    return outcome
