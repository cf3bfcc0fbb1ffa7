"""The classes of cases, by name; each makes its cases from a seed and the share of them that is wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.battery import damaged

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.battery.harness import Case

CLASSES: dict[str, Callable[[int, float], list[Case]]] = {
    "damaged logs": damaged.cases,
}
