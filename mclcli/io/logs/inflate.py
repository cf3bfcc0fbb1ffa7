"""Decompression that never gives more than was announced.

A chunk states its size; nothing beyond it is ever inflated, and no chunk beyond 256 MiB. Over a whole file the ratio
is bounded once more than 1 GiB came out (``Budget``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeAlias

    Bytes: TypeAlias = bytes | memoryview

CHUNK_LIMIT = 1 << 28
"""Largest chunk that is inflated [bytes]."""
RECORD_LIMIT = CHUNK_LIMIT + (1 << 16)
"""Largest record that is taken into memory [bytes]."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""What a zstd frame begins with."""
_STEP = 1 << 16


@final
class CorruptError(ValueError):
    """Compressed bytes that do not hold what they should; the message completes "chunk at byte N …"."""


@final
@dataclass(slots=True)
class Budget:
    """Bytes that went in and came out of one file so far."""

    taken: int = 0
    given: int = 0

    def spend(self, taken: int, given: int) -> None:
        """Account for a chunk about to be inflated; raises CorruptError where the file looks like a bomb."""
        self.taken += taken
        self.given += given
        if self.given > 1 << 30 and self.given > 1000 * self.taken:
            raise CorruptError("inflates the file to more than 1000 times its size")


def inflate(data: Bytes, compression: str, size: int, budget: Budget) -> Bytes:
    """Decompress a whole chunk to exactly ``size`` bytes; ``compression`` is '', none, zstd, lz4 or bz2.

    Without compression it is ``data`` itself.

    Raises CorruptError for anything else: unknown compression, damaged data, another size.
    """
    if size > CHUNK_LIMIT:
        raise CorruptError(f"declares {size / 2**20:.0f} MiB, more than {CHUNK_LIMIT >> 20} MiB")
    if compression in {"", "none"}:
        plain: Bytes = data
    else:
        budget.spend(len(data), size)
        plain = _codec(compression)(data, size + 1)
    if len(plain) != size:
        raise CorruptError(f"declares {size} bytes and holds {'more' if len(plain) > size else len(plain)}")
    return plain


def inflate_frame(data: Bytes, budget: Budget) -> bytes:
    """Decompress one zstd frame, no larger than a chunk may be; CorruptError if it is damaged or too large."""
    import zstandard

    try:
        size = zstandard.get_frame_parameters(data).content_size
    except zstandard.ZstdError as error:
        raise CorruptError("does not decompress") from error
    known = size not in {0, zstandard.CONTENTSIZE_UNKNOWN}
    budget.spend(len(data), min(size, CHUNK_LIMIT) if known else 0)
    plain = _zstd(data, CHUNK_LIMIT + 1)
    if len(plain) > CHUNK_LIMIT or not plain or (known and len(plain) != size):
        raise CorruptError("does not hold what it declares")
    return plain


def inflate_start(data: bytes, compression: str, size: int, budget: Budget) -> bytes:
    """Decompress as much as the beginning of a chunk gives: whole blocks, unverified, at most ``size`` bytes."""
    if compression in {"", "none"}:
        return data[:size]
    try:
        budget.spend(len(data), min(size, CHUNK_LIMIT))
        return _PARTIAL[compression](data, min(size, CHUNK_LIMIT))
    except (CorruptError, KeyError):
        return b""


def _codec(compression: str) -> Callable[[Bytes, int], bytes]:
    if compression not in _WHOLE:
        raise CorruptError(f"is compressed with {compression[:20]!r}, which is none of zstd, lz4, bz2")
    return _WHOLE[compression]


def _zstd(data: Bytes, limit: int) -> bytes:
    import zstandard

    try:
        return zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True).read(limit)
    except (zstandard.ZstdError, MemoryError) as error:
        raise CorruptError("does not decompress") from error


def _zstd_start(data: bytes, limit: int) -> bytes:
    import zstandard

    stream = zstandard.ZstdDecompressor().stream_reader(data)
    return _gather(lambda: stream.read(_STEP), limit, zstandard.ZstdError)


def _lz4(data: Bytes, limit: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    decompressor = LZ4FrameDecompressor()
    try:
        plain: bytes = decompressor.decompress(data, limit)
    except (RuntimeError, EOFError, MemoryError) as error:
        raise CorruptError("does not decompress") from error
    if not decompressor.eof and len(plain) < limit - 1:
        raise CorruptError("does not decompress")
    return plain


def _lz4_start(data: bytes, limit: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    decompressor, pieces = LZ4FrameDecompressor(), iter([data])
    return _gather(lambda: decompressor.decompress(next(pieces, b""), _STEP), limit, RuntimeError)


def _bz2(data: Bytes, limit: int) -> bytes:
    import bz2

    try:
        decompressor = bz2.BZ2Decompressor()
        plain = decompressor.decompress(data, limit)
    except (OSError, ValueError, MemoryError) as error:
        raise CorruptError("does not decompress") from error
    return plain


def _bz2_start(data: bytes, limit: int) -> bytes:
    import bz2

    decompressor, pieces = bz2.BZ2Decompressor(), iter([data])
    return _gather(lambda: decompressor.decompress(next(pieces, b""), _STEP), limit, OSError)


def _gather(read: Callable[[], bytes], limit: int, failure: type[Exception]) -> bytes:
    parts: list[bytes] = []
    try:
        while len(parts) * _STEP < limit and (part := read()):
            parts.append(part)
    except (failure, EOFError):
        pass  # what came before the damage stands
    return b"".join(parts)[:limit]


_WHOLE: dict[str, Callable[[Bytes, int], bytes]] = {"zstd": _zstd, "lz4": _lz4, "bz2": _bz2}
_PARTIAL: dict[str, Callable[[bytes, int], bytes]] = {"zstd": _zstd_start, "lz4": _lz4_start, "bz2": _bz2_start}
