"""PNG files checked to the letter before Pillow sees them: it takes wrong checksums, and fills rows that are missing.

Source: PNG specification, https://www.w3.org/TR/png-3 (sections 5, 8 and 10).
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

from mclcli.errors import InputError
from mclcli.io.maps import after_pixels

if TYPE_CHECKING:
    from collections.abc import Iterator

MAGIC = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_WHOLE = ((0, 1, 0, 1),)  # first column, step, first row, step
_ADAM7 = ((0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2))
_STEP = 1 << 20


def check_png(data: bytes, name: str) -> int:
    """Check every checksum and the number of pixels; returns the number of palette colours.

    What stands behind the last chunk is passed over with a warning.

    Raises
    ------
    InputError
        If a checksum fails, the file is cut off, or its raster has more or fewer bytes than its header says.

    """
    header, raster, colours, end = b"", [], 0, len(MAGIC)
    for kind, content in _chunks(data, name):
        end += 12 + len(content)
        if kind == b"IHDR":
            header = bytes(content[:13])
        elif kind == b"PLTE":
            colours = len(content) // 3
        elif kind == b"IDAT":
            raster.append(content)
    expected = _raster_size(header, name)
    found = _inflated_size(raster, expected)
    if found != expected:
        more = "more than" if found > expected else f"{found} bytes of pixels instead of"
        raise InputError(f"{name}: damaged image: {more} the {expected} bytes that its header says; copy it again")
    after_pixels.tell(memoryview(data)[end:], name)
    return colours


def _chunks(data: bytes, name: str) -> Iterator[tuple[bytes, memoryview]]:
    """Kind and content of each chunk, checksum verified, up to the last one."""
    view, position, kind = memoryview(data), len(MAGIC), b""
    while kind != b"IEND":
        if position + 12 > len(data):
            raise InputError(f"{name}: damaged image: cut off after {len(data)} bytes; copy it again")
        length, kind = struct.unpack_from(">I4s", data, position)
        end = position + 8 + length
        if data[end : end + 4] != struct.pack(">I", zlib.crc32(view[position + 4 : end])):
            raise InputError(f"{name}: damaged image: checksum of its chunk at byte {position} fails; copy it again")
        yield kind, view[position + 8 : end]
        position = end + 4


def _raster_size(header: bytes, name: str) -> int:
    """Bytes of the pixels once inflated: a byte for the filter and the packed samples, row by row."""
    try:
        width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", header)
        bits = depth * _CHANNELS[colour]
    except (struct.error, KeyError):
        raise InputError(f"{name}: damaged image header; copy it again") from None
    size = 0
    for column, across, row, down in _ADAM7 if interlace else _WHOLE:
        columns, rows = max(0, -(-(width - column) // across)), max(0, -(-(height - row) // down))
        size += rows * (1 + (columns * bits + 7) // 8) if columns else 0
    return size


def _inflated_size(parts: list[memoryview], limit: int) -> int:
    """Bytes that come out of a zlib stream, counted no further than one beyond ``limit``."""
    inflater, size = zlib.decompressobj(), 0
    try:
        for part in parts:
            rest: bytes | memoryview = part
            while rest and size <= limit:
                size += len(inflater.decompress(rest, _STEP))
                rest = inflater.unconsumed_tail
        return size + (len(inflater.flush()) if size <= limit else 0)
    except zlib.error:
        return size
