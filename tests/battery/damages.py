"""480 ways to damage a file, from one seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterator
    from typing import TypeAlias

    Change: TypeAlias = Callable[[bytes, random.Random], bytes]

LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1\nsize 12345\n"
HTML = b"<!DOCTYPE html>\n<html><head><title>404</title></head><body>Not found</body></html>\n"


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(1, len(data))]


def _flip(low: float, high: float) -> Change:
    def flip(data: bytes, rng: random.Random) -> bytes:
        hurt = bytearray(data)
        at = rng.randrange(int(low * len(data)), int(high * len(data)))
        hurt[at] ^= 1 << rng.randrange(8)
        return bytes(hurt)

    return flip


def _span(rng: random.Random, data: bytes) -> tuple[int, int]:
    """A place anywhere, and a length from 1 byte to a twentieth of the file, short ones as likely as long ones."""
    at = rng.randrange(len(data))
    return at, at + int((len(data) / 20) ** rng.random())


def _drop(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(rng, data)
    return data[:start] + data[stop:]


def _zero(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(rng, data)
    return (data[:start] + bytes(stop - start) + data[stop:])[: len(data)]


def _insert(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(rng, data)
    return data[:start] + rng.randbytes(stop - start) + data[start:]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(rng, data)
    return data[:stop] + data[start:stop] + data[stop:]


def _append(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(rng, data)
    return data + rng.choice([bytes(stop - start), rng.randbytes(stop - start), data[start:stop]])


def _magic(data: bytes, rng: random.Random) -> bytes:
    return rng.randbytes(8) + data[8:]


COUNTS: dict[str, tuple[int, Change]] = {
    "cut": (50, _cut),
    "bit in the head": (60, _flip(0.0, 0.05)),
    "bit in the body": (100, _flip(0.05, 0.9)),
    "bit in the tail": (60, _flip(0.9, 1.0)),
    "dropped span": (60, _drop),
    "zeroed span": (60, _zero),
    "inserted span": (40, _insert),
    "repeated span": (20, _repeat),
    "appended bytes": (20, _append),
    "wrong magic": (6, _magic),
    "empty": (1, lambda *_: b""),
    "Git LFS pointer": (1, lambda *_: LFS),
    "web page": (1, lambda *_: HTML),
    "zeros": (1, lambda data, _: bytes(len(data))),
}


def damages(share: float = 1.0) -> Iterator[tuple[str, Change]]:
    """Name and change of each damage; a ``share`` of every kind, at least one."""
    for kind, (count, change) in COUNTS.items():
        for number in range(max(1, round(count * share))):
            yield f"{kind} {number}", change
