"""Runs that are killed, interrupted, terminated, or lose their reader, at any moment."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import cache, partial
from typing import TYPE_CHECKING

from mcap.reader import make_reader

from tests import processes
from tests.battery import writing
from tests.battery.damaged import read_all
from tests.battery.harness import CRASH, WRONG, Case, Verdict
from tests.cli.support import ENTRY, ROOT
from tests.io.logs import seeded

if TYPE_CHECKING:
    from pathlib import Path

CASES = 24
"""Of each kind of ending."""
CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129, signal.SIGKILL: -9}


def cases(seed: int, share: float) -> list[Case]:
    """Signals at random moments of a run and of a recovery, and readers that leave after some bytes."""
    found = []
    for number in CODES:
        rng = seeded(f"{seed} {number}")
        for turn in range(max(1, round(CASES * share))):
            command, moment = rng.choice(["run", "run", "recover"] if share == 1.0 else ["recover"]), rng.random()
            name = f"{number.name} to {command} after {moment:.0%} of its time ({turn})"
            found.append(Case(name, partial(check, command, number, moment)))
    rng = seeded(f"{seed} pipe")
    sizes = [rng.randrange(20_000) for _ in range(max(1, round(CASES * share)))]
    return found + [
        Case(f"the reader leaves after {size} bytes ({n})", partial(check_pipe, size)) for n, size in enumerate(sizes)
    ]


def check(command: str, number: signal.Signals, moment: float, folder: Path) -> Verdict:
    """Send one signal, and look at what is left."""
    _, whole = writing.reference(command)
    writing.put_inputs(folder)
    for target in whole:
        (folder / target).write_bytes(writing.OLD)
    started = _start(command, folder)
    time.sleep(moment * duration(command))
    started.send_signal(number)
    _, said = processes.finish(started)
    problems = writing.left_behind(folder, whole, parts=True)
    starting = b"KeyboardInterrupt" in said and b"mclcli/" not in said  # Python itself was interrupted, and says so
    if started.returncode not in {0, CODES[number], -number} and not starting:  # by the signal itself, or by mcl
        problems.append((CRASH, f"ended with {started.returncode}: {said.decode()[-400:]}"))
    if b"Traceback" in said and b"mclcli/cli" in said:  # not where Python was only starting
        problems.append((CRASH, said.decode()[-400:]))
    kept = list(folder.glob("*.mcap*.part"))
    for path in kept:
        problems += _part(path, whole, closed=number != signal.SIGKILL)
    return Verdict(problems, {"finished": started.returncode == 0, "parts": len(kept)})


def check_pipe(size: int, folder: Path) -> Verdict:
    """Read so many bytes of a trace, and leave."""
    writing.put_inputs(folder)
    words = [*writing.COMMANDS["run"][0], "-o", "-", "--particles", "2000"]
    started = subprocess.Popen(
        _command(words), cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=_environment()
    )
    assert started.stdout is not None
    started.stdout.read(size)
    started.stdout.close()
    started.stdout = None  # nobody reads the rest
    said = processes.finish(started)[1].decode()
    code = started.returncode
    if (code, said) != (141, ""):
        return Verdict([(WRONG, f"ended with {code}: {said[-300:]}")], {})
    return Verdict([], {"pipes": 1})


@cache
def duration(command: str) -> float:
    """Wall-clock time of an undisturbed process [s]."""
    import tempfile
    from pathlib import Path

    times = []
    for _ in range(2):
        with tempfile.TemporaryDirectory() as folder:
            writing.put_inputs(Path(folder))
            began = time.monotonic()
            started = _start(command, Path(folder))
            processes.finish(started)
            times.append(time.monotonic() - began)
    return min(times)


def _part(path: Path, whole: dict[str, bytes], *, closed: bool) -> list[tuple[str, str]]:
    """What was kept of an MCAP holds nothing that the whole one does not."""
    import io

    original = "good.mcap" if path.name.startswith("good") else "t.mcap"
    theirs = {(c.topic, m.log_time, m.data) for _, c, m in make_reader(io.BytesIO(whole[original])).iter_messages()}
    if closed:
        try:
            with path.open("rb") as stream:
                read = make_reader(stream, validate_crcs=True).iter_messages()
                ours = {(c.topic, m.log_time, m.data) for _, c, m in read}
        except Exception as error:  # noqa: BLE001 - whatever the reader finds
            return [(WRONG, f"{path.name}: {error!r}")]
    elif path.stat().st_size < 8:
        return []
    else:
        ours = set(read_all(path)[0])
    return [] if ours <= theirs else [(WRONG, f"{path.name} holds {len(ours - theirs)} messages of its own")]


def _start(command: str, folder: Path) -> subprocess.Popen[bytes]:
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(_command(writing.words_of(command)), cwd=folder, env=_environment(), **streams)  # type: ignore[call-overload, no-any-return]


def _command(words: list[str]) -> list[str]:
    return [sys.executable, "-c", ENTRY, *words]


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT)}
