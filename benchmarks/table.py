"""Prints the table of docs/performance.md: ``python -m benchmarks.table [--stream GB] [PART...]``.

Run from the repository's root, with mcl and its extra ``bench`` installed in this interpreter's environment. Times are
the least of many, ratios the median of pairs in alternation.
"""

from __future__ import annotations

import argparse
import datetime as dt
import platform
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import fields, particles, runs, scoring
from benchmarks.measure import table
from mclcli.native.backend import load

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.measure import Row

HEAD = ("what", "measured", "target", "against, in the same run")
PARTS: dict[str, Callable[[], list[Row]]] = {
    "field": scoring.likelihood_field,
    "beam": lambda: [*scoring.beam_mixture(), scoring.bearings()],
    "particles": particles.rows,
    "distance": lambda: [*fields.exact(), fields.cached()],
    "threads": lambda: [scoring.threads()],
    "runs": runs.scans,
    "start": runs.start_up,
    "memory": lambda: [runs.memory()],
}


def main() -> None:
    """Measure and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--stream", type=float, default=0.0, help="also run over a log of so many gigabytes")
    options.add_argument("parts", nargs="*", default=list(PARTS), help=", ".join(PARTS))
    chosen = options.parse_args()
    for name in ("likelihood_field", "particles", "trigonometry"):
        load(name)
    rows = [row for part in chosen.parts for row in PARTS[part]()]
    if chosen.stream:
        rows.append(runs.stream(chosen.stream))
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "llvmlite"))
    print(f"{dt.datetime.now(dt.UTC):%Y-%m-%d}, {_processor()}, Python {platform.python_version()}, {versions}\n")
    print(table(rows, HEAD))


def _processor() -> str:
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
            return next(line.partition(":")[2].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.machine()


if __name__ == "__main__":
    main()
