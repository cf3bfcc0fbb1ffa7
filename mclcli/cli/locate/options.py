"""The options of ``mcl locate``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import click

from mclcli.cli import completion, options
from mclcli.cli.parse import parse_length, parse_picture
from mclcli.quantity import parse_list

if TYPE_CHECKING:
    from mclcli.cli.options import MapLimits, ParameterOptions, ScanSource, SensorOptions

Region = tuple[float, float, float, float]

_PRIOR_YAW = math.radians(45.0)


@final
@dataclass(frozen=True, slots=True)
class Prior:
    """Where the base is known to be: within ``radius`` [m] of (x, y), and within ``angle`` [rad] of yaw."""

    x: float
    y: float
    yaw: float
    radius: float
    angle: float


@final
@dataclass(frozen=True, slots=True)
class LocateOptions:
    """What ``mcl locate`` is asked for; None where an option is not given. ``region`` [m]: x0, y0, x1, y1."""

    map_file: Path
    source: ScanSource
    every_ns: int | None
    window_ns: int | None
    odom: str | None
    prior: Prior | None
    region: Region | None
    number: int
    min_share: float
    landmarks: Path | None
    bearings: Path | None
    output: str
    as_json: bool
    picture: str | None
    parameters: ParameterOptions
    sensors: SensorOptions
    map_limits: MapLimits

    @property
    def input_files(self) -> list[Path]:
        """Files that are read, none of which may be written."""
        named = (self.source.scan, self.map_file, self.landmarks, self.bearings, self.parameters.params)
        return [Path(name) for name in named if name and name != "-"]


def parse_prior(ctx: click.Context, param: click.Parameter, value: str | None) -> Prior | None:
    """X,Y,YAW,R[,A] of --prior."""
    del ctx
    if value is None:
        return None
    prior = parse_list(value, ("m", "m", "rad", "m", "rad"), "--prior")
    if len(prior) not in {4, 5}:
        raise click.BadParameter(
            f"'{value}' needs four values, X,Y,YAW,R, or a fifth, how far yaw may be off", param=param
        )
    if not min(prior[3:]) > 0.0:
        raise click.BadParameter(f"'{value}': R, and how far yaw may be off, must be greater than 0", param=param)
    x, y, yaw, radius = prior[:4]
    return Prior(x, y, yaw, radius, prior[4] if len(prior) == 5 else _PRIOR_YAW)


def parse_region(ctx: click.Context, param: click.Parameter, value: str | None) -> Region | None:
    """X0,Y0,X1,Y1 of --region."""
    del ctx
    if value is None:
        return None
    region = parse_list(value, ("m", "m", "m", "m"), "--region")
    if len(region) != 4:
        raise click.BadParameter(f"'{value}' needs four values, X0,Y0,X1,Y1", param=param)
    left, bottom, right, top = region
    return left, bottom, right, top


locate_options = options.all_of(
    click.option("--map", "map_file", required=True, type=click.Path(path_type=Path), help="Map, a map_server YAML."),
    options.scan_source,
    click.option("--every", "every_ns", metavar="S", callback=parse_length, help="Of a log: a scan every S seconds."),
    click.option(
        "--window",
        "window_ns",
        metavar="S",
        callback=parse_length,
        help="Of a log: join the scans of the S seconds up to the scan, by odometry.",
    ),
    click.option(
        "--odom",
        metavar="TOPIC|tf",
        help="Of a log: odometry topic, or tf.",
        shell_complete=completion.topics("odometry", "tf"),
    ),
    click.option(
        "--prior",
        metavar="X,Y,YAW,R[,A]",
        callback=parse_prior,
        help="Search within R of X,Y and within A of YAW (45deg if not given).",
    ),
    click.option("--region", metavar="X0,Y0,X1,Y1", callback=parse_region, help="Search in this box of the map."),
    click.option(
        "-k",
        "--number",
        metavar="N",
        type=click.IntRange(1, 32),
        default=8,
        show_default=True,
        help="Places to report.",
    ),
    click.option(
        "--min-share",
        type=click.FloatRange(0.0, 1.0),
        default=0.8,
        show_default=True,
        help="Exit with 5 if the best place is less probable.",
    ),
    click.option("--landmarks", type=click.Path(path_type=Path), help="Landmarks, CSV or YAML: id, x, y[, z]."),
    click.option(
        "--bearings", type=click.Path(path_type=Path), help="Of a single scan: bearings seen, CSV: id, bearing."
    ),
    click.option(
        "-o",
        "--output",
        metavar="FILE",
        shell_complete=completion.files,
        default="-",
        help="Where the result goes; - is stdout.  [default: -]",
    ),
    click.option("--json", "as_json", is_flag=True, help="JSON instead of CSV: a line per scan, with all figures."),
    click.option(
        "--picture",
        metavar="F.png",
        shell_complete=completion.files,
        callback=parse_picture,
        help="Draw the places on the map, and the (last) scan from the best.",
    ),
    options.parameters,
    options.sensors,
    options.map_limits,
    options.common,
)
