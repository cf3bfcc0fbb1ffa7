"""Bytes of a message into an object by fields alone, for what rosbags' own parsers do not read.

That is XCDR version 2, and messages with fields of their own beside those we know. Nothing is compiled: readers are
closures over the fields, and numbers come through ``struct`` and NumPy. Sources: OMG DDS-XTypes 1.3, 7.4; DDSI-RTPS
2.5, 10.2; ROS 1's serialization.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.io.messages.conversion import Parsed
    from mclcli.io.messages.layouts import Layout

    Reader = Callable[[bytes, int], tuple[Parsed, int]]

_CODES = {
    "bool": "?",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
_DEEPEST = 16


@final
@dataclass(frozen=True, slots=True)
class Encoding:
    """How numbers and texts stand in a message.

    ``order`` is ``<`` or ``>``. Numbers are aligned to their size, at most to ``align`` bytes. ``collections`` of what
    is no number, and ``structs``, follow a count of their bytes. ``nul`` ends each text.
    """

    order: str
    align: int
    collections: bool = False
    structs: bool = False
    nul: bool = True


ROS1 = Encoding("<", 1, nul=False)
CDR = {
    b"\x00\x00": Encoding(">", 8),
    b"\x00\x01": Encoding("<", 8),
    **{bytes((0, kind)): Encoding("<" if kind % 2 else ">", 4, collections=True) for kind in (6, 7, 0x10, 0x11)},
    **{
        bytes((0, kind)): Encoding("<" if kind % 2 else ">", 4, collections=True, structs=True)
        for kind in (8, 9, 0x14, 0x15)
    },
}
"""Encapsulations that can be read, by the first two bytes of a message: CDR, XCDR2 plain, XCDR2 delimited."""


def reader_for(layout: Layout, kind: str, encoding: Encoding) -> Reader:
    """Bytes and a position → object of a type, and the position behind it; alignment counts from the first byte.

    The reader raises ValueError, IndexError or struct.error for bytes that are of no such message. Raises ValueError
    for types that cannot be read.
    """
    return _Builder(layout, encoding).struct(kind, 0)


@final
@dataclass(frozen=True, slots=True)
class _Builder:
    layout: Layout
    encoding: Encoding
    made: dict[str, Reader | None] = field(default_factory=dict)  # None while a type's own reader is being made

    def struct(self, kind: str, depth: int) -> Reader:
        """Reader of a type with fields; fields that the result has no place for are passed over."""
        known, fields = self.made.get(kind), self.layout.fields(kind)
        if known is not None:
            return known
        if kind in self.made or depth > _DEEPEST or not fields:
            raise ValueError(f"{kind[:100]} {'is within itself' if kind in self.made else 'is not described'}")
        self.made[kind] = None
        readers = [(self.layout.place(kind, name), self.any(of, depth + 1)) for of, name in fields]
        make = self.layout.maker(kind)

        def read(data: bytes, at: int) -> tuple[Parsed, int]:
            values: dict[str, Any] = {}
            for place, reader in readers:
                value, at = reader(data, at)
                if place:
                    values[place] = value
            return (make(**values) if make else None), at

        reader = self.made[kind] = self.counted(read) if self.encoding.structs else read
        return reader

    def any(self, of: str, depth: int) -> Reader:
        """Reader of a field of any type."""
        base, bracket, size = of.partition("[")
        if not bracket:
            return self.single(base, depth)
        count = int(size[:-1]) if size != "]" else None
        if base in _CODES:
            return self.numbers(base, count)
        many = self.many(self.single(base, depth), count)
        return self.counted(many) if self.encoding.collections else many

    def single(self, base: str, depth: int) -> Reader:
        """Reader of a number, a text or a struct."""
        if base in _CODES:
            return self.number(base)
        if base == "string":
            return self.text()
        return self.struct(base, depth)

    def number(self, base: str) -> Reader:
        """Reader of one number."""
        form = struct.Struct(self.encoding.order + _CODES[base])
        size, step = form.size, min(form.size, self.encoding.align)

        def read(data: bytes, at: int) -> tuple[Parsed, int]:
            at += -at % step
            return form.unpack_from(data, at)[0], at + size

        return read

    def numbers(self, base: str, count: int | None) -> Reader:
        """Reader of an array of numbers, its length fixed or told."""
        kind = np.dtype(self.encoding.order + _CODES[base])
        step, length = min(kind.itemsize, self.encoding.align), self.number("uint32")

        def read(data: bytes, at: int) -> tuple[Parsed, int]:
            number = count
            if number is None:
                number, at = length(data, at)
            if not number:
                return np.zeros(0, kind.newbyteorder("=")), at
            at += -at % step
            values = np.frombuffer(data, kind, number, at)
            return values.astype(kind.newbyteorder("=")), at + number * kind.itemsize

        return read

    def text(self) -> Reader:
        """Reader of a text."""
        length, nul = self.number("uint32"), self.encoding.nul

        def read(data: bytes, at: int) -> tuple[Parsed, int]:
            size, at = length(data, at)
            raw = data[at : at + size]
            if len(raw) < size or (nul and size and raw[-1]):
                raise ValueError("a text does not end")
            return str(raw[: size - 1 if nul and size else size], "utf-8"), at + size

        return read

    def many(self, each: Reader, count: int | None) -> Reader:
        """Reader of a list of what is no number."""
        length = self.number("uint32")

        def read(data: bytes, at: int) -> tuple[Parsed, int]:
            number = count
            if number is None:
                number, at = length(data, at)
            if number > len(data) - at:  # everything takes a byte
                raise ValueError("more elements than bytes")
            values = []
            for _ in range(number):
                value, at = each(data, at)
                values.append(value)
            return values, at

        return read

    def counted(self, read: Reader) -> Reader:
        """Reader of what follows a count of its bytes."""
        length = self.number("uint32")

        def read_counted(data: bytes, at: int) -> tuple[Parsed, int]:
            size, at = length(data, at)
            value, end = read(data, at)
            if end != at + size:
                raise ValueError("a count of bytes is wrong")
            return value, end

        return read_counted
