"""ROS 1 bags, version 2.0, read from front to back: whole, cut off, unindexed (.bag.active) or damaged in the middle.

The index is not needed: messages come from the chunks as they stand; what the index counts is compared at the end.
Source: ROS wiki, Bags/Format/2.0.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, cast, final

from mclcli.io.logs import bag1_records as rec
from mclcli.io.logs import bag1_search as search
from mclcli.io.logs.base import DEFINITIONS, EVERYTHING, LARGE, Damage, FileFacts, Item, RawMessage, Wish
from mclcli.io.logs.channels import WatchedChannels
from mclcli.io.logs.holding import Nameless, hold, name
from mclcli.io.logs.inflate import CHUNK_LIMIT, RECORD_LIMIT, Budget, CorruptError, inflate, inflate_start
from mclcli.io.logs.inventory import Inventory
from mclcli.io.logs.report import CUT, RESUMES, Report

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

    def items(self, wish: Wish = EVERYTHING) -> Iterator[Item]:
        """Channels, messages and damage in file order (see ``Container``)."""
        with self.start() as src:
            yield from _Pass(self, src, WatchedChannels(wish, src.size is None), Report(self.source)).run()


@final
@dataclass(slots=True)
class _Pass:
    """One pass over a file. Generators that answer a bool say whether reading can go on."""

    file: Bag1File
    src: ByteSource
    channels: WatchedChannels
    report: Report
    budget: Budget = field(default_factory=Budget)
    inventory: Inventory = field(default_factory=Inventory)
    index_at: int = 0  # where the bag header says that the index starts; 0 in a bag that was not closed
    messages: int = 0
    indexed: int = 0  # chunks that the index counts
    chunked: bool = False  # chunks were met
    loose: bool = False  # messages stand outside chunks
    padded: bool = False  # zeros stand between records
    plain: bool = False  # messages are not compressed: none can tell whether they were altered
    last_ns: int = 0
    learned: bool = False
    resumes: int = 0
    began: int = 0  # where the last record of a chunk began
    safe_at: int = len(rec.MAGIC)  # nothing before this byte is searched after broken framing

    def run(self) -> Iterator[Item]:
        """Everything; messages pass through as few hands as possible."""
        found = self.records_of_file()
        items = hold(found, self.channels) if self.channels.later else cast("Iterator[Item]", found)
        return chain(items, self.last_words())

    def last_words(self) -> Iterator[Item]:
        """What was passed over, what is missing, and what the file is."""
        yield from self.channels.report()
        yield from self.inventory.settle(self.src.offset, self.report, self.messages, self.channels)
        closed = 0 < self.index_at <= self.src.offset or (not self.index_at and self.indexed > 0)
        yield FileFacts(self.file.source, "ROS 1 bag", closed, "no")

    def records_of_file(self) -> Iterator[Item | Nameless]:
        """Read one record after the other."""
        self.src.skip(len(rec.MAGIC))
        going = True
        while going:
            at = self.src.offset
            raw, head, size = self.head()
            if self.report.bad_chunk is not None and head.kind != rec.INDEX:
                yield from self.report.flush(broken=bool(raw) and (head.kind == 0 or size > self.src.left))
            if not raw:
                yield from self.end(at)
                break
            if head.kind == 0 and raw[:1] == b"\0":
                yield from self.skip_zeros(at, raw)
                continue
            if head.kind == 0 or size > self.src.left:
                going = yield from self.broken(at, raw, head, None)
            else:
                going = yield from self.record(at, raw, head, size)

    def skip_zeros(self, at: int, raw: bytes) -> Iterator[Damage]:
        """Pass over zeros where a record would start: padding in a bag whose index will tell if anything is missing."""
        self.src.unread(raw)
        self.src.find(_NOT_ZERO, lambda match, _: match.start())
        self.padded = True
        if self.index_at < self.src.offset and not self.indexed:
            yield self.report.lost(at, f"zeros from byte {at} to byte {self.src.offset}")

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
        if head.kind not in rec.KINDS:
            return raw, nothing, 0
        declared: int = rec.LENGTH.unpack_from(raw, 4 + length)[0]
        return raw, head, rec.index_entries(head) if head.kind == rec.INDEX else declared

    def record(self, at: int, raw: bytes, head: Head, size: int) -> Generator[Item | Nameless, None, bool]:
        """Read one record's data and take it in."""
        if size > RECORD_LIMIT and self.src.skip(size) == size:
            yield self.report.too_large(at, size)
            return True
        data = self.src.read(size)
        if len(data) < size or (head.kind == rec.BAG_HEADER and data.strip(b" \0")):
            return (yield from self.broken(at, raw, head, data))
        self.safe_at = at + 1
        if head.kind == rec.CHUNK:
            yield from self.chunk(at, head, data)
        elif head.kind in search.IN_CHUNKS:
            self.loose = self.loose or head.kind == rec.MESSAGE
            yield from self.mended(raw + data, at, (yield from self.unbroken(raw + data, 0)))
        elif head.kind == rec.INDEX and self.report.bad_chunk is not None:
            self.report.bad_chunk = self.with_index(self.report.bad_chunk, data)
        elif head.kind == rec.CHUNK_INFO:
            self.indexed += 1
            counts = sum(rec.LENGTH.unpack_from(data, i + 4)[0] for i in range(0, len(data) - 7, 8))
            self.inventory.declared = (self.inventory.declared or 0) + counts
        elif head.kind == rec.BAG_HEADER:
            self.index_at = head.number(b"index_pos")
        return True

    def chunk(self, at: int, head: Head, data: bytes) -> Iterator[Item | Nameless]:
        """Messages of one chunk, or nothing of it."""
        self.chunked = True
        compression, size = head.text(b"compression"), head.number(b"size")
        try:
            plain = inflate(data, compression, size, self.budget)
        except CorruptError as error:
            self.report.bad_chunk = self.report.lost(at, f"chunk at byte {at} {error}")
            self.look_within(at, data, 0)
            return
        self.plain = self.plain or plain is data
        first = self.inventory.original((size, len(data)), data, at)
        if first is not None:
            yield self.report.lost(at, f"chunk at byte {at} repeats the one at byte {first}; the copy is left out", 0)
            return
        records = bytes(plain)
        stop = yield from self.unbroken(records, 0)
        self.safe_at = at + 1 if plain is data else self.src.offset
        if stop < len(records):
            inside = self.look_within(at, data, self.began) if plain is data else None
            yield from self.mended(records[:inside], at, stop)

    def look_within(self, at: int, data: bytes, start: int) -> int | None:
        """Go on at the chunk that a damaged one has swallowed behind ``start``; returns where, None if there is none.

        One that begins in it and ends behind it is searched from the start, once framing breaks.
        """
        inside = self.src.go_on_within(data, start, search.chunk_within)
        self.safe_at = at + 1 if inside is None else self.src.offset
        return inside

    def mended(self, plain: bytes, at: int, stop: int) -> Iterator[Item | Nameless]:
        """The rest of a run of records that is broken at ``stop``, as far as records can be found in it."""
        if stop > len(plain):
            yield self.report.beyond(at, f"the last record of those at byte {at} has swallowed the next chunk's head")
        while stop < len(plain):
            again = self.next_record(plain, stop)
            rest = "the rest of them is skipped" if again == len(plain) else f"{again - stop} bytes of them are skipped"
            yield self.report.beyond(at, f"records at byte {at} are broken inside; {rest}")
            stop = yield from self.unbroken(plain, again)

    def unbroken(self, plain: bytes, stop: int) -> Generator[Item | Nameless, None, int]:
        """Messages up to the first record that makes no sense; returns where that is."""
        channels, before = self.channels.by_number, stop
        for head, start, stop in rec.walk(plain, stop):  # noqa: B020, PLR1704 - where it ends is where it goes on
            self.began, before = before, stop
            if head.kind == rec.MESSAGE:
                number, stamp = head.number(b"conn"), head.stamp_ns
                if number not in channels:
                    yield from self.learn()
                self.messages += 1
                self.last_ns = stamp
                watched = channels.get(number)
                if watched is None:
                    message = Nameless(number, stamp, plain[start:stop], None, None)
                    yield from (message,) if self.channels.later else name(message, self.channels)
                elif watched.wanted:
                    data = plain[start:stop] if stop - start < LARGE else cast("bytes", memoryview(plain)[start:stop])
                    yield _new(RawMessage, (watched.channel, stamp, data, None, None))
                else:
                    watched.pass_over(stamp)
                    if not self.channels.reported:
                        yield from self.channels.report()
            else:
                yield from self.connection(head, plain[start:stop])
        return stop

    def next_record(self, plain: bytes, stop: int) -> int:
        """Where the next message or connection after ``stop`` starts within a run of records; its end if none does."""
        self.resumes += 1
        if self.resumes > RESUMES:
            return len(plain)
        start_of = search.record_start(search.IN_CHUNKS)
        starts = (start_of(match, len(plain)) for match in search.RECORD_START.finditer(plain, stop + 1))
        return next((start for start in starts if start is not None and start > stop), len(plain))

    def connection(self, head: Head, data: bytes) -> Iterator[Channel]:
        """Take in a connection record; a malformed one shows when its messages come."""
        channel = rec.parse_connection(head, data) if head.kind == rec.CONNECTION else None
        if channel is not None and self.channels.add(head.number(b"conn"), channel):
            yield channel

    def learn(self) -> Iterator[Item]:
        """Take the connections that stand anywhere in the file, once, where those that should come first are lost."""
        if self.learned or self.src.size is None or self.channels.wish is DEFINITIONS:
            return
        self.learned = True
        with self.file.start() as src:
            whole = _Pass(self.file, src, WatchedChannels(DEFINITIONS), Report(self.file.source))
            for _ in whole.run():
                pass
        for number, watched in whole.channels.by_number.items():
            if number not in self.channels.by_number and self.channels.add(number, watched.channel):
                yield watched.channel

    def broken(self, at: int, raw: bytes, head: Head, data: bytes | None) -> Generator[Item | Nameless, None, bool]:
        """Framing is wrong at byte ``at``: find the next record that makes sense, or see the file as cut there."""
        indexed = 0 < self.index_at <= at or (not self.index_at and self.indexed > 0)
        if indexed and raw[:4] == rec.MAGIC[:4]:
            yield self.report.beyond(at, f"another log follows at byte {at}; it is not read, split the file there")
            return False
        yield from self.report.flush()
        self.src.unread(raw[1:] + (data or b""))
        if self.safe_at < at:
            self.src.go_to(self.safe_at)
        if self.resumes < RESUMES and self.search(indexed=indexed):
            self.resumes += 1
            what = f"framing is broken at byte {at}; read on from byte {self.src.offset}"
            self.report.bad_chunk = replace(self.report.lost(at, what), least=True)  # or more
            self.report.apart = self.report.apart or self.plain
            return True
        if indexed:
            self.inventory.forget()
            what = f"index is damaged at byte {at}, or cut"
            if self.padded:  # nothing tells that the zeros before were no messages
                yield self.report.beyond(at, what)
            else:
                yield self.report.harmless(at, f"{what}; it is not needed")
            return False
        yield from self.cut(at, raw, head, data)
        return False

    def search(self, *, indexed: bool) -> bool:
        """Go to the next record that makes sense; ``indexed``: behind the start of the index, to the next chunk."""
        if self.channels.wish is DEFINITIONS:
            kinds = search.OUTSIDE | {rec.CONNECTION}
        elif indexed:
            kinds = frozenset({rec.CHUNK})
        else:
            kinds = search.OUTSIDE if self.in_chunks() else search.OUTSIDE | search.IN_CHUNKS
        return self.src.find(search.RECORD_START, search.record_start(kinds))

    def in_chunks(self) -> bool:
        """Whether messages stand in chunks; a chunk that is still to come says so as well."""
        if self.loose or self.chunked or self.src.size is None:
            return self.chunked and not self.loose
        with self.file.start() as src:
            src.go_to(self.src.offset)
            return src.find(search.CHUNK_START, search.chunk_start)

    def cut(self, at: int, raw: bytes, head: Head, data: bytes | None) -> Iterator[Item | Nameless]:
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
            yield from self.unbroken(plain, 0)
            recovered = self.messages - before
        what = f"{CUT}; {recovered} messages of its last chunk were recovered" if recovered else CUT
        yield self.report.lost(at, what)

    def end(self, at: int) -> Iterator[Damage]:
        """The file ends where a record would start."""
        if self.index_at == 0 and not self.indexed:
            yield self.report.unclosed(at)
        elif at < self.index_at:
            yield self.report.lost(
                at, f"file ends at byte {at}, before its index at byte {self.index_at}; it was cut off"
            )

    def with_index(self, lost: Damage, entries: bytes) -> Damage:
        """What was lost with a chunk, with the messages that an index behind it lists."""
        stamps = [rec.stamp_ns(entries[i : i + 8]) for i in range(0, len(entries) - 11, 12)]
        if not stamps or (lost.messages is None and max(stamps) <= self.last_ns):
            return lost  # of the chunk before, which was read
        known = [ns for ns in (lost.first_ns, lost.last_ns) if ns is not None]
        count = (lost.messages or 0) + len(stamps)
        return replace(lost, messages=count, first_ns=min(known + stamps), last_ns=max(known + stamps))


_new = tuple.__new__  # half the time of a named tuple's own
_NOT_ZERO = re.compile(rb"[^\0]")
