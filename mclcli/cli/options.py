"""The options that several commands share, each defined once."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, final

import click

from mclcli.quantity import parse_list

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.settings.profiles import Settings
    from mclcli.settings.robots.reading import FileParameters

Command = TypeVar("Command", bound="Callable[..., Any]")

# As in mclcli.settings.profiles, which costs too much to import for --help; a test compares them.
PROFILE_NAMES = ("textbook", "nav2", "beluga")
MODEL_NAMES = ("likelihood_field", "likelihood_field_prob", "beam")
POSE_UNITS = ("m", "m", "rad")
MOUNT_UNITS = ("m", "m", "m", "rad", "rad", "rad")


def parse_pose(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...] | None:
    """X,Y,YAW of an option, yaw in radians or with a unit."""
    del ctx
    if value is None:
        return None
    pose = parse_list(value, POSE_UNITS, param.opts[0])
    if len(pose) != 3:
        raise click.BadParameter(f"'{value}' needs three values, X,Y,YAW", param=param)
    return pose


def parse_poses(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> list[tuple[float, ...]]:
    """X,Y,YAW of a repeated option."""
    return [pose for value in values if (pose := parse_pose(ctx, param, value)) is not None]


def parse_mounts(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, Any]:
    """[FRAME=]X,Y,YAW or [FRAME=]X,Y,Z,ROLL,PITCH,YAW as transforms (4, 4) by frame; '' stands for any frame."""
    from mclcli.geometry import se3

    del ctx
    mounts: dict[str, Any] = {}
    for value in values:
        frame, _, numbers = value.rpartition("=")
        if numbers.count(",") == 2:
            x, y, yaw = parse_list(numbers, POSE_UNITS, "--mount")
            mounts[frame.lstrip("/")] = se3.from_rpy([x, y, 0.0], 0.0, 0.0, yaw)
        elif numbers.count(",") == 5:
            x, y, z, roll, pitch, yaw = parse_list(numbers, MOUNT_UNITS, "--mount")
            mounts[frame.lstrip("/")] = se3.from_rpy([x, y, z], roll, pitch, yaw)
        else:
            raise click.BadParameter(f"'{value}' is neither X,Y,YAW nor X,Y,Z,ROLL,PITCH,YAW", param=param)
    return mounts


def parse_settings(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """KEY=VALUE pairs of --set; the last one of a key counts."""
    del ctx
    pairs = [value.partition("=") for value in values]
    for key, equals, _ in pairs:
        if not equals:
            raise click.BadParameter(f"'{key}' is not KEY=VALUE", param=param)
    return {key.strip(): text.strip() for key, _, text in pairs}


def parse_temperature(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, float | str]:
    """[SENSOR=]ALPHA|auto|ess by sensor; '' stands for all."""
    from mclcli.quantity import parse_quantity

    del ctx
    temperature: dict[str, float | str] = {}
    for value in values:
        sensor, _, text = value.rpartition("=")
        alpha = text if text in {"auto", "ess"} else parse_quantity(text, "", "--temperature")
        if isinstance(alpha, float) and not 0.0 < alpha <= 1.0:
            raise click.BadParameter(f"{text} is not in (0, 1]; 1 leaves the likelihood as it is", param=param)
        temperature[sensor] = alpha
    return temperature


def common(command: Command) -> Command:
    """-v, -q, --color, --threads, --cache-dir, --debug; sets the console up before the command runs."""

    @functools.wraps(command)
    def wrapped(
        *args: Any, verbose: int, quiet: bool, color: str, cache_dir: Path | None, debug: bool, **rest: Any
    ) -> Any:
        from mclcli.cli import console

        del debug  # read from the arguments by mclcli.cli.process, before anything is parsed
        console.set_up(verbosity=-1 if quiet else verbose, color=color)
        if cache_dir is not None:
            console.use_cache(cache_dir)
        return command(*args, **rest)

    for option in reversed(
        (
            click.option(
                "--cache-dir",
                type=click.Path(path_type=Path, file_okay=False),
                help="Where fields and compiled kernels are kept.",
            ),
            click.option(
                "--color",
                type=click.Choice(["auto", "always", "never"]),
                default="auto",
                help="Colours on the terminal.",
            ),
            click.option("-v", "--verbose", count=True, help="Say more on stderr."),
            click.option("-q", "--quiet", is_flag=True, help="Say nothing on stderr but errors."),
            click.option("--debug", is_flag=True, help="Show the traceback of an error."),
        )
    ):
        wrapped = option(wrapped)
    return wrapped  # type: ignore[return-value]


def _all(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def decorate(command: Command) -> Command:
        return functools.reduce(lambda wrapped, option: option(wrapped), reversed(options), command)

    return decorate


threads = click.option(
    "--threads",
    metavar="N",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Threads that score; the results are the same.",
)

map_file = click.argument("map_file", metavar="MAP", type=click.Path(path_type=Path))

map_limits = _all(
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

parameters = _all(
    click.option(
        "--profile",
        type=click.Choice(PROFILE_NAMES),
        help="Whose semantics.  [default: textbook, or whose file --params is]",
    ),
    click.option(
        "--model",
        type=click.Choice(MODEL_NAMES),
        help="Lidar model.  [default: likelihood_field, or what --params says]",
    ),
    click.option(
        "--params",
        type=click.Path(path_type=Path),
        help="YAML with parameters: mcl's own, or the robot's, nav2's or that of Beluga's amcl.",
    ),
    click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="KEY=VALUE",
        callback=parse_settings,
        help="One parameter; repeatable. `mcl params` lists them.",
    ),
)

model = _all(
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


@final
@dataclass(frozen=True, slots=True)
class Chosen:
    """Settings, and the file of --params that they come from, if any; ``tentative`` are what only the file says."""

    settings: Settings
    file: FileParameters | None
    tentative: frozenset[str] = frozenset()


def choose_settings(
    arguments: dict[str, Any], base: dict[str, object], flags: dict[str, object] | None = None
) -> Chosen:
    """Settings of --params and --set over a command's own defaults: flag > --set > --params > default.

    What there is to say about the file is said.
    """
    from mclcli.cli import console
    from mclcli.settings import profiles

    profile, model = arguments["profile"], arguments["model"]
    given = profiles.spelled_out(arguments["settings"]) | profiles.spelled_out(flags or {})
    if arguments["params"] is None:
        values = {**base, **given}
        return Chosen(profiles.build(values, profile=profile or "textbook", model=model or "likelihood_field"), None)
    from mclcli.settings.robots.reading import load, settings_of

    file = load(arguments["params"], profile=profile, model=model)
    settings = settings_of(file, given, base=base, profile=profile, model=model)
    if not file.remarks:
        console.detail(f"{file.name}: parameters in {file.dialect}'s own dialect")
    for line in file.remarks:
        console.remark(line)
    for line in file.warnings:
        console.warn(line)
    return Chosen(settings, file, file.tentative - set(given))
