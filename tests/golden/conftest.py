"""Keeps the largest difference of every comparison with a golden file; ``pytest tests/golden -v`` prints them.

The table goes into docs/models.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import pytest

if TYPE_CHECKING:
    from _pytest.terminal import TerminalReporter

_Rows = dict[tuple[str, str], tuple[int, int, float]]  # file, what → cases, numbers, worst difference
_ROWS = pytest.StashKey[_Rows]()


class Note(Protocol):
    """Takes down one case of a golden file: what was compared, the worst difference, and of how many numbers."""

    def __call__(self, file: str, what: str, worst: float, numbers: int) -> float:
        """The worst difference again, to be held against a bound."""
        ...


@pytest.fixture
def note(pytestconfig: pytest.Config) -> Note:
    """Where a test leaves its worst difference."""
    rows = pytestconfig.stash.setdefault(_ROWS, {})

    def take(file: str, what: str, worst: float, numbers: int) -> float:
        cases, count, before = rows.get((file, what), (0, 0, 0.0))
        rows[file, what] = (cases + 1, count + numbers, max(before, worst))
        return worst

    return take


def pytest_terminal_summary(terminalreporter: TerminalReporter) -> None:
    """Markdown table of all comparisons."""
    rows = terminalreporter.config.stash.get(_ROWS, {})
    if terminalreporter.verbosity < 1 or not rows:
        return
    terminalreporter.section("golden numbers")
    terminalreporter.write_line("| file | what | cases | numbers | worst difference |\n|---|---|---|---|---|")
    for (file, what), (cases, numbers, worst) in sorted(rows.items()):
        terminalreporter.write_line(f"| {file} | {what} | {cases} | {numbers:,} | {worst:.1e} |")
