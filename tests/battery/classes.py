"""The classes of cases, by name; each makes its cases from a seed and the share of them that is wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.battery import (
    bombs,
    caching,
    combinations,
    crafted,
    damaged,
    drives,
    edited,
    interrupts,
    maps,
    naming,
    streams,
    truncation,
    writing,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.battery.harness import Case

CLASSES: dict[str, Callable[[int, float], list[Case]]] = {
    "damaged logs": damaged.cases,
    "edited logs": edited.cases,
    "truncation": truncation.cases,
    "crafted logs": crafted.cases,
    "bombs": bombs.cases,
    "maps": maps.cases,
    "scans and frames": drives.cases,
    "combinations": combinations.cases,
    "failing writes": writing.cases,
    "interrupts": interrupts.cases,
    "streams": streams.cases,
    "cache": caching.cases,
    "hostile names": naming.cases,
}
