"""Plain values as YAML that reads back the same, to the bit, and looks like what ``ros2 topic echo`` prints."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_SHORT = 6
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_NOT_PLAIN = {"null", "true", "false", "yes", "no", "on", "off", "y", "n"}  # YAML 1.1 takes some of them for truths


def to_yaml(mapping: Mapping[str, Any]) -> str:
    """One YAML document of nested mappings and lists of mappings, text and numbers, ending in a newline.

    Floats are in their shortest form that reads back exactly; lists of up to six scalars stay on one line.
    """
    return "".join(_lines(mapping, ""))


def scalar(value: float | str) -> str:
    """A number or text as YAML that reads back the same."""
    return _text(value) if isinstance(value, str) else _number(value)


def _lines(mapping: Mapping[str, Any], indent: str) -> Iterator[str]:
    for key, value in mapping.items():
        if isinstance(value, dict):
            yield f"{indent}{key}:\n"
            yield from _lines(value, indent + "  ")
        elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
            yield f"{indent}{key}:\n"
            for item in value:
                first, *others = _lines(item, indent + "  ")
                yield f"{indent}- {first.lstrip()}"
                yield from others
        elif isinstance(value, list) and len(value) <= _SHORT:
            yield f"{indent}{key}: [{', '.join(map(scalar, value))}]\n"
        elif isinstance(value, list):
            yield f"{indent}{key}:\n"
            yield from (f"{indent}- {scalar(item)}\n" for item in value)
        else:
            yield f"{indent}{key}: {scalar(value)}\n"


def _number(value: float) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) or math.isfinite(value):
        return repr(value)
    return ".nan" if math.isnan(value) else ".inf" if value > 0.0 else "-.inf"


def _text(text: str) -> str:
    if _PLAIN.fullmatch(text) and text.lower() not in _NOT_PLAIN:
        return text
    return '"' + "".join(_escaped(character) for character in text) + '"'


def _escaped(character: str) -> str:
    code = ord(character)
    if 0x20 <= code < 0x7F:
        return "\\" + character if character in '"\\' else character
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
