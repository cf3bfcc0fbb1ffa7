"""The reliability figure of robots that are tracked and of lost ones: ``python -m benchmarks.lost [--data FOLDER]``.

Lost ones are begun around poses drawn from the free cells of the map, where the filter has to believe them.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from benchmarks.accuracy import CASES, Loaded
from mclcli.filter import particles
from mclcli.filter.fit import PROBABLY_LOST
from mclcli.filter.start import GIVEN_SPREAD

if TYPE_CHECKING:
    from mclcli.records import TrackPoint

_LOGS = ("intel", "olin", "trace0", "simpath2", "trace0, a wing missing")
_RIGHT, _WRONG = 0.3, 1.0  # [m]


def judged(loaded: Loaded, points: list[TrackPoint]) -> tuple[np.ndarray, np.ndarray]:
    """Reliability of every update, and the error of position [m] there."""
    updated = [point for point in points if point.step]
    return np.array([point.step.reliability for point in updated if point.step]), loaded.errors(updated)


def lines(name: str, loaded: Loaded, lost: int) -> list[str]:
    """Rows of the table for one log: tracked, and lost."""
    settings = mcl.settings({"hypotheses": 0})
    tracked = judged(loaded, loaded.run(loaded.setup(settings, 0)))
    runs = [tracked]
    grid = mcl.load_map(loaded.data / loaded.case.grid)
    for pose in particles.uniform(grid, lost, np.random.default_rng(0)):
        start = mcl.AroundPose(pose, GIVEN_SPREAD)
        runs.append(judged(loaded, loaded.run(loaded.setup(settings, 0, start))))
    fits, errors = (np.concatenate(parts) for parts in zip(*runs, strict=True))
    groups = {"within 0.3 m": errors < _RIGHT, "more than 1 m off": errors > _WRONG}
    return [_row(f"{name}, {what}", fits[chosen]) for what, chosen in groups.items() if chosen.any()]


def _row(name: str, fits: np.ndarray) -> str:
    shares = " | ".join(f"{value:.2f}" for value in np.percentile(fits, [1, 5, 50, 95, 99]))
    return f"| {name} | {fits.size} | {shares} | {100 * np.mean(fits < PROBABLY_LOST):.1f} % |"


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--lost", type=int, default=10, help="wrong starts per log")
    chosen = options.parse_args()
    head = f"| updates | number | 1 % | 5 % | median | 95 % | 99 % | below {PROBABLY_LOST:g} |"
    print(f"{head}\n|---|---|---|---|---|---|---|---|")
    for name in _LOGS:
        for line in lines(name, Loaded.of(CASES[name], chosen.data), chosen.lost):
            print(line, flush=True)


if __name__ == "__main__":
    main()
