"""What processes use, as the system counts it; and waiting for one without a clock, whatever else the machine does."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

LOOK_S = 0.1
"""Time between two looks at a process that is waited for."""
ASLEEP = 600
"""Looks in a row at which all sleep and none took processor time, after which processes wait for what never comes.

One that waits for the processor does not sleep.
"""
_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


class Usage(NamedTuple):
    """Processor time of processes and of their children that ended [s], and whether all of them sleep."""

    seconds: float
    asleep: bool


def usage_of_group(group: int) -> Usage:
    """What the processes of a group use together, every thread of them."""
    return _usage(lambda _, fields: int(fields[2]) == group)


def usage_of(pid: int) -> Usage:
    """What one process uses, and its children."""
    return _usage(lambda number, fields: pid in {number, int(fields[1])})


def finish(started: subprocess.Popen[Any], patience_s: float = 120.0) -> tuple[Any, Any]:
    """What a process wrote to its pipes until it ended; TimeoutError, once it is killed, if it hangs.

    It hangs if it takes more processor time than ``patience_s``, or sleeps all the time.
    """
    watch = Watch(lambda: usage_of(started.pid), patience_s)
    while True:
        try:
            return started.communicate(timeout=LOOK_S)
        except subprocess.TimeoutExpired:
            if why := watch.look():
                started.kill()
                raise TimeoutError(why) from None


class Watch:
    """Looks at what processes use, again and again, and says when they hang."""

    def __init__(self, usage: Callable[[], Usage], patience_s: float, asleep: int = 0) -> None:
        self._usage, self._patience_s, self._looks = usage, patience_s, asleep or ASLEEP
        self._first = self._last = usage()
        self._asleep = 0

    def look(self) -> str:
        """In what way they hang, else ''."""
        now = self._usage()
        spent = now.seconds - self._first.seconds
        self._asleep = self._asleep + 1 if now.asleep and now.seconds == self._last.seconds else 0
        self._last = now
        if spent > self._patience_s:
            return f"no end after {spent:.0f} s of processor time"
        return "waits for what never comes" if self._asleep >= self._looks else ""


def _usage(chosen: Callable[[int, list[str]], bool]) -> Usage:
    ticks, awake = 0, 0
    for path in Path("/proc").glob("[0-9]*"):
        fields = _fields(path / "stat")
        if fields and chosen(int(path.name), fields):
            ticks += sum(map(int, fields[11:15]))  # of its own and of its children, as user and as system
            awake += sum(_fields(task / "stat")[:1] not in (["S"], []) for task in (path / "task").glob("*"))
    return Usage(ticks * _TICK_S, awake == 0)


def _fields(path: Path) -> list[str]:
    """What stands behind the name in a status line: state, parent, group…; empty if the process is gone."""
    try:
        return path.read_text().rpartition(")")[2].split()
    except OSError:
        return []
