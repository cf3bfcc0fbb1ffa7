"""``python -m tests.battery``: runs the classes, prints a table, and fails if anything was found."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING

from tests.battery import harness
from tests.battery.classes import CLASSES
from tests.battery.harness import ALTERATION, CRASH, HANG, LARGE, LOSS, WRONG, Case, Ended, Tally

if TYPE_CHECKING:
    from collections.abc import Sequence

QUICK = 0.01
KINDS = (CRASH, HANG, LARGE, LOSS, ALTERATION, WRONG)


def main(words: Sequence[str] | None = None) -> int:
    """Run what was asked for; 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.battery", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of all damage")
    parser.add_argument("--quick", action="store_true", help=f"only 1 in {1 / QUICK:.0f} of each class")
    parser.add_argument("--only", action="append", choices=list(CLASSES), help="one class; repeatable")
    parser.add_argument("--verbose", action="store_true", help="print every case")
    asked = parser.parse_args(words)
    broken = 0
    print(_line("class", "cases", *KINDS, "longest", "memory", "what came out"))
    with harness.quiet_cache():
        harness.preload()
        for name, make in CLASSES.items():
            if asked.only and name not in asked.only:
                continue
            began = time.monotonic()
            tally = harness.run_cases(
                make(asked.seed, QUICK if asked.quick else 1.0), _tell if asked.verbose else _say_nothing
            )
            broken += len(tally.problems)
            print(_row(name, tally), flush=True)
            for case, kind, what in tally.problems[:20]:
                print(f"    {kind}: {case}: {what}", file=sys.stderr)
            wall = time.monotonic() - began
            print(f"    {name}: {wall:.0f} s; slowest {tally.slowest}; largest {tally.largest}", file=sys.stderr)
    return 1 if broken else 0


def _row(name: str, tally: Tally) -> str:
    figures = ", ".join(f"{what} {count}" for what, count in sorted(tally.figures.items()))
    counts = (tally.count(kind) for kind in KINDS)
    return _line(name, tally.cases, *counts, f"{tally.seconds:.2f} s", f"{tally.mib:.0f} MiB", figures)


def _line(name: object, *cells: object) -> str:
    return f"| {name} | " + " | ".join(map(str, cells)) + " |"


def _tell(case: Case, ended: Ended) -> None:
    print(f"    {case.name}: {ended.seconds:.2f} s, {ended.mib:.0f} MiB, {ended.verdict}"[:400], file=sys.stderr)


def _say_nothing(case: Case, ended: Ended) -> None:
    del case, ended


if __name__ == "__main__":
    sys.exit(main())
