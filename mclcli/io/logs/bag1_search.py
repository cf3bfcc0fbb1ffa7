"""Where a record of a ROS 1 bag starts, told by its bytes alone: for finding the thread again after broken framing."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from mclcli.io.logs import bag1_records as rec

if TYPE_CHECKING:
    from collections.abc import Callable

CHUNK_START = re.compile(rb"compression=(?:none|bz2|lz4)")
"""A field that only chunk headers have."""
RECORD_START = re.compile(rb"\x04\x00\x00\x00op=[\x02\x04-\x07]")
"""The field that every record's header has."""
IN_CHUNKS = frozenset({rec.MESSAGE, rec.CONNECTION})
"""Kinds of records that stand in chunks; connections stand in the index as well."""
OUTSIDE = frozenset({rec.CHUNK, rec.INDEX, rec.CHUNK_INFO})
"""Kinds of records that stand outside chunks only."""
_LONGEST = 600  # of the headers that are looked for [bytes]


def chunk_start(match: re.Match[bytes], left: int) -> int | None:
    """Position of a chunk record in the window that was searched, if the match stands in the header of one."""
    return _start(match.string, match.start() - 4, left, frozenset({rec.CHUNK}))


def chunk_within(data: bytes, left: int) -> int | None:
    """Position of a chunk record that starts within ``data`` and ends within the ``left`` bytes from their start."""
    return next((at for m in CHUNK_START.finditer(data) if (at := chunk_start(m, left)) is not None), None)


def record_start(kinds: frozenset[int]) -> Callable[[re.Match[bytes], int], int | None]:
    """Make a test for ``ByteSource.find``: a match of ``RECORD_START`` must stand in the header of such a record."""
    return lambda match, left: _start(match.string, match.start(), left, kinds)


def _start(window: bytes, field: int, left: int, kinds: frozenset[int]) -> int | None:
    """Where the record starts whose header has a field at ``field``; None if there is none, or not all of it."""
    for begin in range(field - 4, max(-1, field - _LONGEST), -1):
        if window[begin + 2 : begin + 4] != b"\0\0":
            continue
        (length,) = rec.LENGTH.unpack_from(window, begin)
        stop = begin + 4 + length
        if not field < stop <= min(len(window) - 4, begin + _LONGEST):
            continue
        head = rec.parse_head(window, begin + 4, stop)
        (size,) = rec.LENGTH.unpack_from(window, stop)
        if head.kind in kinds and stop + 4 + size <= left and rec.fits(head, size):
            return begin
    return None
