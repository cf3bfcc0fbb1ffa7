"""Damaged logs: what is read of them is as it was recorded, and what is missing was said."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import TYPE_CHECKING

from mcap.reader import make_reader

from mclcli.errors import MclError
from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from tests.battery import content, intact
from tests.battery.bases import Base, base_logs
from tests.battery.damages import damages
from tests.battery.harness import ALTERATION, CRASH, LOSS, WRONG, Case, Verdict
from tests.battery.outcome import said, unclean
from tests.cli.support import Result, mcl
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from tests.battery.damages import Change

    Stamped = tuple[str, int, bytes]

RUNS = 12
"""One case in so many is also run through the filter."""


def cases(seed: int, share: float) -> list[Case]:
    """Every base log with a ``share`` of all damages."""
    found = []
    for base in base_logs():
        for number, (name, change) in enumerate(damages(share)):
            title = f"{base.name}, {name}"
            found.append(Case(title, partial(_check, base, change, f"{seed} {title}", runs=number % RUNS == 0)))
    return found


def _check(base: Base, change: Change, seed: str, folder: Path, *, runs: bool) -> Verdict:
    return check(base, change(base.data, seeded(seed)), folder, runs=runs)


def check(base: Base, data: bytes, folder: Path, *, runs: bool = False) -> Verdict:
    """Read one damaged log as a library, by ``mcl info``, ``mcl recover``, and perhaps ``mcl run``."""
    path = folder / base.name
    path.write_bytes(data)
    problems, figures, lossy, found = _read(base, path, data)
    problems += _told("info", mcl("info", path), {None: 1, True: 3, False: 0}[lossy])
    problems += _recovered(folder, path, found, lossy=lossy)
    if runs:
        figures["runs"] = 1
        problems += _run(folder, path, lossy=lossy)
    return Verdict(problems, figures)


def read_all(path: Path) -> tuple[list[Stamped], Tally]:
    """Every message of a log, and the tally."""
    tally = Tally()
    messages = open_log([path]).messages(None, tally, announce=False)
    return [(m.channel.topic, m.log_time_ns, m.data) for m in messages], tally


def compare(
    base: Base, found: Iterable[Stamped], tally: Tally, data: bytes = b""
) -> tuple[list[tuple[str, str]], dict[str, int]]:
    """What is wrong with the messages that came out of damaged data, and how many there are of each kind."""
    out, known = Counter(found), Counter(base.stamped)
    altered, missing = (out - known).total(), (known - out).total()
    problems: list[tuple[str, str]] = []
    if altered and base.checked and not tally.damages:
        problems.append((ALTERATION, f"{altered} messages are not as recorded"))
    if missing > altered and not tally.lossy:
        problems.append((LOSS, f"{missing} messages are missing, exit code 0"))
    lost = [None if damage.least else damage.messages for damage in tally.damages if not damage.lossless]
    said_lost = sum(count for count in lost if count is not None)
    if lost and not altered and None not in lost and said_lost < missing:
        problems.append((LOSS, f"{missing} messages are missing, {said_lost} were said to be"))
    if unread := (intact.required(base, data) - out).total():
        problems.append((WRONG, f"{unread} messages of intact chunks were not read"))
    figures = {"read": out.total() - altered, "of": len(base.known)}
    if altered and not base.checked and not tally.damages:
        figures["altered, no checksum to tell"] = altered
    return problems, figures


def _read(
    base: Base, path: Path, data: bytes
) -> tuple[list[tuple[str, str]], dict[str, int], bool | None, list[Stamped]]:
    """Problems, figures, whether something was lost (None: the file was refused), and what was read."""
    try:
        found, tally = read_all(path)
    except MclError as error:
        return said(str(error)), {"refused": 1, "of": len(base.known)}, None, []
    problems, figures = compare(base, found, tally, data)
    return problems, figures, tally.lossy, found


def _told(command: str, result: Result, expected: int) -> list[tuple[str, str]]:
    problems = unclean(result)
    if result.code != expected:
        problems.append((WRONG, f"{command} ended with {result.code} instead of {expected}: {result.err[-300:]}"))
    return problems


def _recovered(folder: Path, path: Path, found: list[Stamped], *, lossy: bool | None) -> list[tuple[str, str]]:
    """``mcl recover`` saves what was read, in a file that mcap's own reader finds no fault with.

    And what nothing describes, if it parses as a message of a known type, as /unknown/N.
    """
    good = folder / "good.mcap"
    expected = 3 if lossy or any(log_time_ns < 0 for _, log_time_ns, _ in found) else 0
    problems = _told("recover", mcl("recover", path, "-o", good), expected if found else 1)
    if not found:
        return problems + ([(WRONG, "recover left a file without messages")] if good.exists() else [])
    with good.open("rb") as stream:
        saved = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(stream, validate_crcs=True).iter_messages()]
    wanted = Counter(item for item in found if item[1] >= 0)  # what MCAP can date
    guessed = Counter(saved) - wanted
    if wanted - Counter(saved) or any(not topic.startswith("/unknown/") for topic, *_ in guessed):
        problems.append((WRONG, f"recover saved {len(saved)} of {len(found)} messages"))
    return problems


def _run(folder: Path, path: Path, *, lossy: bool | None) -> list[tuple[str, str]]:
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    result = mcl("run", path, "--map", folder / "room.yaml", "--init", content.INIT, "--particles", 100, "--track", "-")
    problems = unclean(result)
    if result.code not in {0, 1, 3}:
        problems.append((CRASH, f"run ended with {result.code}: {result.err[-300:]}"))
    if result.code == 0 and lossy:
        problems.append((LOSS, "run ended with 0, although messages were lost"))
    if b"nan" in result.out or b"inf" in result.out:
        problems.append((WRONG, "a pose that is none was written"))
    return problems
