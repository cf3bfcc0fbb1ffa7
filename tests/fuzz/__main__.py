"""``python -m tests.fuzz``: runs the targets, prints a table, and fails if anything was found."""

from __future__ import annotations

import argparse
import logging
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from tests.fuzz import blocks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.fuzz.engine import Target

# Those that cost the most a time get fewer executions, in this share of the others'.
SHARES = {
    "yaml": 0.2,
    "map": 0.2,
    "parameters": 0.2,
    "launch file": 0.2,
    "scan": 0.2,
    "landmarks": 0.4,
    "db3": 0.3,
    "command line": 0.4,
}


def main(words: Sequence[str] | None = None) -> int:
    """Run what was asked for; 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--executions", type=int, default=150_000, help="of each target; fewer of slow ones")
    parser.add_argument("--seed", type=int, default=0, help="of all changes")
    parser.add_argument("--only", action="append", help="one target; repeatable")
    parser.add_argument("--save", action="store_true", help="make the corpus anew of what reached new code")
    asked = parser.parse_args(words)
    blocks.install("mclcli", without=("mclcli.kernels", "mclcli.native"))
    from tests.fuzz import engine, store

    logging.getLogger("mclcli").addHandler(logging.NullHandler())
    found, total = 0, 0
    print("| target | executions | inputs kept | blocks reached | seconds | longest | finds |", flush=True)
    with tempfile.TemporaryDirectory(prefix="mcl-fuzz-") as folder:
        os.chdir(folder)
        for target in all_targets(Path(folder)):
            if asked.only and target.name not in asked.only:
                continue
            count = round(asked.executions * SHARES.get(target.name, 1.0))
            result = engine.fuzz(target, store.load(target.name), count, asked.seed)
            row = (target.name, result.executions, len(result.kept), result.blocks, f"{result.seconds:.0f}")
            print("| " + " | ".join(map(str, (*row, f"{result.slowest:.2f} s", len(result.finds)))) + " |", flush=True)
            for place, find in result.finds.items():
                print(f"    {place}: {find.data!r}\n{find.what}", file=sys.stderr, flush=True)
            if asked.save:
                finds = [find.data for find in result.finds.values()]
                store.save(target.name, [*engine.fewest(target, result.kept), *finds])
            found, total = found + len(result.finds), total + result.executions
    print(f"{total} executions, {found} finds")
    return 1 if found else 0


def all_targets(folder: Path) -> list[Target]:
    """Every parser of mcl."""
    from tests.fuzz import log_targets, text_targets

    return [*text_targets.targets(folder), *log_targets.targets(folder)]


if __name__ == "__main__":
    sys.exit(main())
