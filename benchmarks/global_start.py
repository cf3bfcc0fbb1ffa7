"""A start anywhere on the map with plain particles: ``python -m benchmarks.global_start [LOG…]``.

Found: within 0.5 m and 10° at every scan of the last quarter of the first minutes (Intel: 300 scans, samples: all).
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import mclcli as mcl
from benchmarks.accuracy import CASES, SAMPLES, Loaded

if TYPE_CHECKING:
    from mclcli.settings.profiles import Settings

_LOGS = ("intel", "office sample", "warehouse sample")
_SCANS = 300


def found(loaded: Loaded, settings: Settings, seed: int) -> bool:
    """Whether one run ends where the robot is."""
    grid = mcl.load_map(loaded.data / loaded.case.grid)
    setup = loaded.setup(settings, seed, mcl.Anywhere(grid))
    points = []
    for point in mcl.replay(loaded.events(frozenset(setup.topics)), setup):
        points.append(point)
        if len(points) == _SCANS:
            break
    return bool((loaded.errors(points)[-len(points) // 4 :] < 0.5).all())


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("logs", nargs="*", default=list(_LOGS))
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--seeds", type=int, default=20, help="seeds 0 to N−1")
    options.add_argument("--particles", type=int, nargs="+", default=[5000, 20_000, 100_000])
    chosen = options.parse_args()
    print("| log | particles | found |\n|---|---|---|")
    for name in chosen.logs:
        case, data = (CASES[name], chosen.data) if name in CASES else (SAMPLES[name], Path())
        loaded = Loaded.of(case, data)
        for number in chosen.particles:
            settings = mcl.settings({"particles": number, "hypotheses": 0})
            total = sum(found(loaded, settings, seed) for seed in range(chosen.seeds))
            print(f"| {name} | {number} | {total} of {chosen.seeds} |", flush=True)


if __name__ == "__main__":
    main()
