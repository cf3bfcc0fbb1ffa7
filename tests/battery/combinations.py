"""Profiles × models × commands × switches over ordinary and odd scans: a result, or one line that says why not."""

from __future__ import annotations

import itertools
import math
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tests.battery import content
from tests.battery.bases import mcap_log
from tests.battery.drives import Drive, edited
from tests.battery.harness import CRASH, WRONG, Case, Verdict
from tests.battery.outcome import unclean
from tests.cli.support import mcl
from tests.io.logs import seeded

if TYPE_CHECKING:
    from pathlib import Path

    from tests.battery.drives import Edit

NAN, INF, LARGEST = math.nan, math.inf, 3e38
CASES = 600
CODES = {0, 1, 2, 5}  # a result, a refusal, places that compete
PROFILES = ("textbook", "nav2", "beluga")
MODELS = ("likelihood_field", "likelihood_field_prob", "beam")
SWITCHES = (
    *((), ("max_range=as_read",), ("max_range=score",), ("max_range=as_read", "beam_origin=base")),
    *(("max_range=as_read", "field_lookup=bilinear"), ("field_lookup=bilinear",), ("do_beamskip=true",)),
    *(("raycast=approximate",), ("raycast=bresenham_nav2", "short_range=max"), ("off_map=uniform",)),
    *(("no_return=censored",), ("field_unknown=uniform", "obstacles=boundary"), ("laser_max_range=2",)),
)
_FEW = ("--particles", 50)
COMMANDS: dict[str, tuple[object, ...]] = {
    "score": ("score", "--index", 5, "--around", content.INIT, "-n", 200),
    "explain": ("score", "--index", 5, "--pose", content.INIT, "--explain"),
    "locate": ("locate", "--index", 5),
    "locate joined": ("locate", "--index", 20, "--window", 2),
    "run": ("run", "--init", content.INIT, *_FEW),
    "run many": ("run", "--init", content.INIT, "--particles", 20_000, "--duration", 2),  # compiled
    "run global": ("run", "--init", "global", *_FEW),
    "run uniform": ("run", "--init", "uniform", *_FEW),
    "recovery": ("run", "--init", content.INIT, "--recovery", "locate", *_FEW),
    "deskew": ("run", "--init", content.INIT, "--deskew", *_FEW),
}


class Odd(NamedTuple):
    """What is done to scans: fields that are set, and what becomes of readings whose number divides by ``every``."""

    fields: dict[str, float]
    reading: float | None = None
    every: int = 1
    scans: int = 1


ODD: dict[str, Odd] = {
    "ordinary": Odd({}),
    "a quarter without return": Odd({}, INF, 4),
    "one scan in three without any": Odd({}, INF, 1, 3),
    "no return at all": Odd({}, INF),
    "no number": Odd({}, NAN, 3),
    "nothing but NaN": Odd({}, NAN),
    "too near": Odd({}, -INF, 3),
    "far beyond": Odd({}, LARGEST, 5),
    "below zero": Odd({}, -LARGEST, 5),
    "zeros": Odd({}, 0.0),
    "at an angle of 3e38": Odd({"angle_min": LARGEST}, None, 1, 3),
    "steps of 3e38": Odd({"angle_increment": LARGEST}, None, 1, 3),
    "steps of NaN": Odd({"angle_increment": NAN}, None, 1, 3),
    "no bound": Odd({"range_max": INF}),
    "the largest bound": Odd({"range_max": LARGEST}, INF, 4),
    "no least range": Odd({"range_min": NAN}),
    "beams an age apart": Odd({"time_increment": LARGEST}),
    "beams at no time": Odd({"time_increment": NAN}),
}


def cases(seed: int, share: float) -> list[Case]:
    """A share of all combinations, drawn anew by every seed."""
    every = list(itertools.product(ODD, COMMANDS, PROFILES, MODELS, SWITCHES))
    chosen = seeded(f"{seed} combinations").sample(every, max(1, round(CASES * share)))
    return [
        Case(f"{odd}, {command}: {p} {m} {' '.join(s)}", partial(check, odd, command, p, m, s))
        for odd, command, p, m, s in chosen
    ]


def check(odd: str, command: str, profile: str, model: str, switches: tuple[str, ...], folder: Path) -> Verdict:
    """One command over the drive with its scans changed."""
    (folder / "x.mcap").write_bytes(mcap_log("cdr", edited(Drive(odd, "/scan", edit_of(ODD[odd])))))
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    name, *words = COMMANDS[command]
    output = "--track" if name == "run" else "-o"
    named = [] if "--explain" in words else [output, folder / "out.csv"]
    chosen = ["--map", folder / "room.yaml", "--profile", profile, "--model", model, *named]
    result = mcl(name, folder / "x.mcap", *words, *chosen, *(word for s in switches for word in ("--set", s)))
    problems = unclean(result)
    if result.code not in CODES:
        problems.append((CRASH if result.code == 70 else WRONG, f"ended with {result.code}: {result.err[-400:]}"))
    elif result.code in {1, 2} and result.err.count("mcl: error: ") != 1:
        problems.append((WRONG, f"does not say in one line why not: {result.err[-400:]!r}"))
    if "out of memory" in result.err:
        problems.append((WRONG, result.err[-400:]))
    return Verdict(problems, {f"exit {result.code}": 1})


def edit_of(odd: Odd) -> Edit:
    """The edit that makes scans odd."""

    def edit(message: Any, number: int) -> None:
        if number % odd.scans:
            return
        for key, value in odd.fields.items():
            setattr(message, key, value)
        if odd.reading is not None:
            ranges = message.ranges.copy()
            ranges[:: odd.every] = np.float32(odd.reading)
            message.ranges = ranges

    return edit
