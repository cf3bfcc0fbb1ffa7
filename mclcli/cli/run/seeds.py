"""``mcl run --seeds``: the same run with several seeds, an output of its own for each, and how much they differ."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.cli import console, results
from mclcli.cli.run import report
from mclcli.cli.run.ends import place_text
from mclcli.cli.run.facts import facts_of
from mclcli.errors import ExitCode, UsageError
from mclcli.io.traces.formats import OUTPUTS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.cli.run.options import RunOptions
    from mclcli.cli.run.outcome import Outcome
    from mclcli.evaluate.evaluation import Evaluation

    Replay = Callable[[RunOptions, Callable[[Outcome], None] | None], Outcome]


def run_each(options: RunOptions, replay: Replay) -> ExitCode:
    """Run with every seed in turn, and sum up.

    Raises
    ------
    UsageError
        If an output or the log is a stream, which there is only once.

    """
    seeds = options.seed_numbers
    _refuse_streams(options)
    runs: list[dict[str, Any]] = []
    ends: list[FloatArray] = []
    evaluations: list[Evaluation] = []
    code = ExitCode.COMPLETE
    with console.each_once():
        for seed in seeds:
            own = _for_seed(options, seed)
            outcome = replay(own, lambda done, seed=seed: _tell(seed, done))  # type: ignore[misc]
            code = max(code, outcome.code)
            if outcome.outputs.ends.last is not None:
                ends.append(outcome.outputs.ends.last.pose)
            if outcome.findings.evaluation is not None:
                evaluations.append(replace(outcome.findings.evaluation, name=f"seed {seed}"))
            runs.append(facts_of(outcome, own) if options.as_json else {})
    spread = _spread(ends)
    console.remark(
        f"{len(seeds)} seeds: last poses up to {spread['position']:.2f} m and "
        f"{math.degrees(spread['yaw']):.1f}° from their middle"
    )
    _compare(evaluations)
    if options.as_json:
        results.print_json({"seeds": list(seeds), "last": spread, "truth": _figures(evaluations), "runs": runs})
    return code


def numbered(name: str, seed: int) -> str:
    """Name of an output with the seed before its ending: ``t.csv`` becomes ``t.0007.csv``."""
    path = Path(name)
    known = sorted({ending for endings in OUTPUTS.values() for ending in endings} | {".png"}, key=len, reverse=True)
    ending = next((ending for ending in known if path.name.endswith(ending)), path.suffix)
    stem = path.name.removesuffix(ending) if ending else path.name
    return str(path.with_name(f"{stem}.{seed:04d}{ending}"))


def _for_seed(options: RunOptions, seed: int) -> RunOptions:
    """The options of one of the runs."""
    return replace(
        options,
        seed=seed,
        traces=tuple(numbered(name, seed) for name in options.traces),
        tracks=tuple(numbered(name, seed) for name in options.tracks),
        steps=None if options.steps is None else numbered(options.steps, seed),
        picture=None if options.picture is None else numbered(options.picture, seed),
    )


def _refuse_streams(options: RunOptions) -> None:
    for name in (*options.traces, *options.tracks, options.steps, options.picture):
        if name is not None and (name == "-" or name.startswith(("/dev/", "/proc/"))):
            raise UsageError(f"--seeds writes a file for each seed, {name} is one stream; name a file, such as t.csv")
    for name in options.logs:
        if name == "-" or Path(name).is_fifo():
            raise UsageError(f"--seeds reads the log once for each seed, {name} can be read once; name a file")


def _tell(seed: int, outcome: Outcome) -> None:
    """One line of one run, and its doubts."""
    ends = outcome.outputs.ends
    where = "" if ends.last is None else f"last {place_text(ends.last)}, "
    reliable = f"reliability {ends.reliability:.2f} on average, {ends.least:.2f} at the least"
    error = (
        "" if outcome.findings.evaluation is None else f", RMSE {outcome.findings.evaluation.translation.rmse:.3f} m"
    )
    console.remark(f"seed {seed}: {where}{reliable}{error}")
    for doubt in report.summarise(outcome).doubts:
        console.warn(f"seed {seed}: {doubt}")


def _spread(poses: Sequence[FloatArray]) -> dict[str, Any]:
    """Middle of the last poses (median of x and y, circular mean of yaw), and how far the farthest is from it."""
    ends = np.array(poses, dtype=np.float64).reshape(-1, 3)
    x, y = np.median(ends[:, :2], axis=0)
    yaw = math.atan2(float(np.sin(ends[:, 2]).sum()), float(np.cos(ends[:, 2]).sum()))
    turned = np.abs(np.remainder(ends[:, 2] - yaw + math.pi, 2.0 * math.pi) - math.pi)
    away = np.hypot(ends[:, 0] - x, ends[:, 1] - y)
    return {"middle": results.pose((x, y, yaw)), "position": float(away.max()), "yaw": float(turned.max())}


def _compare(evaluations: Sequence[Evaluation]) -> None:
    """All runs against the reference, as ``mcl eval`` says it of several tracks."""
    if len(evaluations) < 2:
        return
    from mclcli.cli.eval.report import describe_all
    from mclcli.evaluate.evaluation import Protocol
    from mclcli.evaluate.spread import spreads

    console.block(describe_all(evaluations, spreads(evaluations, 0), Protocol()))


def _figures(evaluations: Sequence[Evaluation]) -> dict[str, Any] | None:
    """Median, mean and bands of every figure over the runs, None without a reference."""
    from dataclasses import asdict

    from mclcli.evaluate.spread import spreads

    found = spreads(evaluations, 0) if len(evaluations) > 1 else {}
    return {name: asdict(spread) for name, spread in found.items()} or None
