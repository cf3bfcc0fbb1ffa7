"""PGM, PBM and PPM read to the letter: pixels that are missing or may have shifted are refused.

What follows complete pixels is passed over with a warning if it can be no pixels that were pushed out
(``mclcli.io.maps.after_pixels``). Source: the format pages pbm(5), pgm(5), ppm(5) of Netpbm.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError
from mclcli.io.maps import after_pixels

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Samples = NDArray[np.uint8] | NDArray[np.uint16]

MAGIC = re.compile(rb"P[1-6][\s#]")
_GAP = rb"(?:\s|#[^\r\n]*[\r\n])+"
_NUMBER = rb"([0-9]{1,10})"
_HEAD = re.compile(rb"P([1-6])" + (_GAP + _NUMBER) * 2)
_MAXVAL = re.compile(_GAP + _NUMBER)
_COMMENT = re.compile(rb"#[^\r\n]*")
_COMMENT_LINE = re.compile(rb"\s\s*#[\t -~\x80-\xff]*\r?\n")
_OTHER = re.compile(rb"[^0-9\s]")
_LONG = re.compile(rb"[0-9]{6}")
_WHITE = b" \t\n\v\f\r"
_GAP_ONLY = re.compile(rb"\s")
_HEADER_LIMIT = 1 << 16
_PIECE = 1 << 22  # bytes


@final
@dataclass(frozen=True, slots=True)
class Header:
    """Kind 1 to 6 (the digit after the P), size in pixels, greatest sample, and where the raster starts [bytes]."""

    kind: int
    width: int
    height: int
    maxval: int
    start: int

    @property
    def channels(self) -> int:
        """Samples per pixel."""
        return 3 if self.kind in {3, 6} else 1

    @property
    def raster_size(self) -> int:
        """Length of the raster [bytes]; of a plain one the most that is believed."""
        if self.kind == 4:
            return (self.width + 7) // 8 * self.height
        samples = self.width * self.height * self.channels
        if self.kind > 4:
            return samples * (1 if self.maxval < 256 else 2)
        return samples * (2 if self.kind == 1 else 5 if self.maxval < 256 else 7) + (1 << 20)


def read_header(head: bytes, name: str) -> Header:
    """Header of a Netpbm file from its first bytes.

    Raises
    ------
    InputError
        If there is none, a size is 0, or maxval is not in 1…65535.

    """
    found = _HEAD.match(head[:_HEADER_LIMIT])
    if not found:
        raise InputError(
            f"{name}: damaged image header: no width and height after P{head[1:2].decode('ascii', 'replace')}"
        )
    kind, width, height = (int(group) for group in found.groups())
    end, maxval = found.end(), 1
    if kind not in {1, 4}:
        top = _MAXVAL.match(head[:_HEADER_LIMIT], end)
        if not top:
            raise InputError(f"{name}: damaged image header: no maxval after width and height")
        end, maxval = top.end(), int(top.group(1))
    if not (width and height and 0 < maxval < 65536):
        raise InputError(f"{name}: damaged image header: {width} × {height} pixels, maxval {maxval}")
    return Header(kind, width, height, maxval, end)


def samples(header: Header, data: bytes, name: str) -> Samples:
    """Samples (H, W) or (H, W, 3) of a whole file, row 0 at the top; 1 is black in a bitmap (P1, P4).

    uint8, or uint16 where maxval is above 255.

    Raises
    ------
    InputError
        If the raster has fewer pixels than the header says, or more that may have shifted, naming the likely damage,
        or a sample is above maxval.

    """
    flat = _plain(header, data, name) if header.kind < 4 else _raw(header, data, name)
    shape = (header.height, header.width)
    return flat.reshape(shape if header.channels == 1 else (*shape, 3))


def _raw(header: Header, data: bytes, name: str) -> Samples:
    raster = memoryview(data)[header.start + 1 :]  # one byte of white space ends the header
    rest = raster[header.raster_size :]
    if damage := _raw_damage(header, data, bytes(rest)):
        raise InputError(f"{name}: damaged image: {damage}")
    after_pixels.tell(rest, name)
    raster = raster[: header.raster_size]
    if header.kind == 4:
        rows = np.frombuffer(raster, np.uint8).reshape(header.height, -1)
        return np.unpackbits(rows, axis=1, count=header.width).reshape(-1)
    flat = np.frombuffer(raster, np.uint8) if header.maxval < 256 else np.frombuffer(raster, ">u2").astype(np.uint16)
    if header.maxval not in {255, 65535}:
        _check_top(header, int(flat.max()), name)
    return flat


def _raw_damage(header: Header, data: bytes, rest: bytes) -> str:
    """What probably happened to a raster that is too short or too long, empty if its pixels are where they belong."""
    there, expected = len(data) - header.start - 1, header.raster_size
    if data[header.start : header.start + 2] == b"\r\n" or (there != expected and b"\r\n" in data[: header.start]):
        return "its line ends were converted to CRLF, pixels included; copy it again in binary mode"
    if there < expected:
        return f"{max(there, 0)} bytes of pixels where the header says {expected}; copy it again"
    return _shift(header, data, rest) if rest else ""


def _shift(header: Header, data: bytes, rest: bytes) -> str:
    """What probably pushed pixels out behind the raster, empty if ``rest`` can be no pixels."""
    begin, expected = header.start + 1, header.raster_size
    if (found := _COMMENT_LINE.match(data, header.start)) and found.end() - begin <= len(rest):
        return "a comment after maxval, where the pixels should start; remove the comment"
    ends, converted = (data.count(end, begin, begin + expected) for end in (b"\n", b"\r\n"))
    if 0 < converted == ends and converted <= len(rest):
        return "every line end among its pixels is CRLF: they were converted; copy it again in binary mode"
    if not after_pixels.is_no_pixels(rest):
        return f"{len(rest)} bytes more than the {expected} bytes of pixels that the header says; copy it again"
    return ""


def _plain(header: Header, data: bytes, name: str) -> Samples:
    """Numbers of a plain image, piece by piece so that a large one needs little more memory than its text."""
    count = header.width * header.height * header.channels
    values = np.zeros(count, np.uint8) if header.maxval < 256 else np.zeros(count, np.uint16)
    done, start, text = 0, header.start, data
    if data.find(b"#", start) >= 0:
        start, text = 0, _COMMENT.sub(b" ", data[start:])
    end = _end_of_numbers(text, start)
    for piece in _pieces(text, start, end):
        numbers = _numbers(header, piece, name)
        if done + numbers.size > count:
            raise InputError(f"{name}: damaged image: more numbers than the {count} the header says; copy it again")
        values[done : done + numbers.size] = numbers
        done += numbers.size
    if done < count:
        raise InputError(f"{name}: damaged image: {done} numbers where the header says {count}; copy it again")
    after_pixels.tell(text[end:], name)
    return values


def _end_of_numbers(text: bytes, start: int) -> int:
    """Where the numbers of a plain image end, and with them the image."""
    other = _OTHER.search(text, start)
    return other.start() if other and after_pixels.is_no_pixels(text[other.start() :]) else len(text)


def _numbers(header: Header, piece: bytes, name: str) -> NDArray[np.int32]:
    if wrong := piece.translate(None, b"0123456789" + _WHITE):
        raise InputError(f"{name}: damaged image: {wrong[:20]!r} among the numbers of a plain image; copy it again")
    if header.kind == 1:  # needs no white space between samples
        numbers = np.frombuffer(piece.translate(None, _WHITE), np.uint8).astype(np.int32) - ord("0")
    elif _LONG.search(piece):
        raise InputError(f"{name}: damaged image: a number of more than 5 digits; copy it again")
    else:
        numbers = np.fromstring(piece, np.int32, sep=" ")
    _check_top(header, int(numbers.max(initial=0)), name)
    return numbers


def _check_top(header: Header, top: int, name: str) -> None:
    if top > header.maxval:
        raise InputError(f"{name}: damaged image: a pixel of {top}, above maxval {header.maxval}; copy it again")


def _pieces(text: bytes, start: int, end: int) -> Iterator[bytes]:
    """The text of the numbers from ``start`` to ``end``, cut at white space."""
    while start < end:
        gap = _GAP_ONLY.search(text, start + _PIECE, end)
        stop = gap.start() if gap else end
        if piece := text[start:stop].strip():
            yield piece
        start = stop
