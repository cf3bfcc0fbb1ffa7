"""Cost against size: ``python -m benchmarks.sweep [PICTURE]``, by default docs/pictures/cost.png.

Particles from 10² to 10⁶, beams from 10 to 1,000, maps from 200² to 8,000², one at a time around 10,000 × 60 on 2,000².
Needs matplotlib, of the extra ``bench``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.fields import walls
from benchmarks.measure import timed
from benchmarks.scoring import concentrated, uniform
from mclcli.world import distance_field

if TYPE_CHECKING:
    from collections.abc import Callable

PARTICLES, BEAMS, SIDES = 10_000, 60, 2000
NUMBERS = {
    "particles": (100, 300, 1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000),
    "beams": (10, 30, 60, 100, 300, 1000),
    "cells a side": (200, 500, 1000, 2000, 4000, 8000),
}


def least(task: Callable[[], object]) -> float:
    """Least seconds of several calls, of fewer if they are long."""
    once = timed(task)
    first = once()
    return min(first, *(once() for _ in range(2 if first > 1.0 else 9)))


def measure() -> dict[str, dict[str, list[float]]]:
    """Milliseconds by what is varied and by what is done."""
    found: dict[str, dict[str, list[float]]] = {}
    found["particles"] = {
        "scoring, concentrated": [1e3 * least(concentrated(n, BEAMS).score()) for n in NUMBERS["particles"]],
        "scoring, all over": [1e3 * least(uniform(n, BEAMS, SIDES).score()) for n in NUMBERS["particles"]],
    }
    found["beams"] = {
        "scoring, concentrated": [1e3 * least(concentrated(PARTICLES, k).score()) for k in NUMBERS["beams"]],
        "scoring, all over": [1e3 * least(uniform(PARTICLES, k, SIDES).score()) for k in NUMBERS["beams"]],
    }
    found["cells a side"] = {
        "scoring, all over": [1e3 * least(uniform(PARTICLES, BEAMS, side).score()) for side in NUMBERS["cells a side"]],
        "exact distance field": [1e3 * least(_field(side)) for side in NUMBERS["cells a side"]],
    }
    return found


def _field(side: int) -> Callable[[], object]:
    grid = walls(side)
    return lambda: distance_field.compute(grid, "exact", 2.0)


def draw(found: dict[str, dict[str, list[float]]], path: Path) -> None:
    """Three log-log plots side by side."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, axes = plt.subplots(1, 3, figsize=(12, 4), sharey=True, layout="constrained")
    for ax, (varied, lines) in zip(axes, found.items(), strict=True):
        for name, values in lines.items():
            ax.loglog(NUMBERS[varied], values, marker="o", markersize=3, label=name)
        ax.set_xlabel(varied)
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.grid(visible=True, which="major", alpha=0.3)
        ax.legend(frameon=False)
    axes[0].set_ylabel("ms")
    figure.savefig(path, dpi=90, metadata={"Software": None})


def main() -> None:
    """Measure, print and draw."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/cost.png")
    found = measure()
    for varied, lines in found.items():
        for name, values in lines.items():
            pairs = zip(NUMBERS[varied], values, strict=True)
            print(f"{name}, by {varied}: " + ", ".join(f"{n:,}: {value:.3g} ms" for n, value in pairs))
    draw(found, path)


if __name__ == "__main__":
    main()
