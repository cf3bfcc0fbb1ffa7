"""What a file says it holds, against what was found in it: chunks that are missing, chunks that are there twice."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.io.logs.base import Damage
    from mclcli.io.logs.channels import WatchedChannels
    from mclcli.io.logs.mcap_records import ChunkIndex
    from mclcli.io.logs.report import Report

_ENDS = 512  # bytes at either end of a chunk that tell it from others


@final
@dataclass(slots=True)
class Inventory:
    """Chunks that were met and those that the file's index lists; ``declared`` is its own count of messages."""

    declared: int | None = None
    listed: dict[int, ChunkIndex] = field(default_factory=dict)  # by the byte at which they should start
    _met: set[int] = field(default_factory=set)
    _copies: dict[int, int] = field(default_factory=dict)

    def meet(self, key: tuple[int, ...]) -> None:
        """Take note of a chunk whose head could be read, whatever is in it."""
        self._met.add(hash(key))

    def original(self, key: tuple[int, ...], body: bytes, at: int) -> int | None:
        """Byte at which the same chunk was read before, None for a new one; ``key`` is what its head says."""
        ends = zlib.crc32(body[:_ENDS]), zlib.crc32(body[-_ENDS:])
        first = self._copies.setdefault(hash((key, ends)), at)
        return None if first == at else first

    def forget(self) -> None:
        """Believe nothing of a summary that is damaged."""
        self.declared = None
        self.listed.clear()

    def missing(self) -> list[ChunkIndex]:
        """Chunks that are listed and were not met."""
        return [index for index in self.listed.values() if hash(index.key) not in self._met]

    def expected(self) -> int | None:
        """Messages that the file should hold by its statistics, or else its chunk indexes; None if it does not say."""
        if self.declared is not None:
            return self.declared
        counts = [index.messages for index in self.listed.values()]
        known = [count for count in counts if count is not None]
        return sum(known) if counts and len(known) == len(counts) else None

    def settle(self, at: int, report: Report, messages: int, channels: WatchedChannels) -> Iterator[Damage]:
        """Compare with the ``messages`` found; the last word about what was lost."""
        expected, missing, found = self.expected(), self.missing(), messages - channels.nameless
        if channels.nameless:
            yield report.nameless(at, channels)
        if channels.guessed:
            yield report.lost(
                at, f"{channels.guessed} messages of channels that nothing describes: types are guessed", 0
            )
        if missing:
            counts = [index.messages for index in missing]
            count = None if None in counts else sum(count or 0 for count in counts)
            if expected is not None:
                more = max(0, expected - found - report.counted)
                count = more if count is None else min(more, count)
            first, last = min(index.key[0] for index in missing), max(index.key[1] for index in missing)
            yield report.lost(at, f"chunk indexes name {_chunks(len(missing))} not there", count, first, last)
        if expected is not None:
            by = "file counts" if self.declared is not None else "chunk indexes count"
            yield from report.totals(at, found, expected, by)
        elif more := channels.missing_numbers(messages):
            yield from report.totals(at, found, messages + more, "sequence numbers count", least=True)


def _chunks(count: int) -> str:
    return "a chunk that is" if count == 1 else f"{count} chunks that are"
