"""Changes of bytes: what a fuzzer tries on the inputs that it has."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Sequence

_NUMBER = re.compile(rb"[-+]?[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?")
NUMBERS = tuple(
    b"0 -0 1 -1 2 7 255 256 65535 65536 2147483647 2147483648 4294967295 -2147483649 9223372036854775807 "
    b"9223372036854775808 18446744073709551615 1e9 1e10 1e19 1e38 1e300 1e308 1e309 -1e308 1e-9 1e-308 5e-324 1e-400 "
    b"nan .nan inf -inf .inf 0.5 0x10 1_000 007 1e99999 99999999999999999999999 0.1e1".split()
)
_INTEGERS = (0, 1, 2, 3, 4, 7, 8, 15, 16, 127, 128, 255, 256, 4095, 65535, 2**16, 2**24, 2**31 - 1, 2**31, 2**32 - 1)
_WIDE = (*_INTEGERS, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
_PACKED = tuple(
    struct.pack(f"{order}{code}", number & (1 << 8 * width) - 1)
    for number in _WIDE
    for order in "<>"
    for code, width in (("B", 1), ("H", 2), ("I", 4), ("Q", 8))
)


def mutate(data: bytes, others: Sequence[bytes], words: Sequence[bytes], rng: random.Random, limit: int) -> bytes:
    """Input after one to eight changes, at most ``limit`` bytes; parts may come from ``others`` and ``words``."""
    for _ in range(1 << rng.randrange(4)):
        kind = rng.randrange(len(_CHANGES) + 2)
        if kind < len(_CHANGES):
            data = _CHANGES[kind](data, rng)
        elif kind == len(_CHANGES) and words:
            data = _place(data, rng.choice(words), rng)
        else:
            other = rng.choice(others)
            start, stop = _span(other, rng)
            data = _place(data, other[start:stop], rng)
    return data[:limit]


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    """Some part of the data, mostly a short one."""
    start = rng.randrange(len(data) + 1)
    longest = len(data) - start
    return start, start + min(longest, 1 << rng.randrange(max(1, longest.bit_length() + 1)))


def _place(data: bytes, part: bytes, rng: random.Random) -> bytes:
    """Insert a part, or write it over what stands there."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + part + data[at + (len(part) if rng.random() < 0.5 else 0) :]


def _flip(data: bytes, rng: random.Random) -> bytes:
    if not data:
        return b"\0"
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _byte(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _integer(data: bytes, rng: random.Random) -> bytes:
    part = rng.choice(_PACKED)
    at = rng.randrange(len(data) + 1)
    return data[:at] + part + data[at + len(part) :]


def _step(data: bytes, rng: random.Random) -> bytes:
    """A byte a little larger or smaller, as lengths are that are nearly right."""
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([(data[at] + rng.randrange(-9, 10)) & 255]) + data[at + 1 :]


def _drop(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(data, rng)
    return data[:start] + data[stop:]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    start, stop = _span(data, rng)
    return data[:stop] + data[start:stop] * (1 << rng.randrange(4)) + data[stop:]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _number(data: bytes, rng: random.Random) -> bytes:
    """Another number in the place of one that stands there as text."""
    found = list(_NUMBER.finditer(data[:4096]))
    if not found:
        return data
    match = rng.choice(found)
    return data[: match.start()] + rng.choice(NUMBERS) + data[match.end() :]


_CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _flip,
    _byte,
    _integer,
    _step,
    _drop,
    _repeat,
    _cut,
    _number,
)
