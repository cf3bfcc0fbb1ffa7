"""``mcl eval``: tracks against a reference."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mclcli.cli.eval.options import EvalOptions, eval_options, expand
from mclcli.cli.options import into
from mclcli.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.evaluate.evaluation import Evaluation, Protocol
    from mclcli.evaluate.spread import Spread
    from mclcli.geometry.trajectory import Trajectory

_SPARSE = 0.9  # coverage below which the user is warned


@click.command("eval", short_help="Errors of tracks against a reference, with limits for CI.")
@eval_options
@into(EvalOptions)
def command(options: EvalOptions) -> ExitCode:
    """Evaluate each TRACK: a track CSV of `mcl run`, a TUM file, - for either on stdin, or LOG:TOPIC.

    Nothing is aligned unless --align asks for it. Several tracks, of several seeds say, are summed up as well: median
    and mean with bootstrap bands. Patterns such as 'out/*.csv' may be quoted. Limits hold for every track.
    """
    from mclcli.cli import console
    from mclcli.evaluate.limits import missed
    from mclcli.io.traces.output import open_output

    names = expand(options.tracks)
    if options.truth == "-" and "-" in names:
        raise UsageError("--truth -: standard input holds the track already; name a file")
    protocol, inputs = options.protocol, options.input_files(names)
    if options.picture:
        open_output(options.picture, binary=True, inputs=inputs)  # refuses now, not at the end
    truth, damaged = _read(options.truth, options)
    evaluations = []
    for name in names:
        track, lossy = _read(name, options)
        damaged = damaged or lossy
        evaluations.append(_evaluate(track, truth, protocol, name))
    complaints = [(e.name, sentence) for e in evaluations for sentence in missed(e, options.limits)]
    _print(options, evaluations, complaints)
    if options.picture:
        _draw(options, options.picture, inputs, evaluations, truth)
    for e in evaluations:
        if e.coverage < _SPARSE and not complaints:
            console.warn(f"{e.name}: the reference covers {100 * e.coverage:.1f} % of the poses; the rest is unknown")
    for name, sentence in complaints:
        console.error(f"{name}: {sentence}")
    if complaints:
        return ExitCode.MISSED
    return ExitCode.DAMAGED if damaged else ExitCode.COMPLETE


def _read(source: str, options: EvalOptions) -> tuple[Trajectory, bool]:
    """A track or reference in the map's frame; what --align moves anyway stays as it is stated."""
    from mclcli.io.recording.recorded_poses import read_checked

    cure = "--map-frame {frame} says that it is the map's, --align fits poses in a frame of their own"
    return read_checked(
        source, strict=options.strict, map_frame_id=options.map_frame, as_stated=options.align, cure=cure
    )


def _evaluate(track: Trajectory, truth: Trajectory, protocol: Protocol, name: str) -> Evaluation:
    from mclcli.errors import InputError
    from mclcli.evaluate.evaluation import evaluate

    name = "standard input" if name == "-" else name
    try:
        return evaluate(track, truth, protocol, name)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _print(
    options: EvalOptions,
    evaluations: Sequence[Evaluation],
    complaints: Sequence[tuple[str, str]],
) -> None:
    """Everything found, on standard output."""
    from mclcli.evaluate.spread import spreads
    from mclcli.io.traces.output import open_output

    protocol = options.protocol
    several = spreads(evaluations, options.seed) if len(evaluations) > 1 else {}
    if options.as_json:
        text = json.dumps(_facts(options.truth, evaluations, protocol, several, complaints), indent=2)
    else:
        text = _report(options.truth, evaluations, protocol, several)
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

    together = consistency_over_runs([e.pairs for e in evaluations], protocol.truth_sd)
    return {
        "truth": truth,
        "protocol": asdict(protocol),
        "tracks": [as_plain(e) for e in evaluations],
        "summary": {name: asdict(found) for name, found in several.items()} or None,
        "anees_over_tracks": None if together is None else asdict(together),
        "missed": [{"track": name, "limit": sentence} for name, sentence in complaints],
    }


def _draw(
    options: EvalOptions, target: str, inputs: Sequence[Path], evaluations: Sequence[Evaluation], truth: Trajectory
) -> None:
    from mclcli.cli import pictures
    from mclcli.cli.eval.pictures import picture_of

    grid = None if options.map_file is None else options.map_limits.load(options.map_file)
    pictures.save(picture_of(grid, evaluations, truth, Path(options.truth).name, options.protocol), target, inputs)
