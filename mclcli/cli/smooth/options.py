"""The options of ``mcl smooth``: those of a run that say what is filtered, and how the track comes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import click

from mclcli.cli import completion, options
from mclcli.cli.run.options import RunOptions, filtering, log_and_map, picture, truth
from mclcli.io.traces.formats import endings


@final
@dataclass(frozen=True, slots=True)
class SmoothOptions:
    """What ``mcl smooth`` is asked for: the run that it begins with, and whether the figures are printed as JSON."""

    run: RunOptions
    as_json: bool


def from_arguments(*, as_json: bool, **arguments: Any) -> SmoothOptions:
    """The options from what click hands over; a run of the smoother's own writes nothing but the track."""
    return SmoothOptions(
        RunOptions(traces=(), steps=None, versus=None, as_json=False, seeds=None, **arguments), as_json
    )


smooth_options = options.all_of(
    log_and_map,
    click.option(
        "-o",
        "--output",
        "--track",
        "tracks",
        multiple=True,
        metavar="FILE",
        shell_complete=completion.files,
        help=f"The track, a pose per scan: {endings('smoothed')}, or - for CSV on stdout; repeatable.",
    ),
    picture,
    click.option("--json", "as_json", is_flag=True, help="Print what was found as JSON: metres, radians, nats."),
    filtering,
    truth,
    options.parameters,
    options.sensors,
    options.map_limits,
    options.threads,
    options.common,
)
