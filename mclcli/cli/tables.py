"""Tables for people: as wide as they need, and where the screen is narrower row by row, never with a digit cut off."""

from __future__ import annotations

import io
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.table import Table

_INDENT = "  "


def rendered(table: Table, width: int | None = None) -> str:
    """A table as text, in colours where standard output is a terminal.

    ``width`` is that of the screen; None: the terminal's, or none at all where there is no terminal.
    """
    from rich.console import Console
    from rich.measure import Measurement

    terminal = sys.stdout is not None and sys.stdout.isatty()
    target = io.StringIO()
    console = Console(file=target, markup=False, highlight=False, emoji=False, force_terminal=terminal or None)
    natural = Measurement.get(console, console.options.update(max_width=10_000), table).maximum
    screen = width or (console.width if terminal else natural)
    if natural > screen:
        return "\n".join(_stacked(table, screen))
    console.width = max(natural, 1)
    console.print(table)
    return "\n".join(line.rstrip() for line in target.getvalue().rstrip("\n").split("\n"))


def _stacked(table: Table, width: int) -> Iterator[str]:
    """Row by row: its first cell, and below it the others, each beside its heading."""
    first, *others = table.columns
    for number, name in enumerate(first.cells):
        yield str(name)
        line = ""
        for column in others:
            part = f"{column.header} {list(column.cells)[number]}"
            if line and len(_INDENT) + len(line) + 2 + len(part) > width:
                yield _INDENT + line
                line = part
            else:
                line = f"{line}  {part}" if line else part
        yield _INDENT + line
