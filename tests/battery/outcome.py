"""What every ending of a command must keep: no bug shows, nothing said can harm a terminal."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from tests.battery.harness import CRASH, LARGE, WRONG

if TYPE_CHECKING:
    from tests.cli.support import Result

_HARMFUL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def unclean(result: Result) -> list[tuple[str, str]]:
    """A traceback, exit code 70, no memory left, or bytes on stdout or stderr that a terminal would obey."""
    problems = []
    if result.code == 70 or "Traceback" in result.err or result.code < 0:
        problems.append((CRASH, result.err[-400:]))
    if "out of memory" in result.err:
        problems.append((LARGE, result.err[-400:]))
    return problems + said(result.err) + said(result.out.decode("utf-8", "surrogateescape"))


def said(text: str) -> list[tuple[str, str]]:
    """Control bytes in what a user gets to see."""
    found = _HARMFUL.search(text)
    return [(WRONG, f"control byte {found.group()!r} in {text[:100]!r}")] if found else []
