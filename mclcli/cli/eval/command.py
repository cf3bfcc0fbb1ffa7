"""``mcl eval``: tracks against a reference."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mclcli.cli import options
from mclcli.cli.eval import options as eval_options
from mclcli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.evaluate.evaluation import Evaluation, Protocol
    from mclcli.evaluate.spread import Spread
    from mclcli.geometry.trajectory import Trajectory

DAMAGED, MISSED = 3, 4
_SPARSE = 0.9  # coverage below which the user is warned

_metres, _radians, _seconds, _number = (eval_options.quantity(unit) for unit in ("m", "rad", "s", ""))


@click.command("eval", short_help="Errors of tracks against a reference, with limits for CI.")
@click.argument("tracks", metavar="TRACK...", nargs=-1, required=True)
@click.option(
    "--truth",
    required=True,
    metavar="REFERENCE",
    help="FILE.tum, a CSV with stamp, x, y, yaw, LOG:TOPIC or LOG:tf:FRAME.",
)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON: metres, radians, seconds.")
@click.option("--picture", metavar="F.png", help="Draw the tracks over the reference, and errors over time.")
@click.option("--map", "map_file", type=click.Path(path_type=Path), help="Map to draw beneath, a map_server YAML.")
@click.option("--align", is_flag=True, help="Move each track rigidly in the plane to where it fits best.")
@click.option(
    "--associate",
    type=click.Choice(["interpolate", "nearest"]),
    default="interpolate",
    show_default=True,
    help="Reference interpolated at each pose, or the nearest pose of it, as evo does.",
)
@click.option(
    "--max-gap", metavar="S", default="2", show_default=True, callback=_seconds, help="Longest gap to interpolate."
)
@click.option(
    "--max-diff", metavar="S", default="0.01", show_default=True, callback=_seconds, help="For nearest: how far apart."
)
@click.option(
    "--converged", metavar="M,ANGLE,S", help="Errors below these, for so long.  [default: 0.5,10deg,10; 3 poses]"
)
@click.option("--lost", metavar="M,ANGLE,S", help="An error above these, for so long.  [default: 1,30deg,2; 3 poses]")
@click.option(
    "--seed",
    metavar="N",
    type=click.IntRange(min=0, max=2**64 - 1),
    default=0,
    show_default=True,
    help="Seed of the bootstrap.",
)
@click.option("--max-ape", metavar="M", callback=_metres, help="Exit 4 if the translation's RMSE is more.")
@click.option("--max-yaw", metavar="ANGLE", callback=_radians, help="Exit 4 if the yaw's RMSE is more.")
@click.option("--max-error", metavar="M", callback=_metres, help="Exit 4 if the largest translation error is more.")
@click.option("--max-rpe", metavar="M", callback=_number, help="Exit 4 if the RMSE of the drift per metre is more.")
@click.option(
    "--max-losses",
    metavar="N",
    type=click.IntRange(min=0),
    help="Exit 4 if the robot was lost more often, or throughout.",
)
@click.option("--max-convergence", metavar="S", callback=_seconds, help="Exit 4 if it converged later, or never.")
@click.option("--max-anees", metavar="X", callback=_number, help="Exit 4 if the covariances are more overconfident.")
@click.option(
    "--min-within", metavar="SHARE,M", callback=eval_options.share_within, help="Exit 4 if fewer poses are that near."
)
@click.option(
    "--min-coverage", metavar="SHARE", callback=eval_options.share, help="Exit 4 if the reference covers less."
)
@options.map_limits
@options.threads
@options.common
def command(**arguments: Any) -> int:
    """Evaluate each TRACK: a track CSV of `mcl run`, a TUM file, - for either on stdin, or LOG:TOPIC.

    Nothing is aligned unless --align asks for it. Several tracks, of several seeds say, are summed up as well: median
    and mean with bootstrap bands. Patterns such as 'out/*.csv' may be quoted. Limits hold for every track.
    """
    from mclcli.cli import console
    from mclcli.evaluate.limits import missed
    from mclcli.io.recording.recorded_poses import read_checked
    from mclcli.io.traces.output import open_output

    names = eval_options.expand(arguments["tracks"])
    if arguments["truth"] == "-" and "-" in names:
        raise UsageError("--truth -: standard input holds the track already; name a file")
    protocol, limits = eval_options.protocol_of(arguments), eval_options.limits_of(arguments)
    if arguments["picture"]:
        open_output(arguments["picture"], binary=True, inputs=_inputs(arguments, names))  # refuses now, not at the end
    truth, damaged = read_checked(arguments["truth"])
    evaluations = []
    for name in names:
        track, lossy = read_checked(name)
        damaged = damaged or lossy
        evaluations.append(_evaluate(track, truth, protocol, name))
    complaints = [(e.name, sentence) for e in evaluations for sentence in missed(e, limits)]
    _print(arguments, evaluations, protocol, complaints)
    if arguments["picture"]:
        _draw(arguments, names, evaluations, truth, protocol)
    for e in evaluations:
        if e.coverage < _SPARSE and not complaints:
            console.warn(f"{e.name}: the reference covers {100 * e.coverage:.1f} % of the poses; the rest is unknown")
    for name, sentence in complaints:
        console.error(f"{name}: {sentence}")
    return MISSED if complaints else DAMAGED if damaged else 0


def _inputs(arguments: dict[str, Any], names: Sequence[str]) -> list[Path]:
    """Files that are read, none of which may be written."""
    from mclcli.io.recording.recorded_poses import split_source

    return [Path(split_source(name)[0]) for name in (*names, arguments["truth"]) if name != "-"]


def _evaluate(track: Trajectory, truth: Trajectory, protocol: Protocol, name: str) -> Evaluation:
    from mclcli.errors import InputError
    from mclcli.evaluate.evaluation import evaluate

    name = "standard input" if name == "-" else name
    try:
        return evaluate(track, truth, protocol, name)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _print(
    arguments: dict[str, Any],
    evaluations: Sequence[Evaluation],
    protocol: Protocol,
    complaints: Sequence[tuple[str, str]],
) -> None:
    """Everything found, on standard output."""
    from mclcli.evaluate.spread import spreads
    from mclcli.io.traces.output import open_output

    several = spreads(evaluations, arguments["seed"]) if len(evaluations) > 1 else {}
    if arguments["as_json"]:
        text = json.dumps(_facts(arguments["truth"], evaluations, protocol, several, complaints), indent=2)
    else:
        text = _report(arguments["truth"], evaluations, protocol, several)
    with open_output("-", binary=False) as output:
        output.write(f"{text}\n")


def _report(truth: str, evaluations: Sequence[Evaluation], protocol: Protocol, several: dict[str, Spread]) -> str:
    """What people read."""
    from mclcli.cli.eval.report import describe, describe_all
    from mclcli.text import clean

    if len(evaluations) == 1:
        return f"{clean(evaluations[0].name)} against {clean(truth)}\n{describe(evaluations[0], protocol)}"
    return f"{len(evaluations)} tracks against {clean(truth)}\n\n{describe_all(evaluations, several, protocol)}"


def _facts(
    truth: str,
    evaluations: Sequence[Evaluation],
    protocol: Protocol,
    several: dict[str, Spread],
    complaints: Sequence[tuple[str, str]],
) -> dict[str, Any]:
    """What --json prints; names of keys are part of it."""
    from dataclasses import asdict

    from mclcli.evaluate.consistency import consistency_over_runs
    from mclcli.evaluate.evaluation import as_plain

    together = consistency_over_runs([e.pairs for e in evaluations])
    return {
        "truth": truth,
        "protocol": asdict(protocol),
        "tracks": [as_plain(e) for e in evaluations],
        "summary": {name: asdict(found) for name, found in several.items()} or None,
        "anees_over_tracks": None if together is None else asdict(together),
        "missed": [{"track": name, "limit": sentence} for name, sentence in complaints],
    }


def _draw(
    arguments: dict[str, Any],
    names: Sequence[str],
    evaluations: Sequence[Evaluation],
    truth: Trajectory,
    protocol: Protocol,
) -> None:
    from mclcli.cli import pictures
    from mclcli.cli.eval.pictures import picture_of
    from mclcli.io.maps.map_yaml import load_map

    grid = None
    if arguments["map_file"] is not None:
        grid = load_map(
            arguments["map_file"], max_cells=arguments["max_cells"], allow_outside=arguments["allow_outside"]
        )
    drawn = picture_of(grid, evaluations, truth, Path(arguments["truth"]).name, protocol)
    pictures.save(drawn, arguments["picture"], _inputs(arguments, names))
