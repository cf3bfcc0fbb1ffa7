"""Signals end mcl in order: before it is there, while it writes, and not at all where the parent process says so."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import termios
import threading
from contextlib import suppress
from typing import IO, TYPE_CHECKING, cast

import pytest

from tests.cli.support import ENTRY, OFFICE, OFFICE_MAP, finish, messages, process

if TYPE_CHECKING:
    from pathlib import Path

WORDS = ("run", "-", "--map", OFFICE_MAP, "--init", "/initialpose", "--particles", 300)
SIGNALS = [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
HALF = OFFICE.read_bytes()[: OFFICE.stat().st_size // 2]

# A module whose import takes long, and passes over every exception meanwhile, as callbacks within imports do.
SLOW = """
import importlib.abc, sys, time
class Slow(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {name!r}:
            print("importing", flush=True)
            for _ in range(300):
                try:
                    time.sleep(0.1)
                except BaseException:
                    pass
sys.meta_path.insert(0, Slow())
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def started(folder: Path, shell: str = "", entry: str = ENTRY) -> subprocess.Popen[bytes]:
    """A run that has written steps and waits for more of its stream."""
    words = map(str, (*WORDS, "-o", folder / "trace.mcap", "--track", "-"))
    command = ["bash", "-c", f'{shell} exec "$@"', "bash", sys.executable, "-c", entry, *words]
    pipe = subprocess.PIPE
    run = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe)
    stdin, stdout = cast("IO[bytes]", run.stdin), cast("IO[bytes]", run.stdout)
    stdin.write(HALF)
    stdin.flush()
    assert stdout.readline().startswith(b"stamp,")
    assert stdout.readline()
    return run


def feed(stdin: IO[bytes]) -> None:
    """Write half of the log, as far as its reader wants it."""
    with suppress(BrokenPipeError):
        os.write(stdin.fileno(), HALF)


@pytest.mark.parametrize(("number", "code"), SIGNALS)
@pytest.mark.parametrize("name", ["warnings", "click", "mclcli.cli.run.command"])
def test_a_signal_while_mcl_is_imported(number: signal.Signals, code: int, name: str) -> None:
    entry = ENTRY.replace("from mclcli", f"import sys; sys.modules.pop({name!r}, None); from mclcli")
    command = [sys.executable, "-c", SLOW.format(name=name) + entry, "run", "nothing"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        assert cast("IO[bytes]", run.stdout).readline() == b"importing\n"
        run.send_signal(number)
        result = finish(run)
    assert (result.code, result.out, result.err) == (code, b"", "")


@pytest.mark.parametrize(("number", "code"), SIGNALS[1:])
def test_several_signals_are_one(tmp_path: Path, number: signal.Signals, code: int) -> None:
    """A terminal that closes sends SIGHUP twice, and a service manager SIGTERM and SIGHUP."""
    run = started(tmp_path)
    for again in (number, number, signal.SIGHUP, signal.SIGTERM):
        with suppress(ProcessLookupError):
            run.send_signal(again)
    result = finish(run)
    assert result.code in {code, 129, 143}  # those that arrive together are taken in the order of their numbers
    assert names(tmp_path) == ["trace.mcap.part"]
    assert messages(tmp_path / "trace.mcap.part")
    assert "kept as trace.mcap.part" in result.err


@pytest.mark.parametrize(("name", "number"), [("HUP", signal.SIGHUP), ("TERM", signal.SIGTERM), ("INT", signal.SIGINT)])
def test_what_the_parent_ignores_is_ignored(tmp_path: Path, name: str, number: signal.Signals) -> None:
    """As under ``nohup``; SIGINT as for a command in the background of a script."""
    run = started(tmp_path, f"trap '' {name};", "from mclcli.__main__ import main; main()")
    run.send_signal(number)
    result = finish(run)
    assert result.code == 3, result.err  # the stream was cut
    assert names(tmp_path) == ["trace.mcap"]


def test_a_terminal_that_closes(tmp_path: Path) -> None:
    """Nothing can be said any more; the output is kept all the same."""
    master, slave = os.openpty()
    words = (*WORDS, "-o", tmp_path / "trace.mcap", "--track", tmp_path / "track.csv", "--steps", "-")
    run = process(
        *words, stdin=subprocess.PIPE, stdout=slave, stderr=slave, start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(1, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    os.close(slave)
    stdin = cast("IO[bytes]", run.stdin)
    feeder = threading.Thread(target=feed, args=(stdin,))
    feeder.start()  # beside us, for a terminal that nobody reads takes little, and then mcl waits for it
    assert os.read(master, 10)
    os.close(master)
    assert run.wait(timeout=60) == 129
    feeder.join()
    stdin.close()
    assert names(tmp_path) == ["trace.mcap.part"]


def test_a_part_of_the_user_stays(tmp_path: Path) -> None:
    (tmp_path / "trace.mcap.part").write_text("kept from the last time")
    run = started(tmp_path)
    run.send_signal(signal.SIGHUP)
    result = finish(run)
    assert result.code == 129
    assert (tmp_path / "trace.mcap.part").read_text() == "kept from the last time"
    assert names(tmp_path) == ["trace.mcap.1.part", "trace.mcap.part"]
    assert "kept as trace.mcap.1.part" in result.err
