"""What a run can write, by role and by the ending of the name: a file a format, and a line here.

The file is named as text and imported when it is written to, so that ``--help`` can list the endings at no cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Literal, final

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mclcli.io.traces.output import Output
    from mclcli.io.traces.sinks import RecordWriter
    from mclcli.io.traces.trace_messages import Grid
    from mclcli.native.backend import Backend
    from mclcli.records import StepRecord, TrackPoint, Transform

Role = Literal["trace", "track", "steps", "smoothed"]

OUTPUTS: dict[Role, dict[str, str]] = {
    "trace": {
        ".csv": "mclcli.io.traces.trace_csv:TRACE",
        ".csv.gz": "mclcli.io.traces.trace_csv:TRACE",
        ".mcap": "mclcli.io.traces.trace_mcap:TRACE",
        ".parquet": "mclcli.io.traces.trace_parquet:TRACE",
    },
    "track": {".csv": "mclcli.io.traces.track_csv:TRACK", ".tum": "mclcli.io.tables.tum:TRACK"},
    "steps": {".csv": "mclcli.io.traces.trace_csv:STEPS"},
    "smoothed": {
        ".csv": "mclcli.io.traces.track_csv:TRACK",
        ".tum": "mclcli.io.tables.tum:TRACK",
        ".mcap": "mclcli.io.traces.trace_mcap:TRACE",
    },
}
"""Where the ``Format`` of each ending stands, as ``module:name``; the first is that of names without an ending."""


@final
@dataclass(frozen=True, slots=True)
class About:
    """What is known of a run before it begins; a format takes what it has a place for.

    ``metadata`` is what it takes to make the same output again, ``parameters_yaml`` makes the file of its parameters.
    ``caveat`` is what whoever reads the output has to know, in one line.
    """

    metadata: Mapping[str, object]
    parameters_yaml: Callable[[], str]
    sensors: Sequence[str]
    grid: Grid | None
    odom_frame: str
    base_frame: str
    map_frame: str
    static_transforms: Sequence[Transform]
    backend: Backend
    caveat: str = ""


@final
@dataclass(frozen=True, slots=True)
class Writer:
    """One output: it takes every track point, and recorded transforms (stamp, transforms) if it passes them on."""

    write: Callable[[TrackPoint], None]
    close: Callable[[], None]
    transforms: Callable[[int, Sequence[Transform]], None] | None = None


@final
@dataclass(frozen=True, slots=True)
class Format:
    """How a format is written: ``make`` begins it on an open output, of bytes if ``binary``, else of text.

    ``stays_whole`` says that an interrupt leaves a complete file of what was written before.
    """

    make: Callable[[Output, About], Writer]
    binary: bool = False
    stays_whole: bool = False


def of_steps(steps: RecordWriter[StepRecord]) -> Writer:
    """Output of the updates alone."""

    def write(point: TrackPoint) -> None:
        if point.step is not None:
            steps.write(point.step)

    return Writer(write, steps.close)


def endings(role: Role) -> str:
    """Endings that a role knows, for the user: ``.csv, .tum``."""
    return ", ".join(OUTPUTS[role])


def format_of(role: Role, name: str) -> Format:
    """Format of a name in this role; of a name without a known ending (``-``, a device) the role's first."""
    known = OUTPUTS[role]
    place = next((known[ending] for ending in known if name.endswith(ending)), next(iter(known.values())))
    module, _, attribute = place.partition(":")
    found: Format = getattr(import_module(module), attribute)
    return found
