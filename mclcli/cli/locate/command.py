"""``mcl locate``: where a scan was taken, anywhere on the map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from mclcli.cli.locate.options import LocateOptions, locate_options
from mclcli.cli.options import into
from mclcli.errors import ExitCode, InputError, UsageError

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.replay.finder import Limits
    from mclcli.settings.profiles import Settings
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid


@click.command("locate", short_help="Find where a scan was taken, anywhere on the map.")
@locate_options
@into(LocateOptions)
def command(options: LocateOptions) -> ExitCode:
    """Find where SCAN was taken: a LaserScan as YAML or JSON, - for stdin, or a log.

    Gives the pose that is proven to be the best of the whole map, the places that compete with it, and how probable
    each is.
    """
    from mclcli.cli import searching
    from mclcli.cli.chosen import choose_settings, warn_of_turned_map
    from mclcli.cli.locate import output as locate_output
    from mclcli.cli.locate import scans
    from mclcli.io.traces.output import open_output

    chosen = choose_settings(options.parameters, {})
    settings = chosen.settings
    grid = options.map_limits.load(options.map_file)
    warn_of_turned_map(grid, settings)
    landmarks = _landmarks(options.landmarks)
    moments = scans.find(options, chosen, grid, landmarks)
    alpha = searching.temperature_of(options.sensors.temperature)
    search = searching.global_search(settings, grid, landmarks, alpha, _limits(options, grid, settings))
    inputs = options.input_files
    if options.picture:
        open_output(options.picture, binary=True, inputs=inputs)  # refuses now what it would refuse at the end
    result = locate_output.Results(options, search, grid, inputs)
    with open_output(options.output, binary=False, inputs=inputs) as output:
        header = result.header
        for moment in moments:
            output.write(header + result.add(moment))  # nothing before it is known that there is something to say
            header = ""
    if not result.count:
        raise InputError(f"{options.source.scan}: no scan there that can be used; `mcl info` shows what the log has")
    result.conclude()
    if moments.lossy:
        return ExitCode.DAMAGED
    return ExitCode.AMBIGUOUS if result.ambiguous else ExitCode.COMPLETE


def _limits(options: LocateOptions, grid: OccupancyGrid, settings: Settings) -> Limits:
    """What --prior and --region leave of the map.

    Raises
    ------
    UsageError
        If they leave nothing.

    """
    from mclcli.replay.finder import Limits
    from mclcli.replay.setup import describe_extent
    from mclcli.search.scene import allowed_cells

    prior, region = options.prior, options.region
    disc = (prior.x, prior.y, prior.radius) if prior else None
    about = (prior.yaw, prior.angle) if prior else (0.0, math.pi)
    if not allowed_cells(grid, settings.search.base_cells, region, disc).any():
        named = " and ".join(name for name, given in (("--prior", prior), ("--region", region)) if given) or "--map"
        raise UsageError(
            f"{named}: leaves no cell where the base may be (base_cells={settings.search.base_cells}); "
            f"{describe_extent(grid)}"
        )
    return Limits(region, disc, about)


def _landmarks(path: Path | None) -> Landmarks | None:
    from mclcli.io.tables.landmarks_file import read_landmarks

    return None if path is None else read_landmarks(path)
