"""ROS 1 bags, version 2.0, read from front to back: whole, cut off, unindexed (.bag.active) or damaged in the middle.

The index is not needed: messages come from the chunks as they stand; what the index counts is compared at the end.
Source: ROS wiki, Bags/Format/2.0.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast, final

from mclcli.io.logs import bag1_records as rec
from mclcli.io.logs.base import LARGE, Damage, FileFacts, Item, RawMessage
from mclcli.io.logs.channels import WatchedChannels
from mclcli.io.logs.inflate import CHUNK_LIMIT, RECORD_LIMIT, Budget, CorruptError, inflate, inflate_start
from mclcli.io.logs.report import CUT, RESUMES, UNCLOSED, Report

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from mclcli.io.logs.bag1_records import Head
    from mclcli.io.logs.base import Channel
    from mclcli.io.logs.source import ByteSource


@final
@dataclass(frozen=True, slots=True)
class Bag1File:
    """A ROS 1 bag file or stream; ``start`` opens it at its first byte."""

    source: str
    start: Callable[[], ByteSource]

    def items(self, wanted: Callable[[Channel], bool] | None = None) -> Iterator[Item]:
        """Channels, messages and damage in file order (see ``Container``)."""
        with self.start() as src:
            yield from _Pass(self, src, WatchedChannels(wanted), Report(self.source)).run()


@final
@dataclass(slots=True)
class _Pass:
    """One pass over a file. Generators that answer a bool say whether reading can go on."""

    file: Bag1File
    src: ByteSource
    channels: WatchedChannels
    report: Report
    budget: Budget = field(default_factory=Budget)
    index_at: int = 0  # where the bag header says that the index starts; 0 in a bag that was not closed
    messages: int = 0
    declared: int = 0  # messages that the index counts
    learned: bool = False
    resumes: int = 0

    def run(self) -> Iterator[Item]:
        """Yield everything."""
        self.src.skip(len(rec.MAGIC))
        going = True
        while going:
            at = self.src.offset
            raw, head, size = self.head()
            if self.report.bad_chunk is not None and head.kind != rec.INDEX:
                yield from self.report.flush()
            if not raw:
                yield from self.end(at)
                break
            if head.kind == 0 or size > self.src.left:
                going = yield from self.broken(at, raw, head, None)
            else:
                going = yield from self.record(at, raw, head, size)
        yield from self.channels.report()
        yield from self.report.totals(self.src.offset, self.messages, self.declared or None, self.channels.nameless)
        closed = 0 < self.index_at <= self.src.offset
        yield FileFacts(self.file.source, "ROS 1 bag", closed, "no")

    def head(self) -> tuple[bytes, Head, int]:
        """Next record's header: its bytes, fields, and the length of the data that follow."""
        nothing = rec.Head(0, {})
        raw = self.src.read(4)
        length = rec.LENGTH.unpack(raw)[0] if len(raw) == 4 else rec.HEADER_LIMIT + 1
        if length > rec.HEADER_LIMIT:
            return raw, nothing, 0
        raw += self.src.read(length + 4)
        if len(raw) < length + 8:
            return raw, nothing, 0
        head = rec.parse_head(raw, 4, 4 + length)
        if head.kind not in _KINDS:
            return raw, nothing, 0
        declared: int = rec.LENGTH.unpack_from(raw, 4 + length)[0]
        return raw, head, rec.index_entries(head) if head.kind == rec.INDEX else declared

    def record(self, at: int, raw: bytes, head: Head, size: int) -> Generator[Item, None, bool]:
        """Read one record's data and take it in."""
        if size > RECORD_LIMIT and self.src.skip(size) == size:
            yield self.report.too_large(at, size)
            return True
        data = self.src.read(size)
        if len(data) < size:
            return (yield from self.broken(at, raw, head, data))
        if head.kind == rec.CHUNK:
            yield from self.chunk(at, head, data)
        elif head.kind in {rec.MESSAGE, rec.CONNECTION}:
            yield from self.records(raw + data, at)
        elif head.kind == rec.INDEX and self.report.bad_chunk is not None:
            self.report.bad_chunk = _with_index(self.report.bad_chunk, data)
        elif head.kind == rec.CHUNK_INFO:
            self.declared += sum(rec.LENGTH.unpack_from(data, i + 4)[0] for i in range(0, len(data) - 7, 8))
        elif head.kind == rec.BAG_HEADER:
            self.index_at = head.number(b"index_pos")
        return True

    def chunk(self, at: int, head: Head, data: bytes) -> Iterator[Item]:
        """Messages of one chunk, or nothing of it."""
        try:
            plain = inflate(data, head.text(b"compression"), head.number(b"size"), self.budget)
        except CorruptError as error:
            self.report.bad_chunk = self.report.lost(at, f"chunk at byte {at} {error}")
        else:
            yield from self.records(bytes(plain), at)

    def records(self, plain: bytes, at: int, *, cut: bool = False) -> Iterator[Item]:
        """Messages of a run of records, and what is wrong with it; ``cut`` says that it may end anywhere."""
        stop, channels = 0, self.channels.by_number
        for head, start, stop in rec.walk(plain):
            if head.kind == rec.MESSAGE:
                number, stamp = head.number(b"conn"), head.stamp_ns
                if number not in channels:
                    yield from self.learn()
                self.messages += 1
                watched = channels.get(number)
                if watched is None:
                    self.channels.nameless += 1
                elif watched.wanted:
                    data = plain[start:stop] if stop - start < LARGE else cast("bytes", memoryview(plain)[start:stop])
                    yield RawMessage(watched.channel, stamp, data)
                else:
                    watched.pass_over(stamp)
                    if not self.channels.reported:
                        yield from self.channels.report()
            else:
                yield from self.connection(head, plain[start:stop])
        if stop < len(plain) and not cut:
            yield self.report.lost(at, f"records at byte {at} are broken inside; the rest of them is skipped")

    def connection(self, head: Head, data: bytes) -> Iterator[Channel]:
        """Take in a connection record; a malformed one shows when its messages come."""
        channel = rec.parse_connection(head, data) if head.kind == rec.CONNECTION else None
        if channel is not None and self.channels.add(head.number(b"conn"), channel):
            yield channel

    def learn(self) -> Iterator[Item]:
        """Take the connections that the index repeats, once, where the records that defined them were lost."""
        if not self.learned and self.src.size is not None and 0 < self.index_at < self.src.size:
            with self.file.start() as src:
                src.go_to(self.index_at)
                index = src.read(min(src.left, CHUNK_LIMIT))
            for head, begin, stop in rec.walk(index):
                yield from self.connection(head, index[begin:stop])
        self.learned = True

    def broken(self, at: int, raw: bytes, head: Head, data: bytes | None) -> Generator[Item, None, bool]:
        """Framing is wrong at byte ``at``: find the next chunk, or see the file as cut there."""
        if self.index_at and at >= self.index_at and raw[:4] == rec.MAGIC[:4]:
            yield self.report.lost(at, f"another log follows at byte {at}; it is not read, split the file there")
            return False
        if self.index_at and at >= self.index_at:
            yield self.report.harmless(at, f"index is damaged at byte {at}, or cut; it is not needed")
            return False
        self.src.unread(raw[1:] + (data or b""))
        if self.resumes < RESUMES and self.src.find(rec.CHUNK_START, rec.chunk_start):
            self.resumes += 1
            yield self.report.lost(at, f"framing is broken at byte {at}; read on from byte {self.src.offset}")
            return True
        yield from self.cut(at, raw, head, data)
        return False

    def cut(self, at: int, raw: bytes, head: Head, data: bytes | None) -> Iterator[Item]:
        """Nothing follows a broken record: take what the beginning of a chunk gives."""
        if head.kind == 0 and self.src.offset - at >= rec.HEADER_LIMIT:
            yield self.report.lost(at, f"framing is broken at byte {at}; nothing readable follows")
            return
        recovered = 0
        if head.kind == rec.CHUNK:
            if data is None:
                self.src.go_to(at + len(raw))
                data = self.src.read(min(self.src.left, CHUNK_LIMIT))
            before = self.messages
            plain = inflate_start(data, head.text(b"compression"), head.number(b"size"), self.budget)
            yield from self.records(plain, at, cut=True)
            recovered = self.messages - before
        what = f"{CUT}; {recovered} messages of its last chunk were recovered" if recovered else CUT
        yield self.report.lost(at, what)

    def end(self, at: int) -> Iterator[Damage]:
        """The file ends where a record would start."""
        if self.index_at == 0:
            yield self.report.lost(at, UNCLOSED)
        elif at < self.index_at:
            yield self.report.lost(
                at, f"file ends at byte {at}, before its index at byte {self.index_at}; it was cut off"
            )


_KINDS = frozenset({rec.MESSAGE, rec.BAG_HEADER, rec.INDEX, rec.CHUNK, rec.CHUNK_INFO, rec.CONNECTION})


def _with_index(damage: Damage, entries: bytes) -> Damage:
    stamps = [rec.stamp_ns(entries[i : i + 8]) for i in range(0, len(entries) - 11, 12)]
    if not stamps:
        return damage
    known = [ns for ns in (damage.first_ns, damage.last_ns) if ns is not None]
    count = (damage.messages or 0) + len(stamps)
    return replace(damage, messages=count, first_ns=min(known + stamps), last_ns=max(known + stamps))
