"""The options of ``mcl eval``: rules, limits, names with wildcards."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final, get_args

import click

from mclcli.cli import completion, options
from mclcli.cli.parse import parse_picture
from mclcli.errors import UsageError
from mclcli.evaluate import Method
from mclcli.evaluate.limits import Limits
from mclcli.quantity import parse_list, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.cli.options import MapLimits
    from mclcli.evaluate.evaluation import Protocol
    from mclcli.evaluate.events import Rule

    Callback = Callable[[click.Context, click.Parameter, str | None], float | None]


@final
@dataclass(frozen=True, slots=True)
class EvalOptions:
    """What ``mcl eval`` is asked for; None where an option is not given."""

    tracks: tuple[str, ...]
    truth: str
    as_json: bool
    picture: str | None
    map_file: Path | None
    map_frame: str
    align: bool
    strict: bool
    associate: Method
    max_gap_ns: int
    max_diff_ns: int
    converged: Rule
    lost: Rule
    truth_sd: tuple[float, float]
    seed: int
    limits: Limits
    map_limits: MapLimits

    @property
    def protocol(self) -> Protocol:
        """How the evaluation is made."""
        from mclcli.evaluate.association import Matching
        from mclcli.evaluate.evaluation import Protocol

        matching = Matching(self.associate, max_gap_ns=self.max_gap_ns, max_diff_ns=self.max_diff_ns)
        return Protocol(matching, align=self.align, converged=self.converged, lost=self.lost, truth_sd=self.truth_sd)

    def input_files(self, tracks: Sequence[str]) -> list[Path]:
        """Files that are read, none of which may be written; ``tracks`` are those of the patterns."""
        from mclcli.io.recording.recorded_poses import split_source

        return [Path(split_source(name)[0]) for name in (*tracks, self.truth) if name != "-"]


def quantity(unit: str) -> Callback:
    """Callback of an option that takes a number ≥ 0 in a unit (``m``, ``rad``, ``s`` or none)."""

    def parse(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
        del ctx
        if text is None:
            return None
        value = parse_quantity(text, unit, param.opts[0])
        if value < 0.0:
            raise UsageError(f"{param.opts[0]}: {text} is negative; a bound is at least 0")
        return value

    return parse


def parse_share(text: str, option: str) -> float:
    """Share from 0 to 1 of ``0.95`` or ``95%``."""
    percent = text.strip().endswith("%")
    value = parse_quantity(text.strip().removesuffix("%"), "", option) * (0.01 if percent else 1.0)
    if not 0.0 <= value <= 1.0:
        raise UsageError(f"{option}: {text} is not a share; write 0.95 or 95%")
    return value


def share(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
    """Callback of an option that takes a share."""
    del ctx
    return None if text is None else parse_share(text, param.opts[0])


def share_within(ctx: click.Context, param: click.Parameter, text: str | None) -> tuple[float, float] | None:
    """Callback of ``SHARE,M``."""
    del ctx
    if text is None:
        return None
    first, comma, second = text.partition(",")
    if not comma:
        raise UsageError(f"{param.opts[0]}: '{text}' needs a share and a distance, such as 95%,10cm")
    return parse_share(first, param.opts[0]), parse_quantity(second, "m", param.opts[0])


def parse_rule(ctx: click.Context, param: click.Parameter, text: str | None) -> Rule:
    """Rule of ``M,ANGLE,SECONDS`` for --converged or --lost; what is not given is as by default."""
    from dataclasses import replace

    from mclcli.evaluate.events import CONVERGED, LOST

    del ctx
    default = {"converged": CONVERGED, "lost": LOST}[str(param.name)]
    if text is None:
        return default
    values = parse_list(text, ("m", "rad", "s"), param.opts[0])
    if min(values) < 0.0:
        raise UsageError(f"{param.opts[0]}: '{text}' has a negative value; bounds are at least 0")
    translation, yaw, seconds = (*values, *(default.translation, default.yaw, default.seconds)[len(values) :])
    return replace(default, translation=translation, yaw=yaw, seconds=seconds)


def parse_deviations(ctx: click.Context, param: click.Parameter, text: str | None) -> tuple[float, float]:
    """Standard deviations of ``XY,YAW`` [m], [rad]; without a yaw it is 0."""
    del ctx
    if text is None:
        return (0.0, 0.0)
    values = parse_list(text, ("m", "rad"), param.opts[0])
    if min(values) < 0.0:
        raise UsageError(f"{param.opts[0]}: '{text}' has a negative value; standard deviations are at least 0")
    return values[0], values[1] if len(values) > 1 else 0.0


def expand(names: tuple[str, ...]) -> list[str]:
    """Tracks by name: wildcards that the shell left alone are expanded, in order of name.

    Raises
    ------
    UsageError
        If no file matches, or standard input is named twice.

    """
    import glob

    found: list[str] = []
    for name in names:
        plain = name == "-" or not glob.has_magic(name) or Path(name).exists()
        matches = [name] if plain else sorted(glob.glob(name, recursive=True))  # noqa: PTH207 - absolute patterns too
        if not matches:
            raise UsageError(f"{name}: no file matches; check the pattern")
        found += matches
    if found.count("-") > 1:
        raise UsageError("-: standard input can be read once only; name it once")
    return found


_metres, _radians, _seconds, _number = (quantity(unit) for unit in ("m", "rad", "s", ""))


def _nanoseconds(ctx: click.Context, param: click.Parameter, text: str) -> int:
    return round((_seconds(ctx, param, text) or 0.0) * 1e9)


limit_options = options.together(
    Limits,
    "limits",
    click.option("--max-ape", metavar="M", callback=_metres, help="Exit 4 if the translation's RMSE is more."),
    click.option("--max-yaw", metavar="ANGLE", callback=_radians, help="Exit 4 if the yaw's RMSE is more."),
    click.option("--max-error", metavar="M", callback=_metres, help="Exit 4 if the largest translation error is more."),
    click.option("--max-rpe", metavar="M", callback=_number, help="Exit 4 if the RMSE of the drift per metre is more."),
    click.option(
        "--max-losses",
        metavar="N",
        type=click.IntRange(min=0),
        help="Exit 4 if the robot was lost more often, or throughout.",
    ),
    click.option("--max-convergence", metavar="S", callback=_seconds, help="Exit 4 if it converged later, or never."),
    click.option(
        "--max-anees", metavar="X", callback=_number, help="Exit 4 if the ANEES is more: the covariances are too small."
    ),
    click.option(
        "--min-within",
        metavar="SHARE,M",
        callback=share_within,
        help="Exit 4 if a smaller share of the poses is that near.",
    ),
    click.option(
        "--min-ellipse",
        metavar="SHARE",
        callback=share,
        help="Exit 4 if a smaller share of the updates is inside its 95 % ellipse.",
    ),
    click.option(
        "--min-coverage",
        metavar="SHARE",
        callback=share,
        help="Exit 4 if the reference covers a smaller share of the track.",
    ),
)

eval_options = options.all_of(
    click.argument("tracks", metavar="TRACK...", shell_complete=completion.files, nargs=-1, required=True),
    click.option(
        "--truth",
        required=True,
        metavar="REFERENCE",
        help="FILE.tum, a CSV with stamp, x, y, yaw, LOG:TOPIC or LOG:tf:FRAME[:CHILD].",
    ),
    click.option(
        "--truth-sd",
        metavar="XY,YAW",
        callback=parse_deviations,
        help="Standard deviations of the reference, such as 3cm,0.5deg: its part of the error.  [default: 0,0]",
    ),
    click.option("--json", "as_json", is_flag=True, help="Print everything as JSON: metres, radians, seconds."),
    click.option(
        "--picture",
        metavar="F.png",
        shell_complete=completion.files,
        callback=parse_picture,
        help="Draw the tracks over the reference, and errors over time.",
    ),
    click.option("--map", "map_file", type=click.Path(path_type=Path), help="Map to draw beneath, a map_server YAML."),
    click.option(
        "--map-frame",
        metavar="FRAME",
        default="",
        help="Frame to which poses of a log are brought by its transforms.  [default: that of the log's map, or map]",
    ),
    click.option("--align", is_flag=True, help="Move each track rigidly in the plane to where it fits best."),
    click.option(
        "--strict",
        is_flag=True,
        help="Refuse rows out of order, stamps there twice, quaternions of another length than 1, damaged logs.",
    ),
    click.option(
        "--associate",
        type=click.Choice(get_args(Method)),
        default="interpolate",
        show_default=True,
        help="Reference interpolated at each pose, or the nearest pose of it, as evo does.",
    ),
    click.option(
        "--max-gap",
        "max_gap_ns",
        metavar="S",
        default="2",
        show_default=True,
        callback=_nanoseconds,
        help="Longest gap to interpolate.",
    ),
    click.option(
        "--max-diff",
        "max_diff_ns",
        metavar="S",
        default="0.01",
        show_default=True,
        callback=_nanoseconds,
        help="For nearest: largest difference of stamps.",
    ),
    click.option(
        "--converged",
        callback=parse_rule,
        metavar="M,ANGLE,S",
        help="Bounds of the errors, and how long they must hold.  [default: 0.5,10deg,10; 3 poses]",
    ),
    click.option(
        "--lost",
        callback=parse_rule,
        metavar="M,ANGLE,S",
        help="Bounds that an error must exceed, and for how long.  [default: 1,30deg,2; 3 poses]",
    ),
    click.option(
        "--seed",
        metavar="N",
        type=click.IntRange(min=0, max=2**64 - 1),
        default=0,
        show_default=True,
        help="Seed of the bootstrap.",
    ),
    limit_options,
    options.map_limits,
    options.common,
)
