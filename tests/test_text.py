"""Text from files, made safe for a terminal."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.text import clean


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/scan", "/scan"),
        ("naïve 机器人 °", "naïve 机器人 °"),
        ("\x1b[31mred", r"\x1b[31mred"),
        ("a\nb\r\tc", r"a\x0ab\x0d\x09c"),
        ("\x00\x7f\x9b", r"\x00\x7f\x9b"),
        ("\u202etxt.exe\u2066", r"\u202etxt.exe\u2066"),
        ("\u2028\u2029\ufeff", r"\u2028\u2029\ufeff"),
        ("\udcff", r"\udcff"),
        ("[link=x]", "[link=x]"),
    ],
)
def test_what_could_move_the_cursor_is_spelled_out(text: str, shown: str) -> None:
    assert clean(text) == shown


@given(st.text())
def test_nothing_that_controls_or_reorders_is_left(text: str) -> None:
    shown = clean(text)
    assert len(shown) <= 200
    assert not any(unicodedata.category(c) in {"Cc", "Cs", "Zl", "Zp"} for c in shown)
    assert not any(unicodedata.bidirectional(c) in {"LRE", "RLE", "LRO", "RLO", "PDF"} for c in shown)
    assert not any(unicodedata.bidirectional(c) in {"LRI", "RLI", "FSI", "PDI"} for c in shown)
    assert shown.encode().decode() == shown


def test_long_text_ends_in_an_ellipsis_at_the_limit() -> None:
    assert clean("x" * 200) == "x" * 200
    assert clean("x" * 201) == "x" * 199 + "…"
    assert clean("\x00" * 10, limit=8) == r"\x00\x0…"
