"""``mcl locate``: where a scan was taken, anywhere on the map."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mclcli.cli import options
from mclcli.errors import InputError, UsageError
from mclcli.quantity import parse_list

if TYPE_CHECKING:
    from mclcli.replay.finder import Limits
    from mclcli.settings.profiles import Settings
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid

AMBIGUOUS = 5
DAMAGED = 3
_PRIOR_YAW = math.radians(45.0)


def parse_prior(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...] | None:
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
    return prior if len(prior) == 5 else (*prior, _PRIOR_YAW)


def parse_region(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...] | None:
    """X0,Y0,X1,Y1 of --region."""
    del ctx
    if value is None:
        return None
    region = parse_list(value, ("m", "m", "m", "m"), "--region")
    if len(region) != 4:
        raise click.BadParameter(f"'{value}' needs four values, X0,Y0,X1,Y1", param=param)
    return region


@click.command("locate", short_help="Find where a scan was taken, anywhere on the map.")
@click.argument("scan", metavar="SCAN")
@click.option("--map", "map_file", required=True, type=click.Path(path_type=Path), help="Map, a map_server YAML.")
@click.option("--at", metavar="TIME", help="Of a log: the scan nearest to this time.")
@click.option("--index", metavar="N", type=click.IntRange(min=0), help="Of a log: the scan of this number, from 0.")
@click.option("--every", metavar="S", help="Of a log: a scan every S seconds.")
@click.option("--window", metavar="S", help="Of a log: join the scans of the S seconds up to the scan, by odometry.")
@click.option("--scan-topic", metavar="TOPIC", help="Of a log: the topic of the scan.")
@click.option("--odom", metavar="TOPIC|tf", help="Of a log: odometry topic, or tf.")
@click.option(
    "--prior",
    metavar="X,Y,YAW,R[,A]",
    callback=parse_prior,
    help="Search within R of X,Y and within A of YAW (45deg if not given).",
)
@click.option("--region", metavar="X0,Y0,X1,Y1", callback=parse_region, help="Search in this box of the map.")
@click.option(
    "-k", "--number", metavar="N", type=click.IntRange(1, 32), default=5, show_default=True, help="Places to report."
)
@click.option(
    "--min-share",
    type=click.FloatRange(0.0, 1.0),
    default=0.8,
    show_default=True,
    help="Exit with 5 if the best place is less probable.",
)
@click.option("--landmarks", type=click.Path(path_type=Path), help="Landmarks, CSV or YAML: id, x, y[, z].")
@click.option("--bearings", type=click.Path(path_type=Path), help="Of a single scan: bearings seen, CSV: id, bearing.")
@click.option("-o", "--output", metavar="FILE", default="-", help="Where the result goes; - is stdout.  [default: -]")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of CSV: a line per scan, with all figures.")
@click.option("--picture", metavar="F.png", help="Draw the places on the map, and the (last) scan from the best.")
@options.parameters
@options.model
@options.map_limits
@options.threads
@options.common
def command(**arguments: Any) -> int:
    """Find where SCAN was taken: a LaserScan as YAML or JSON, - for stdin, or a log.

    The best pose of the whole map, proven, the places that compete with it, and how probable each is.
    """
    from mclcli.cli import searching
    from mclcli.cli.locate import output as locate_output
    from mclcli.cli.locate import scans
    from mclcli.io.maps.map_yaml import load_map
    from mclcli.io.traces.output import open_output

    chosen = options.choose_settings(arguments, {})
    settings = chosen.settings
    grid = load_map(arguments["map_file"], max_cells=arguments["max_cells"], allow_outside=arguments["allow_outside"])
    landmarks = _landmarks(arguments)
    moments = scans.find(arguments, chosen, grid, landmarks)
    alpha = searching.temperature_of(arguments["temperature"])
    search = searching.global_search(settings, grid, landmarks, alpha, _limits(arguments, grid, settings))
    inputs = input_files(arguments)
    if arguments["picture"]:
        open_output(arguments["picture"], binary=True, inputs=inputs)  # refuses now what it would refuse at the end
    result = locate_output.Results(arguments, search, grid, inputs)
    with open_output(arguments["output"], binary=False, inputs=inputs) as output:
        output.write(result.header)
        for moment in moments:
            output.write(result.add(moment))
    if not result.count:
        raise InputError(f"{arguments['scan']}: no scan there that can be used; `mcl info` shows what the log has")
    result.conclude()
    if moments.lossy:
        return DAMAGED
    return AMBIGUOUS if result.ambiguous else 0


def input_files(arguments: dict[str, Any]) -> list[Path]:
    """Files that are read, none of which may be written."""
    names = ("scan", "map_file", "landmarks", "bearings", "params")
    return [Path(arguments[name]) for name in names if arguments[name] and arguments[name] != "-"]


def _limits(arguments: dict[str, Any], grid: OccupancyGrid, settings: Settings) -> Limits:
    """What --prior and --region leave of the map.

    Raises
    ------
    UsageError
        If they leave nothing.

    """
    from mclcli.replay.finder import Limits
    from mclcli.replay.setup import describe_extent
    from mclcli.search.scene import allowed_cells

    prior, region = arguments["prior"], arguments["region"]
    disc, about = ((prior[0], prior[1], prior[3]), (prior[2], prior[4])) if prior else (None, (0.0, math.pi))
    if not allowed_cells(grid, settings.search.base_cells, region, disc).any():
        named = " and ".join(f"--{name}" for name in ("prior", "region") if arguments[name]) or "--map"
        raise UsageError(
            f"{named}: leaves no cell where the base may be (base_cells={settings.search.base_cells}); "
            f"{describe_extent(grid)}"
        )
    return Limits(region, disc, about)


def _landmarks(arguments: dict[str, Any]) -> Landmarks | None:
    from mclcli.io.tables.landmarks_file import read_landmarks

    return None if arguments["landmarks"] is None else read_landmarks(arguments["landmarks"])
