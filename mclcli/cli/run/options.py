"""The options of ``mcl run``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final, get_args

import click

from mclcli.cli import completion, options
from mclcli.cli.parse import parse_at, parse_picture
from mclcli.errors import UsageError
from mclcli.filter import Recovery
from mclcli.io.traces.formats import endings
from mclcli.quantity import parse_quantity

if TYPE_CHECKING:
    from mclcli.cli.clock import LogTime
    from mclcli.cli.options import MapLimits, ParameterOptions, SensorOptions

_MOST_SEEDS = 10_000


@final
@dataclass(frozen=True, slots=True)
class TopicOptions:
    """Topics that take part, and the landmarks that those of sightings need."""

    scans: tuple[str, ...]
    odom: str | None
    vision: tuple[str, ...]
    landmarks: Path | None
    robot: str | None


@final
@dataclass(frozen=True, slots=True)
class RunOptions:
    """What ``mcl run`` is asked for; None and empty where an option is not given."""

    logs: tuple[str, ...]
    map_file: Path | None
    traces: tuple[str, ...]
    tracks: tuple[str, ...]
    steps: str | None
    picture: str | None
    as_json: bool
    init: str | None
    seed: int
    seeds: tuple[int | None, int] | None
    particles: str | None
    recovery: Recovery | None
    follow_initialpose: bool
    deskew: bool
    scan_offset_ns: int
    topics: TopicOptions
    start: LogTime | None
    duration_ns: int | None
    strict: bool
    truth: str | None
    versus: str | None
    parameters: ParameterOptions
    sensors: SensorOptions
    map_limits: MapLimits
    threads: int

    @property
    def input_files(self) -> list[Path]:
        """Files that are read, none of which may be written."""
        named = (*self.logs, self.map_file, self.topics.landmarks, self.parameters.params, self.init, self.truth)
        return [Path(name) for name in named if name and (name == "-" or Path(name).exists())]

    @property
    def seed_numbers(self) -> range:
        """The seeds of --seeds: so many from --seed on, or from the first to the last; that of --seed without."""
        if self.seeds is None:
            return range(self.seed, self.seed + 1)
        first, last = self.seeds
        return range(self.seed, self.seed + last) if first is None else range(first, last + 1)


def parse_seeds(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[int | None, int] | None:
    """N or A:B of --seeds, as (None, N) or (A, B)."""
    del ctx
    if value is None:
        return None
    first, colon, last = value.partition(":")
    numbers = (first, last) if colon else (first,)
    if not all(number.isascii() and number.isdecimal() for number in numbers):
        raise UsageError(f"{param.opts[0]}: '{value}' is neither a number of seeds nor FIRST:LAST; write 5 or 0:4")
    if not colon:
        if not 1 <= int(first) <= _MOST_SEEDS:
            raise UsageError(f"{param.opts[0]}: {value} is not from 1 to {_MOST_SEEDS} seeds")
        return None, int(first)
    if not int(first) <= int(last) < 2**64 or int(last) - int(first) >= _MOST_SEEDS:
        raise UsageError(f"{param.opts[0]}: '{value}' is no range of 1 to {_MOST_SEEDS} seeds below 2^64")
    return int(first), int(last)


def parse_offset(ctx: click.Context, param: click.Parameter, value: str | None) -> int:
    """Nanoseconds of --scan-offset."""
    del ctx
    return 0 if value is None else round(parse_quantity(value, "s", param.opts[0]) * 1e9)


def parse_duration(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Nanoseconds of --duration, greater than 0."""
    from mclcli.cli.clock import parse_seconds

    del ctx
    if value is None:
        return None
    length = parse_seconds(value, param.opts[0])
    if length <= 0:
        raise UsageError(f"{param.opts[0]}: {value} is not greater than 0")
    return length


topic_options = options.together(
    TopicOptions,
    "topics",
    click.option(
        "--scan",
        "scans",
        multiple=True,
        metavar="TOPIC|all",
        shell_complete=completion.topics("scan", "all"),
        help="Laser scan topic, or all lidars of the robot; the first one given triggers updates.",
    ),
    click.option(
        "--odom", metavar="TOPIC|tf", help="Odometry topic, or tf.", shell_complete=completion.topics("odometry", "tf")
    ),
    click.option(
        "--vision",
        multiple=True,
        metavar="TOPIC",
        help="Topic of landmark sightings; needs --landmarks.",
        shell_complete=completion.topics("vision"),
    ),
    click.option("--landmarks", type=click.Path(path_type=Path), help="Landmarks, CSV or YAML: id, x, y[, z]."),
    options.robot,
)

