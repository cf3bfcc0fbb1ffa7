"""Where a record of an MCAP starts, told by its bytes alone: for finding the thread again after broken framing.

Every kind of record but a message holds lengths that must agree with each other; a message must be followed by another
record.
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

from mclcli.io.logs import mcap_records as rec

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.io.logs.source import ByteSource

CHUNK_START = re.compile(rb"\x06.{36}(?:\x00{4}|\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4)", re.DOTALL)
"""What the start of a chunk record looks like."""
RECORD_START = re.compile(rb"(?=[\x01-\x0f].{4}\x00{4})", re.DOTALL)
"""What the start of any record below 4 GiB looks like."""
WINDOW = 1 << 16
"""Bytes of a record that tell whether its lengths agree."""
HEAD_LIMIT = 64
"""Bytes that hold the head of any chunk."""
PASSED = frozenset({rec.ATTACHMENT_INDEX, rec.METADATA_INDEX, rec.SUMMARY_OFFSET, *range(0x80, 0x100)})
"""Kinds of records whose contents nobody needs."""
_ADDED = 256  # bytes of fields that later versions of the format may add
_SHORTEST = 16  # bytes of a schema or channel that is believed
_YEARS_NS = 1 << 57  # times farther than four years from those before are no times
# Fields of each kind: numbers of so many bytes, s: text, bytes or pairs after a 32-bit length, q: after a 64-bit one.
_FIELDS = {
    rec.HEADER: "ss",
    rec.FOOTER: "20",
    rec.SCHEMA: "2 s s s",
    rec.CHANNEL: "4 s s s",
    rec.MESSAGE_INDEX: "2 s",
    rec.CHUNK: "28 s q",
    rec.CHUNK_INDEX: "32 s 8 s 16",
    rec.ATTACHMENT: "16 s s q 4",
    rec.ATTACHMENT_INDEX: "40 s s",
    rec.STATISTICS: "42 s",
    rec.METADATA: "s s",
    rec.METADATA_INDEX: "16 s",
    rec.SUMMARY_OFFSET: "17",
    rec.DATA_END: "4",
}
_LAYOUTS = {kind: re.findall(r"\d+|s|q", fields) for kind, fields in _FIELDS.items()}


def plausible(kind: int, length: int, left: int) -> bool:
    """Whether a record could have this kind and length where so many bytes are left."""
    if length > left or length != rec.FIXED.get(kind, length):
        return False
    return kind in rec.KNOWN or kind >= 0x80


def length_of(kind: int, start: bytes) -> int | None:
    """Length that a record's own fields give its content, from the start of that; None if they are not all there."""
    at = 0
    for field in _LAYOUTS[kind]:
        if field.isdecimal():
            at += int(field)
            continue
        size = 4 if field == "s" else 8
        raw = start[at : at + size]
        if len(raw) < size:
            return None
        at += size + int.from_bytes(raw, "little")
    return at


def chunk_start(match: re.Match[bytes], left: int) -> int | None:
    """Position of a chunk record in the window that was searched, if the match is one: its two lengths agree."""
    begin, window = match.start(), match.string
    (length,) = struct.unpack_from("<Q", window, begin + 1)
    head = rec.parse_chunk_head(window[begin + 9 : begin + 9 + HEAD_LIMIT])
    if head is None or length != head.data_at + head.data_length or begin + 9 + length > left:
        return None
    return begin


def chunk_within(body: bytes, left: int) -> int | None:
    """Position of a chunk record that starts within ``body`` and ends within the ``left`` bytes from its start."""
    return next((at for m in CHUNK_START.finditer(body) if (at := chunk_start(m, left)) is not None), None)


