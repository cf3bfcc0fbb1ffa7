"""Definitions as other programs record them, and messages by a writer of the tests' own.

The writer knows fields alone, and follows DDS-XTypes 1.3, 7.4.3, and ROS 1 as plainly as it can.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    FieldDefs = Mapping[str, Any]

_CODES = {"bool": "?", "byte": "B", "octet": "B", "char": "B", "float32": "f", "float64": "d"} | {
    f"{sign}int{8 * size}": code.upper() if sign else code
    for sign in ("", "u")
    for size, code in ((1, "b"), (2, "h"), (4, "i"), (8, "q"))
}
_IDL = {"bool": "boolean", "float32": "float", "float64": "double", "byte": "octet", "char": "uint8"}
_LINE = "=" * 80
ROS1 = -1
"""Form of a message in ROS 1's serialization."""


def idl_of(types: FieldDefs, kind: str) -> str:
    """Definition of a type as rosbag2 records it in IDL, with all types it uses, as rosidl writes them."""
    found: dict[str, str] = {}
    _describe(types, kind, found)
    return "".join(f"{_LINE}\nIDL: {name}\n{text}" for name, text in found.items())


def _describe(types: FieldDefs, kind: str, found: dict[str, str]) -> None:
    package, _, name = kind.split("/")
    inner: list[str] = []
    arrays: list[str] = []
    members = [_member(label, node, inner, arrays) for label, node in types[kind][1]]
    includes = "".join(f'#include "{used}.idl"\n' for used in dict.fromkeys(inner))
    typedefs = "".join(f"    typedef {text};\n" for text in dict.fromkeys(arrays))
    comment = '@verbatim (language="comment", text="a struct { // " "}; more")'
    body = "\n".join(f"      {comment}\n      {member};" for member in members)
    found[kind] = (
        f"// generated from {kind}\n{includes}\nmodule {package} {{\n  module msg {{\n"
        f"    module {name}_Constants {{\n      const uint8 KIND = 1; /* {{ */\n    }};\n{typedefs}"
        f"    {comment}\n    struct {name} {{\n{body}\n    }};\n  }};\n}};\n\n"
    )
    for used in inner:
        if used not in found:
            _describe(types, used, found)


def _member(label: str, node: Any, inner: list[str], arrays: list[str]) -> str:
    what, detail = node
    if what in {Nodetype.NAME, Nodetype.BASE}:
        return f"{_idl_type(node, inner)} {label}"
    element, count = detail
    base = _idl_type(element, inner)
    if what == Nodetype.SEQUENCE:
        return f"sequence<{base}> {label}"
    arrays.append(f"{base} {base}__{count}[{count}]")
    return f"{base}__{count} {label}"


def _idl_type(node: Any, inner: list[str]) -> str:
    what, detail = node
    if what == Nodetype.NAME:
        inner.append(detail)
        return str(detail).replace("/", "::")
    return _IDL.get(detail[0], str(detail[0]))


def write(types: FieldDefs, kind: str, values: Mapping[str, Any], form: int) -> bytes:
    """Message of a type from nested dicts, zeros where they say nothing.

    ``form`` is 0 or 1 for CDR, 6 or 7 for plain and 8 or 9 for delimited XCDR2, odd for little-endian; or ``ROS1``.
    """
    if form == ROS1:
        ros1 = _Writer(types, "<", 1, b"")
        ros1.struct(kind, values)
        return bytes(ros1.out)
    second = form >= 6
    writer = _Writer(types, "<" if form % 2 else ">", 4 if second else 8, b"\0", second, form >= 8)
    writer.struct(kind, values)
    return bytes((0, form, 0, 0)) + bytes(writer.out)


@dataclass
class _Writer:
    types: FieldDefs
    order: str
    align: int
    end: bytes
    collections: bool = False
    structs: bool = False
    out: bytearray = field(default_factory=bytearray)

    def number(self, code: str, value: Any) -> None:
        size = struct.calcsize(f"={code}")
        self.out += bytes(-len(self.out) % min(size, self.align)) + struct.pack(f"{self.order}{code}", value)

    def counted(self, content: Callable[[], None]) -> None:
        self.number("I", 0)
        start = len(self.out)
        content()
        self.out[start - 4 : start] = struct.pack(f"{self.order}I", len(self.out) - start)

    def struct(self, kind: str, values: Mapping[str, Any]) -> None:
        def content() -> None:
            for name, node in self.types[kind][1]:
                self.any(node, values.get(name))

        self.counted(content) if self.structs else content()

    def any(self, node: Any, value: Any) -> None:
        what, detail = node
        if what == Nodetype.NAME:
            self.struct(detail, value or {})
        elif what == Nodetype.BASE:
            self.base(detail[0], value)
        else:
            self.many(detail[0], None if what == Nodetype.SEQUENCE else detail[1], value)

    def many(self, element: Any, count: int | None, value: Any) -> None:
        items = value.tolist() if isinstance(value, np.ndarray) else value or [None] * (count or 0)

        def content() -> None:
            if count is None:
                self.number("I", len(items))
            for item in items:
                self.any(element, item)

        plain = element[0] == Nodetype.BASE and element[1][0] != "string"
        self.counted(content) if self.collections and not plain else content()

    def base(self, kind: str, value: Any) -> None:
        if kind == "string":
            text = (value or "").encode() + self.end
            self.number("I", len(text))
            self.out += text
        else:
            self.number(_CODES[kind], value or 0)
