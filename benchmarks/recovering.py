"""What recovery costs robots that are not lost: ``python -m benchmarks.recovering [--data FOLDER] [--seeds N]``.

Each log tracked from its reference with recovery off, ``locate`` and ``uniform``; medians over the seeds, and the worst
ratio to the error of the same seed without recovery. What it does for robots that are lost: ``locate_filter``.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from benchmarks.accuracy import CASES, SAMPLES, Case, Loaded, rmse
from mclcli.cli.searching import global_search
from mclcli.replay.finder import FoundAgain

if TYPE_CHECKING:
    from mclcli.filter.recovery import Proposal
    from mclcli.records import TrackPoint

WEAN = {
    f"wean{number}": Case(f"wean/wean{number}.mcap", f"wean/wean{number}.smooth.tum", "wean/wean.yaml")
    for number in (1, 3)
}
_LOGS = ("office sample", "warehouse sample", "trace0", "trace0, a wing missing", "wean1", "wean3", "intel")
_WAYS = ("off", "locate", "uniform")


def runs(loaded: Loaded, way: str, seeds: int, seconds: float) -> tuple[np.ndarray, float]:
    """Errors [m] (S,) of the seeds, and the share of the particles that was drawn anew."""
    settings = mcl.settings({"hypotheses": 0, "recovery": way})
    proposal: Proposal | None = None
    if way == "locate":
        grid = mcl.load_map(loaded.data / loaded.case.grid)
        proposal = FoundAgain(global_search(settings, grid, None), grid)
    errors, shares = [], []
    for seed in range(seeds):
        setup = loaded.setup(settings, seed)
        first = int(loaded.reference.stamps_ns[0])
        setup = replace(setup, window_ns=(first, first + int(seconds * 1e9)))
        points: list[TrackPoint] = loaded.run(replace(setup, proposal=proposal) if proposal else setup)
        errors.append(rmse(loaded.errors(points)))
        steps = [point.step for point in points if point.step]
        shares.append(sum(step.injected for step in steps) / sum(len(step.weights) for step in steps))
    return np.array(errors), float(np.median(shares))


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--logs", nargs="+", default=list(_LOGS))
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument("--seconds", type=float, default=1e6, help="of each log, from its reference's start")
    options.add_argument("--ways", nargs="+", default=list(_WAYS))
    chosen = options.parse_args()
    print("| log | recovery | RMSE, median [m] | worst seed [m] | of that without | drawn anew |\n" + "|---" * 6 + "|")
    for name in chosen.logs:
        case, data = (SAMPLES[name], Path()) if name in SAMPLES else ({**CASES, **WEAN}[name], chosen.data)
        if not (data / case.log).exists():
            continue
        loaded = Loaded.of(case, data)
        plain = np.inf
        for way in chosen.ways:
            errors, share = runs(loaded, way, chosen.seeds, chosen.seconds)
            middle = float(np.median(errors))
            plain = middle if way == "off" else plain
            numbers = f"{middle:.3f} | {errors.max():.3f} | {middle / plain:.2f} | {share:.2%}"
            print(f"| {name} | {way} | {numbers} |", flush=True)


if __name__ == "__main__":
    main()
