"""Bytes in order, from a file or a pipe: position, what is left, a running CRC, and a way to find the thread again."""

from __future__ import annotations

import io
import os
import stat
import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, BinaryIO, final

if TYPE_CHECKING:
    import re
    from collections.abc import Callable, Mapping
    from pathlib import Path
    from typing import Self

STEP = 1 << 20
"""Bytes asked of a pipe at a time, so that a declared length allocates no more than really arrives."""
PIPE_LIMIT = 1 << 29
"""Longest record believed where the length of the file is unknown [bytes]."""


@final
class ByteSource:
    """A stream read forwards. ``size`` is the length of a regular file [bytes], None for a pipe.

    A context manager: leaving it closes the stream, unless it is ``borrowed``.
    """

    __slots__ = ("_borrowed", "_kept", "_kept_at", "_stream", "crc", "crc_valid", "offset", "size")

    def __init__(self, stream: BinaryIO, size: int | None, kept: bytes = b"", *, borrowed: bool = False) -> None:
        self._stream = stream
        self._borrowed = borrowed
        self._kept = kept  # bytes already taken from the stream, to be read first
        self._kept_at = 0
        self.size = size
        self.offset = 0
        self.crc = 0  # CRC-32 of everything read so far
        self.crc_valid = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._borrowed:
            self._stream.close()

    @property
    def left(self) -> int:
        """Bytes that a record may still have: exact for a file, a bound for a pipe."""
        return PIPE_LIMIT if self.size is None else self.size - self.offset

    def read(self, count: int) -> bytes:
        """Next ``count`` bytes; fewer only at the end."""
        data = self._take(count)
        self.offset += len(data)
        self.crc = zlib.crc32(data, self.crc)
        return data

    def skip(self, count: int) -> int:
        """Pass over ``count`` bytes; returns how many there were."""
        start = self.offset
        while (rest := count - (self.offset - start)) > 0 and self.read(min(rest, STEP)):
            pass
        return self.offset - start

    def unread(self, data: bytes) -> None:
        """Put bytes back, to be read again; the running CRC ends here."""
        self._kept, self._kept_at = data + self._kept[self._kept_at :], 0
        self.offset -= len(data)
        self.crc_valid = False

    def go_on_within(self, data: bytes, start: int, find: Callable[[bytes, int], int | None]) -> int | None:
        """Go on at what ``find`` sees in ``data``, the last bytes read, behind ``start``; returns where, or None.

        ``find`` gets these bytes and how many there are from their beginning to the end of the stream.
        """
        inside = find(data[start:], len(data) - start + self.left)
        if inside is None:
            return None
        self.unread(data[start + inside :])
        return start + inside

    def go_to(self, offset: int) -> None:
        """Move to ``offset``: backwards only in a file (a pipe stays where it is)."""
        if offset >= self.offset:
            self.skip(offset - self.offset)
        elif self.size is not None:
            self._stream.seek(offset)
            self._kept, self._kept_at, self.offset = b"", 0, offset
        self.crc_valid = False

    def find(self, pattern: re.Pattern[bytes], start_of: Callable[[re.Match[bytes], int], int | None]) -> bool:
        """Advance to the next place that ``pattern`` matches and ``start_of(match, bytes left)`` accepts.

        ``start_of`` gets the match within a window of the stream and the bytes left from the window's start, and
        answers with the position in the window where a record begins, or None. False, at the end, if there is none.
        """
        window = self.read(STEP)
        self.crc_valid = False
        while window:
            left = self.left + len(window)
            for match in pattern.finditer(window):
                begin = start_of(match, left)
                if begin is not None:
                    self.unread(window[begin:])
                    return True
            more = self.read(STEP)
            window = window[-_OVERLAP:] + more if more else b""
        return False

    def _take(self, count: int) -> bytes:
        if self._kept_at >= len(self._kept):
            return self._from_stream(count)
        head = self._kept[self._kept_at : self._kept_at + count]
        self._kept_at += len(head)
        return head + self._from_stream(count - len(head)) if len(head) < count else head

    def _from_stream(self, count: int) -> bytes:
        if self.size is not None:
            return self._stream.read(max(0, min(count, self.size - self.offset)))
        if count <= STEP and len(part := self._stream.read(count)) in {0, count}:
            return part
        whole = io.BytesIO(part if count <= STEP else b"")
        whole.seek(0, io.SEEK_END)
        while (missing := count - whole.tell()) > 0 and (part := self._stream.read(min(missing, STEP))):
            whole.write(part)
        return whole.getvalue()


_OVERLAP = 1 << 17  # bytes behind a place that may be needed to tell whether a record starts there


@final
@dataclass(frozen=True, slots=True)
class Origin:
    """Where the bytes of a container come from: call it to open them at the first.

    ``path`` is None for a pipe; ``counted`` messages stand in the file, says what describes its folder, if it does, and
    ``types`` are those of topics, say the same lines.
    """

    opens: Callable[[], ByteSource]
    path: Path | None = None
    counted: int | None = None
    types: Mapping[str, str] = field(default_factory=dict)

    def __call__(self) -> ByteSource:
        """Bytes from the first one on. Raises OSError."""
        return self.opens()


def open_source(path: Path) -> ByteSource:
    """Open a file for reading from its start; a named pipe or device gets no size. Raises OSError."""
    stream = path.open("rb", buffering=1 << 18)
    return ByteSource(stream, regular_size(stream))


def regular_size(stream: BinaryIO) -> int | None:
    """Length of a regular file [bytes], or None for anything else."""
    try:
        status = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return None
    return status.st_size if stat.S_ISREG(status.st_mode) else None
