"""Closed logs with whole records cut out or there twice, and summaries altered: only the file's own counts can tell."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from tests.battery import intact
from tests.battery import records as r
from tests.battery.bases import base_logs
from tests.battery.damaged import compare, read_all
from tests.battery.harness import ALTERATION, LOSS, WRONG, Case, Verdict
from tests.battery.outcome import unclean
from tests.cli.support import mcl
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from random import Random

    from tests.battery.bases import Base

EACH = 12
"""Edits of each kind in each base log."""


class Span(NamedTuple):
    """Bytes of a log from ``start`` to ``stop``: a record, or several."""

    start: int
    stop: int


def cases(seed: int, share: float) -> list[Case]:
    """Every kind of edit at places that the seed chooses."""
    found = []
    for base in base_logs():
        if not base.name.endswith((".mcap", ".bag")):
            continue
        kinds: dict[str, Callable[[Base, Random], bytes]] = {"cut out": _cut_out, "twice": _twice}
        if base.name.endswith(".mcap") and base.checked:
            kinds["bit of the summary"] = _summary
        for kind, edit in kinds.items():
            for number in range(max(1, round(EACH * share))):
                title = f"{base.name}, {kind} {number}"
                found.append(Case(title, partial(check, base, kind, edit, f"{seed} {title}")))
    return found


def check(base: Base, kind: str, edit: Callable[[Base, Random], bytes], seed: str, folder: Path) -> Verdict:
    """Edit one log, read it, and ask what was said."""
    data = edit(base, seeded(seed))
    path = folder / base.name
    path.write_bytes(data)
    found, tally = read_all(path)
    problems, figures = compare(base, found, tally, data)
    info = mcl("info", path)
    problems += unclean(info)
    if kind == "bit of the summary":
        if tally.lossy or len(found) != len(base.known):
            problems.append((WRONG, f"{len(found)} messages, and said to be lost: {tally.damages}"))
        if not tally.damages:
            problems.append((ALTERATION, "an altered summary was believed"))
    elif not tally.lossy:
        problems.append((LOSS if kind == "cut out" else ALTERATION, "the file's own count was not compared"))
    if info.code != (3 if tally.lossy else 0):
        problems.append((WRONG, f"info ended with {info.code}: {info.err[-300:]}"))
    return Verdict(problems, figures)


def _cut_out(base: Base, rng: Random) -> bytes:
    spans = _spans(base)
    start, stop = rng.choice(spans)
    return base.data[:start] + base.data[stop:]


def _twice(base: Base, rng: Random) -> bytes:
    start, stop = rng.choice(_spans(base))
    return base.data[:stop] + base.data[start:stop] + base.data[stop:]


def _summary(base: Base, rng: Random) -> bytes:
    """One bit between the end of the data and the closing mark."""
    start = next(stop for kind, _, stop in intact.mcap_records(base.data) if kind == r.DATA_END)
    at = rng.randrange(start, len(base.data) - len(r.MAGIC))
    return base.data[:at] + bytes([base.data[at] ^ 1 << rng.randrange(8)]) + base.data[at + 1 :]


def _spans(base: Base) -> list[Span]:
    """Chunks, alone and with the indexes behind them; single messages where there are no chunks."""
    if base.name.endswith(".bag"):
        records = [(fields["op"][0], start, stop) for fields, start, _, stop in intact.bag_records(base.data, 13)]
        chunk, index, message = 5, 4, 2
    else:
        records = list(intact.mcap_records(base.data))
        chunk, index, message = r.CHUNK, r.MESSAGE_INDEX, r.MESSAGE
    spans = []
    for number, (kind, start, stop) in enumerate(records):
        if kind in {chunk, message}:
            spans.append(Span(start, stop))
        if kind == chunk:
            behind = number + 1
            while behind < len(records) and records[behind][0] == index:
                behind += 1
            spans.append(Span(start, records[behind - 1][2]))
    return spans
