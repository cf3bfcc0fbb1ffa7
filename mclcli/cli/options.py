"""The options that several commands share, each defined once, and how a command gets its options as one typed value.

A command has a frozen dataclass with a field per option. Options that several commands share are a dataclass of their
own, one field of the command's.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, final, get_args

import click

from mclcli.cli import completion
from mclcli.cli.parse import parse_at, parse_mounts, parse_settings, parse_temperature
from mclcli.sensors.models import LIDAR_MODELS
from mclcli.settings import Profile

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mclcli.arrays import FloatArray
    from mclcli.cli.clock import LogTime
    from mclcli.sensors import Temperature
    from mclcli.world.occupancy import OccupancyGrid

Command = TypeVar("Command", bound="Callable[..., Any]")
Options = TypeVar("Options")
Result = TypeVar("Result")


def into(kind: Callable[..., Options]) -> Callable[[Callable[[Options], Result]], Callable[..., Result]]:
    """Hand a command all its options as one value of ``kind``, whose fields have the options' names."""

    def decorate(command: Callable[[Options], Result]) -> Callable[..., Result]:
        @functools.wraps(command)
        def filled(**arguments: Any) -> Result:
            return command(kind(**arguments))

        return filled

    return decorate


def all_of(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Add several options, in the order of the help."""

    def decorate(command: Command) -> Command:
        return functools.reduce(lambda wrapped, option: option(wrapped), reversed(options), command)

    return decorate


def together(kind: type[Any], name: str, *options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Add several options that a command gets as one value ``name`` of the dataclass ``kind``."""
    names = [field.name for field in fields(kind)]

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def gathered(**arguments: Any) -> Any:
            arguments[name] = kind(**{key: arguments.pop(key) for key in names})
            return command(**arguments)

        return all_of(*options)(gathered)  # type: ignore[arg-type]

    return decorate


Color = Literal["auto", "always", "never"]


def common(command: Command) -> Command:
    """-v, -q, --color, --cache-dir, --debug; sets the console up before the command runs."""

    @functools.wraps(command)
    def wrapped(
        *args: Any, verbose: int, quiet: bool, color: Color, cache_dir: Path | None, debug: bool, **rest: Any
    ) -> Any:
        import time

        from mclcli.cli import console

        began = time.perf_counter()
        del debug  # read from the arguments by mclcli.cli.process, before anything is parsed
        console.set_up(verbosity=-1 if quiet else verbose, color=color)
        if cache_dir is not None:
            console.use_cache(cache_dir)
        code = command(*args, **rest)
        console.tell_cost(time.perf_counter() - began)
        return code

    return all_of(
        click.option(
            "--cache-dir",
            type=click.Path(path_type=Path, file_okay=False),
            help="Where fields and compiled kernels are kept.",
        ),
        click.option("--color", type=click.Choice(get_args(Color)), default="auto", help="Colours on the terminal."),
        click.option(
            "-v", "--verbose", count=True, help="Say more on stderr: settings, topics and why, map, time and memory."
        ),
        click.option("-q", "--quiet", is_flag=True, help="Say nothing on stderr but warnings and errors."),
        click.option("--debug", is_flag=True, help="Show the traceback of an error."),
    )(wrapped)  # type: ignore[return-value]


threads = click.option(
    "--threads",
    metavar="N",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Threads that score; the results are the same.",
)

as_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")

map_file = click.argument("map_file", metavar="MAP", type=click.Path(path_type=Path))


@final
@dataclass(frozen=True, slots=True)
class MapLimits:
    """Which maps are loaded: of at most ``max_cells`` cells, and with an image outside their folder or not."""

    max_cells: int
    allow_outside: bool

    def load(self, path: Path) -> OccupancyGrid:
        """Load a map within these limits; errors as of ``mclcli.io.maps.map_yaml.load_map``."""
        from mclcli.cli import console
        from mclcli.io.maps.map_yaml import load_map

        grid = load_map(path, max_cells=self.max_cells, allow_outside=self.allow_outside)
        occupied = int(grid.occupied.sum())
        console.detail(
            f"map: {path.name}, {grid.width} x {grid.height} cells of {grid.resolution:g} m, {occupied} occupied"
        )
        return grid


map_limits = together(
    MapLimits,
    "map_limits",
    click.option(
        "--max-cells",
        metavar="N",
        type=click.IntRange(min=1),
        default=64_000_000,
        show_default=True,
        help="Largest map to load.",
    ),
    click.option("--allow-outside", is_flag=True, help="Let the YAML name an image outside its own folder."),
)


@final
@dataclass(frozen=True, slots=True)
class ScanSource:
    """The scan to look at: a text file, standard input, or in a log the one nearest to a time, or of a number."""

    scan: str
    at: LogTime | None
    index: int | None
    scan_topic: str | None
    robot: str | None


robot = click.option("--robot", metavar="NAME", help="Which robot of a log that has several; `mcl info` names them.")

scan_source = together(
    ScanSource,
    "source",
    click.argument("scan", metavar="SCAN", shell_complete=completion.files),
    click.option("--at", metavar="TIME", callback=parse_at, help="Of a log: the scan nearest to this time."),
    click.option("--index", metavar="N", type=click.IntRange(min=0), help="Of a log: the scan of this number, from 0."),
    click.option(
        "--scan-topic",
        metavar="TOPIC",
        help="Of a log: the topic of the scan.",
        shell_complete=completion.topics("scan"),
    ),
    robot,
)


@final
@dataclass(frozen=True, slots=True)
class ParameterOptions:
    """Where parameters come from: a profile, a lidar model, the file of --params, and the pairs of --set.

    ``lenient``: names in the file that nobody has are passed over.
    """

    profile: Profile | None
    model: str | None
    params: Path | None
    lenient: bool
    settings: Mapping[str, str]


parameters = together(
    ParameterOptions,
    "parameters",
    click.option(
        "--profile",
        type=click.Choice(get_args(Profile)),
        help="Whose rules and defaults to follow.  [default: textbook, or those of the file of --params]",
    ),
    click.option(
        "--model",
        type=click.Choice(tuple(LIDAR_MODELS)),
        help="Lidar model.  [default: likelihood_field, or what --params says]",
    ),
    click.option(
        "--params",
        type=click.Path(path_type=Path),
        help="YAML with parameters: mcl's own, or the robot's, of nav2's, Beluga's or ROS 1's amcl; a roslaunch file.",
    ),
    click.option(
        "--lenient", is_flag=True, help="Pass over names in --params that do not exist, as the robot does, and say so."
    ),
    click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="KEY=VALUE",
        callback=parse_settings,
        shell_complete=completion.settings,
        help="One parameter; repeatable. `mcl params` lists them.",
    ),
)


@final
@dataclass(frozen=True, slots=True)
class SensorOptions:
    """Temperatures by sensor, and mounts (4, 4) by frame; the key '' stands for all."""

    temperature: Mapping[str, Temperature]
    mounts: Mapping[str, FloatArray]


sensors = together(
    SensorOptions,
    "sensors",
    click.option(
        "--temperature",
        multiple=True,
        metavar="[SENSOR=]ALPHA|auto|ess",
        callback=parse_temperature,
        help="Exponent in (0, 1] on every new likelihood; auto measures it from the beams' correlation, ess keeps a "
        "share of the sample. Repeatable.",
    ),
    click.option(
        "--mount",
        "mounts",
        multiple=True,
        metavar="[FRAME=]X,Y,YAW",
        callback=parse_mounts,
        help="Where a sensor sits on the base; also X,Y,Z,ROLL,PITCH,YAW.",
    ),
)