log_and_map = options.all_of(
    click.argument("logs", metavar="LOG...", nargs=-1, required=True, shell_complete=completion.files),
    click.option(
        "--map", "map_file", type=click.Path(path_type=Path), help="Map, a map_server YAML; else the log's own."
    ),
)

picture = click.option(
    "--picture",
    metavar="F.png",
    shell_complete=completion.files,
    callback=parse_picture,
    help="Draw map, track, reference and final particles.",
)

filtering = options.all_of(
    click.option(
        "--init",
        metavar="WHERE",
        shell_complete=completion.topics("poses", "global", "uniform"),
        help="X,Y,YAW[,SXY,SYAW], uniform over the free cells, global (where a search finds the scans), a TOPIC of the "
        "log, tf:FRAME[:CHILD] or FILE.tum.  [default: global]",
    ),
    click.option(
        "--seed",
        metavar="N",
        type=click.IntRange(min=0, max=2**64 - 1),
        default=0,
        show_default=True,
        help="Seed of every random stream.",
    ),
    click.option(
        "--particles", metavar="N|MIN:MAX", help="Number of particles; between two numbers KLD sampling chooses."
    ),
    click.option(
        "--recovery",
        type=click.Choice(get_args(Recovery)),
        help="Where particles are drawn anew when readings fit worse than they used to: nowhere, anywhere, or where a "
        "search finds the readings.",
    ),
    click.option(
        "--follow-initialpose",
        is_flag=True,
        help="Begin anew at every pose that the log's /initialpose states, as the robot did.",
    ),
    click.option(
        "--deskew", is_flag=True, help="Score each beam of a scan from where the robot was at the beam's time."
    ),
    click.option(
        "--scan-offset",
        "scan_offset_ns",
        callback=parse_offset,
        metavar="S",
        help="Seconds to add to the stamps of laser scans; may be negative.",
    ),
    topic_options,
    click.option(
        "--start",
        metavar="TIME",
        callback=parse_at,
        help="First scan to use: seconds into the log, @SECONDS, 14:32:05 or ISO 8601.",
    ),
    click.option(
        "--duration", "duration_ns", callback=parse_duration, metavar="S", help="How many seconds of the log to use."
    ),
    click.option("--strict", is_flag=True, help="Stop at the first damage in the log."),
)

truth = click.option(
    "--truth",
    metavar="FILE.tum|TOPIC|tf:…",
    shell_complete=completion.topics("poses"),
    help="Reference for picture and report, as for mcl eval; tf:FRAME[:CHILD] are transforms. Never an input.",
)

run_options = options.all_of(
    log_and_map,
    click.option(
        "-o",
        "--output",
        "traces",
        multiple=True,
        metavar="TRACE",
        shell_complete=completion.files,
        help=f"Weight trace: {endings('trace')}, or - for CSV on stdout; repeatable.",
    ),
    click.option(
        "--track",
        "tracks",
        multiple=True,
        metavar="FILE",
        shell_complete=completion.files,
        help=f"A pose per scan: {endings('track')}, or - for CSV on stdout; repeatable.",
    ),
    click.option(
        "--steps", metavar="FILE", shell_complete=completion.files, help="A row per update, CSV; - is stdout."
    ),
    picture,
    options.as_json,
    filtering,
    click.option(
        "--seeds",
        metavar="N|A:B",
        callback=parse_seeds,
        help="Run with N seeds from --seed on, or with those from A to B; t.csv becomes t.0007.csv.",
    ),
    truth,
    click.option(
        "--versus",
        metavar="TOPIC|tf:…",
        shell_complete=completion.topics("poses"),
        help="What the robot itself believed, /amcl_pose or tf:map; says since when the two were apart.",
    ),
    options.parameters,
    options.sensors,
    options.map_limits,
    options.threads,
    options.common,
)