def fits(kind: int, length: int, start: bytes, left: int) -> bool:
    """Whether a record other than a message, whose content begins with ``start``, is of its kind.

    Its fields must fill it but for a few bytes, which later versions may add, and in which no chunk starts that ends
    within the ``left`` bytes from ``start``; a private one must not read as a chunk. Chunks are told when inflated.
    """
    if kind == rec.CHUNK:
        return True
    if kind not in rec.KNOWN:
        return kind & 0x7F != rec.CHUNK or length_of(rec.CHUNK, start) != length
    needed = length_of(kind, start)
    if needed is None or not needed <= length <= needed + _ADDED:
        return False
    return needed == length or chunk_within(start, left) is None


def until_chunk(src: ByteSource, last_ns: int | None) -> tuple[int, int] | tuple[None, None]:
    """From ``last_ns`` to the first log time of the chunk record that comes next; (None, None) if either is unknown."""
    ahead = src.read(rec.RECORD.size + HEAD_LIMIT)
    src.unread(ahead)
    head = rec.parse_chunk_head(ahead[rec.RECORD.size :]) if ahead[:1] == bytes([rec.CHUNK]) else None
    return (None, None) if head is None or last_ns is None else (last_ns, head.first_ns)


def record_start(
    last_ns: int | None, channels: frozenset[int], *, messages: bool, definitions: bool = False
) -> Callable[[re.Match[bytes], int], int | None]:
    """Make a test for ``ByteSource.find``: whether a match of ``RECORD_START`` is a record.

    ``messages``: messages and definitions, which may stand in chunks, count as well; ``definitions``: those alone do.

    ``last_ns`` is a log time nearby and ``channels`` the numbers known, as far as there are any.
    """

    def start_of(match: re.Match[bytes], left: int) -> int | None:
        begin, window = match.start(), match.string
        if len(window) < begin + 9:
            return None
        kind, length = rec.RECORD.unpack_from(window, begin)
        if begin + 9 + length > left:
            return None
        if kind == rec.MESSAGE:
            return begin if messages and _is_message(window, begin, left, last_ns, channels) else None
        if kind in {rec.SCHEMA, rec.CHANNEL} and not (messages or definitions):
            return None
        return begin if _agrees(window, begin) else None

    return start_of


def _agrees(window: bytes, begin: int) -> bool:
    """Whether the lengths within a record, no message, agree."""
    kind: int = window[begin]
    length: int = rec.RECORD.unpack_from(window, begin)[1]
    content = window[begin + 9 : begin + 9 + length]
    if kind not in _LAYOUTS or length != length_of(kind, content):
        return False
    if kind == rec.FOOTER:
        return window[begin + 29 : begin + 37] == rec.MAGIC
    if kind == rec.DATA_END:
        return window[begin + 13 : begin + 14] in {b"\2", b"\3", b"\4", b"\x08", b"\x0b"}
    if kind == rec.MESSAGE_INDEX:
        return length > 6 and (length - 6) % 16 == 0
    if kind in {rec.SCHEMA, rec.CHANNEL}:
        return length > _SHORTEST and (rec.parse_schema(content) or rec.parse_channel(content, {})) is not None
    return kind != rec.HEADER and (kind != rec.METADATA or length > 8)


def _is_message(window: bytes, begin: int, left: int, last_ns: int | None, channels: frozenset[int]) -> bool:
    if len(window) < begin + 31:
        return False
    _, length = rec.RECORD.unpack_from(window, begin)
    number, _, stamp, _ = rec.MESSAGE_HEAD.unpack_from(window, begin + 9)
    if length < rec.MESSAGE_HEAD.size:
        return False
    after = begin + 9 + length
    if after + 9 > len(window):  # too long to see what follows
        return last_ns is not None and number in channels and abs(stamp - last_ns) <= _YEARS_NS
    kind, length = rec.RECORD.unpack_from(window, after)
    if kind == rec.MESSAGE and rec.MESSAGE_HEAD.size <= length <= left - after - 9:
        far = len(window) >= after + 31 and abs(rec.MESSAGE_HEAD.unpack_from(window, after + 9)[2] - stamp) > _YEARS_NS
        return not far
    return bool(kind in _LAYOUTS and after + 9 + length <= left and _agrees(window, after))
