"""Text that came from files, made safe to show."""

from __future__ import annotations

import re

# Control characters (C0, DEL, C1), line and paragraph separators, and those that reorder what is shown (bidi).
_UNSAFE = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]")


def clean(text: str, limit: int = 200) -> str:
    r"""Text with every unsafe character written as ``\xNN`` or ``\uNNNN``, cut to ``limit`` characters."""
    shown = _UNSAFE.sub(_escape, text)
    return shown if len(shown) <= limit else shown[: limit - 1] + "…"


def counted(number: int, what: str) -> str:
    """A number of things: ``1 topic``, ``2 topics``."""
    return f"{number} {what}{'s'[: number != 1]}"


def _escape(match: re.Match[str]) -> str:
    code = ord(match.group())
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
