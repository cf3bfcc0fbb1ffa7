"""The options of ``mcl score``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import click

from mclcli.cli import completion, options
from mclcli.cli.parse import named, parse_picture, parse_pose, parse_poses
from mclcli.errors import UsageError
from mclcli.quantity import parse_list

if TYPE_CHECKING:
    from mclcli.cli.options import MapLimits, ParameterOptions, ScanSource, SensorOptions
    from mclcli.cli.parse import Pose

YAW_STEP = math.radians(5.0)


@final
@dataclass(frozen=True, slots=True)
class PoseOptions:
    """The poses to score: given ones, those of a file, some drawn around one, a lattice of steps [m] and [rad].

    ``spread`` is the standard deviations [m] and [rad] of the poses drawn.
    """

    given: list[Pose]
    poses_file: str | None
    around: Pose | None
    spread: tuple[float, float]
    number: int
    seed: int
    lattice: tuple[float, float] | None


@final
@dataclass(frozen=True, slots=True)
class ScoreOptions:
    """What ``mcl score`` is asked for; None where an option is not given."""

    map_file: Path
    source: ScanSource
    poses: PoseOptions
    landmarks: Path | None
    bearings: Path | None
    output: str | None
    heatmap: str | None
    explain: bool
    as_run: bool
    picture: str | None
    as_json: bool
    parameters: ParameterOptions
    sensors: SensorOptions
    map_limits: MapLimits
    threads: int

    @property
    def input_files(self) -> list[Path]:
        """Files that are read, none of which may be written."""
        single = (self.source.scan, self.map_file, self.poses.poses_file)
        return [Path(name) for name in (*single, self.landmarks, self.bearings, self.parameters.params) if name]


def parse_spread(ctx: click.Context, param: click.Parameter, value: str) -> tuple[float, float]:
    """SXY,SYAW of --spread."""
    del ctx
    spread = parse_list(value, ("m", "rad"), param.opts[0])
    if len(spread) != 2 or min(spread) < 0.0:
        raise UsageError(f"{param.opts[0]}: '{value}' is not SXY,SYAW, two standard deviations")
    return spread[0], spread[1]


def parse_steps(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, float] | None:
    """STEP[,YAWSTEP] of --grid."""
    del ctx
    if value is None:
        return None
    steps = parse_list(value, ("m", "rad"), param.opts[0])
    if min(steps) <= 0.0:
        raise UsageError(f"{param.opts[0]}: '{value}' needs steps greater than 0")
    return steps[0], steps[1] if len(steps) > 1 else YAW_STEP


pose_options = options.together(
    PoseOptions,
    "poses",
    click.option(
        "--pose",
        "given",
        multiple=True,
        metavar="X,Y,YAW",
        callback=parse_poses,
        help="A pose of the base in map; repeatable.",
    ),
    click.option(
        "--poses",
        "poses_file",
        metavar="FILE",
        shell_complete=completion.files,
        help="CSV with columns x, y, yaw; other columns are passed on; - is stdin.",
    ),
    click.option("--around", metavar="X,Y,YAW", callback=parse_pose, help="Draw poses around this one."),
    click.option(
        "--spread",
        metavar="SXY,SYAW",
        callback=parse_spread,
        default="0.5,15deg",
        show_default=True,
        help="Standard deviations of the poses drawn.",
    ),
    click.option(
        "-n",
        "--number",
        metavar="N",
        type=click.IntRange(min=1),
        default=1000,
        show_default=True,
        help="How many poses to draw.",
    ),
    click.option(
        "--seed", metavar="N", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the poses drawn."
    ),
    click.option(
        "--grid",
        "lattice",
        metavar="STEP[,YAWSTEP]",
        callback=parse_steps,
        help="Poses on a lattice over the free cells; YAWSTEP is 5deg if not given.",
    ),
)

score_options = options.all_of(
    click.option("--map", "map_file", required=True, type=click.Path(path_type=Path), help="Map, a map_server YAML."),
    options.scan_source,
    pose_options,
    click.option("--landmarks", type=click.Path(path_type=Path), help="Landmarks, CSV or YAML: id, x, y[, z]."),
    click.option("--bearings", type=click.Path(path_type=Path), help="Bearings seen, CSV: id, bearing."),
    click.option(
        "-o",
        "--output",
        metavar="FILE",
        shell_complete=completion.files,
        callback=named(".csv", ".mcap"),
        help="CSV or .mcap, - is stdout; CSV on stdout if neither this nor --heatmap is given.",
    ),
    click.option(
        "--heatmap",
        metavar="F.png",
        shell_complete=completion.files,
        callback=parse_picture,
        help="Draw the likelihood over x, y (best over yaw).",
    ),
    click.option(
        "--as-run",
        is_flag=True,
        help="Score as `mcl run` does: its max_beams and temperature. Without it all beams count, at α = 1.",
    ),
    click.option("--explain", is_flag=True, help="For one pose: a row per beam and landmark instead of one per pose."),
    click.option(
        "--picture",
        metavar="F.png",
        shell_complete=completion.files,
        callback=parse_picture,
        help="With --explain: draw the scan on the map, coloured by log p.",
    ),
    options.as_json,
    options.parameters,
    options.sensors,
    options.map_limits,
    options.threads,
    options.common,
)
