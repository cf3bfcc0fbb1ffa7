"""``python -m tests.mutants PACKAGE... [--sample N] [--seed S]``: how many faults the nearest tests notice.

PACKAGE is one of mclcli's, such as ``filter``, or one of its files, such as ``sensors/endpoints.py``. Survivors are
printed as changed lines; those that ``equivalent.toml`` explains are counted apart.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import sys
import tempfile
import tomllib
from collections import Counter
from pathlib import Path

from tests.mutants.mutations import Mutant, mutants
from tests.mutants.running import ROOT, SURVIVED, TIMEOUT, Scratch

EXPLAINED = "explained"


def explained() -> set[tuple[str, str, str]]:
    """Changes that change no result: file, line before, line after."""
    table = tomllib.loads((Path(__file__).parent / "equivalent.toml").read_text())
    return {(one["file"], one["old"], one["new"]) for one in table["mutant"]}


def draw(packages: list[str], count: int, seed: int) -> list[tuple[str, Mutant]]:
    """A sample of the mutants of some packages or files, in the order of their text."""
    found = []
    for package in packages:
        place = ROOT / "mclcli" / package
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            module = str(path.relative_to(ROOT / "mclcli"))
            found += [(module, mutant) for mutant in mutants(path.read_text())]
    chosen = random.Random(seed).sample(range(len(found)), min(count, len(found)))  # noqa: S311
    return [found[number] for number in chosen]


def main() -> int:
    """Judge a sample, or what Ctrl-C leaves of it, and print what survived; 1 if more than a tenth did, unexplained."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("packages", nargs="+", metavar="PACKAGE")
    parser.add_argument("--sample", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    preload()
    known, ends = explained(), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, contextlib.suppress(KeyboardInterrupt):
        scratch = Scratch.make(Path(folder))
        for module, mutant in draw(options.packages, options.sample, options.seed):
            source = scratch.read(module)
            change = mutant.change(source)
            end = EXPLAINED if (module, *change) in known else scratch.judge(module, mutant.apply(source))
            ends[end] += 1
            if ends.total() % 20 == 0:
                say(f"{ends.total()} of {options.sample}")
            if end in {SURVIVED, TIMEOUT}:
                say(f"{end} {module}:{mutant.line} {mutant.kind}", f"  - {change[0]}", f"  + {change[1]}")
    told = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    say(f"{' '.join(options.packages)}, seed {options.seed}: {ends.total()} mutants: {told}")
    return int(10 * ends[SURVIVED] > ends.total())


def preload() -> None:
    """Libraries that every test needs and no mutant touches: forks have them at once."""
    import click
    import hypothesis.extra.numpy
    import numpy as np
    import PIL.Image
    import pytest

    del click, hypothesis, np, PIL, pytest


def say(*lines: str) -> None:
    """Print, at once."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
