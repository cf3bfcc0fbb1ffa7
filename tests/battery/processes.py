"""What a group of processes uses, as the system counts it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


class Usage(NamedTuple):
    """Processor time of a group of processes and of their children that ended [s], and whether all of them sleep."""

    seconds: float
    asleep: bool


def usage(group: int) -> Usage:
    """What the processes of a group use together, every thread of them."""
    ticks, awake = 0, 0
    for path in Path("/proc").glob("[0-9]*"):
        fields = _fields(path / "stat")
        if fields and int(fields[2]) == group:
            ticks += sum(map(int, fields[11:15]))  # of its own and of its children, as user and as system
            awake += sum(_fields(task / "stat")[:1] not in (["S"], []) for task in (path / "task").glob("*"))
    return Usage(ticks * _TICK_S, awake == 0)


def _fields(path: Path) -> list[str]:
    """What stands behind the name in a status line: state, parent, group…; empty if the process is gone."""
    try:
        return path.read_text().rpartition(")")[2].split()
    except OSError:
        return []
