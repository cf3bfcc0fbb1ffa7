"""What is shown on a terminal while a command takes long."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from mclcli.cli import console

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is drawn on a terminal of 60 columns; 'end' where the line goes."""
    lines: list[str] = []

    @contextmanager
    def fake() -> Iterator[Callable[[Sequence[str]], None]]:
        try:
            yield lambda forms: lines.append(console.fitting(forms, 60))
        finally:
            lines.append("end")

    monkeypatch.setattr(console, "is_live", lambda: True)
    monkeypatch.setattr(console, "live_line", fake)
    monkeypatch.setattr(console, "_REDRAW_S", 0.0)
    return lines


def test_items_are_counted_once_it_takes_long(drawn: list[str]) -> None:
    assert list(console.counting(iter(range(3)), "saving", after_s=0.0)) == [0, 1, 2]
    assert drawn == [f"saving: {count} messages in 0 s" for count in (1, 2, 3)] + ["end"]


def test_nothing_is_shown_of_what_is_quick(drawn: list[str]) -> None:
    assert list(console.counting(iter(range(1000)), "saving", after_s=1e9)) == list(range(1000))
    assert drawn == []


def test_nothing_is_shown_where_there_is_no_terminal(drawn: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "is_live", lambda: False)
    assert list(console.counting(iter(range(3)), "saving", after_s=0.0)) == [0, 1, 2]
    with console.waiting("scoring", long=True):
        pass
    assert drawn == []


def test_the_line_goes_where_the_reader_stops(drawn: list[str]) -> None:
    items = console.counting(iter(range(3)), "saving", after_s=0.0)
    assert [next(items), next(items)] == [0, 1]
    items.close()  # type: ignore[attr-defined]
    assert drawn == ["saving: 1 messages in 0 s", "end"]


def test_what_takes_long_is_named(drawn: list[str]) -> None:
    with console.waiting("scoring 9 poses", long=False):
        assert drawn == []
    with console.waiting("scoring 9 poses", long=True):
        assert drawn == ["scoring 9 poses"]
    assert drawn == ["scoring 9 poses", "end"]
