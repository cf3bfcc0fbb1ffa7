"""``mcl plot``: a run over time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import click
import numpy as np

from mclcli.cli import completion, options
from mclcli.cli.parse import parse_picture

if TYPE_CHECKING:
    from mclcli.io.tables.updates_file import Updates
    from mclcli.render.evaluation import Errors


@final
@dataclass(frozen=True, slots=True)
class PlotOptions:
    """What ``mcl plot`` is asked for."""

    updates: str
    output: str
    truth: str | None


@click.command("plot", short_help="Draw reliability, ESS, particles and errors of a run over time.")
@click.argument("updates", metavar="TRACE|STEPS", shell_complete=completion.files)
@click.option(
    "-o",
    "--output",
    metavar="F.png",
    required=True,
    callback=parse_picture,
    shell_complete=completion.files,
    help="Picture to write; - is stdout.",
)
@click.option(
    "--truth",
    metavar="FILE.tum|LOG:TOPIC",
    shell_complete=completion.files,
    help="Reference for panels of errors, as for mcl eval.",
)
@options.common
@options.into(PlotOptions)
def command(plot: PlotOptions) -> None:
    """Draw the updates of a run over time, from its steps (--steps) or its weight trace (-o): .csv, .csv.gz or .mcap.

    Steps hold the reliability, and where the robot was probably lost; a weight trace does not.
    """
    from mclcli.cli import pictures
    from mclcli.filter.fit import PROBABLY_LOST
    from mclcli.io.tables.updates_file import read_updates
    from mclcli.io.traces.output import open_output
    from mclcli.render.updates import draw_updates

    inputs = [Path(name) for name in (plot.updates, plot.truth) if name]
    open_output(plot.output, binary=True, inputs=inputs)  # refuses now, not at the end
    updates = read_updates(plot.updates)
    picture = draw_updates(
        _seconds(updates),
        ess=updates.ess,
        particles=updates.particles,
        reliability=updates.reliability,
        lost=updates.lost,
        lost_below=PROBABLY_LOST,
        pieces=None if updates.segments is None else updates.segments.astype(np.intp),
        errors=None if plot.truth is None else _errors(updates, plot.truth),
        title=f"Updates of {Path(plot.updates).name}",
    )
    pictures.save(picture, plot.output, inputs)


def _seconds(updates: Updates) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.asarray((updates.stamps_ns - updates.stamps_ns[0]) * 1e-9, dtype=np.float64)


def _errors(updates: Updates, source: str) -> Errors:
    """Errors at the updates, with the losses that ``mcl eval`` finds among them."""
    from mclcli.cli.eval.pictures import errors_to_draw
    from mclcli.evaluate.evaluation import evaluate
    from mclcli.geometry.trajectory import in_order
    from mclcli.io.recording.recorded_poses import read_trajectory

    track = in_order(updates.stamps_ns, updates.poses)
    return errors_to_draw(evaluate(track, read_trajectory(source)), int(updates.stamps_ns[0]))
