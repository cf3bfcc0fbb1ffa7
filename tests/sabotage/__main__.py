"""``python -m tests.sabotage``: applies the patches one by one, prints a table, and fails if one was not noticed."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from tests.sabotage import scratch
from tests.sabotage.patches import PATCHES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tests.sabotage.scratch import Patch

_FAILED = 1  # pytest's code for tests that failed; others say that it did not get so far


def main(words: Sequence[str] | None = None) -> int:
    """Try what was asked for; 1 if a patch was not noticed, or its test fails without it."""
    parser = argparse.ArgumentParser(prog="python -m tests.sabotage", description=__doc__)
    parser.add_argument("--only", action="append", help="patches with this text in what they break; repeatable")
    asked = parser.parse_args(words)
    chosen = [patch for patch in PATCHES if not asked.only or any(text in patch.breaks for text in asked.only)]
    missed = 0
    print("| what the patch breaks | in | noticed by | seconds |\n|---|---|---|---|", flush=True)
    with scratch.copy() as folder:
        healthy = {test: scratch.test(test, folder) for test in dict.fromkeys(patch.noticed_by for patch in chosen)}
        for test, outcome in healthy.items():
            if outcome.code != 0:
                print(f"{test} ends with {outcome.code} without any patch:\n{outcome.tail}", file=sys.stderr)
                missed += 1
        for patch in chosen:
            missed += not noticed(patch, folder)
    print(f"{len(chosen)} patches, {missed} not noticed")
    return 1 if missed else 0


def noticed(patch: Patch, folder: Path) -> bool:
    """Apply one patch and run its test; whether it failed."""
    try:
        with scratch.patched(patch, folder):
            outcome = scratch.test(patch.noticed_by, folder)
    except scratch.StalePatchError as error:
        print(error, file=sys.stderr)
        return False
    seen = outcome.code == _FAILED or outcome.code < 0
    by = f"`{patch.noticed_by}`" if seen else f"**nobody** (pytest ended with {outcome.code})"
    print(f"| {patch.breaks} | `{patch.file}` | {by} | {outcome.seconds:.0f} |", flush=True)
    return seen


if __name__ == "__main__":
    sys.exit(main())
