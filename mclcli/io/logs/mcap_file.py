"""MCAP files, read from front to back: whole, cut off, unclosed or damaged in the middle.

Nothing is sought while all is well, so a pipe does as well as a file. Every checksum is verified: a chunk that fails is
dropped whole and named. Where the framing itself is broken, reading goes on at the next record that can be found.
Source: MCAP format specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast, final

from mclcli.io.logs import mcap_records as rec
from mclcli.io.logs.base import LARGE, Damage, FileFacts, Item, RawMessage
from mclcli.io.logs.channels import WatchedChannels
from mclcli.io.logs.inflate import CHUNK_LIMIT, RECORD_LIMIT, Budget, CorruptError, inflate, inflate_start
from mclcli.io.logs.report import CUT, RESUMES, UNCLOSED, Report

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from mclcli.io.logs.base import Channel, Recorded
    from mclcli.io.logs.source import ByteSource


@final
@dataclass(frozen=True, slots=True)
class McapFile:
    """An MCAP file or stream; ``start`` opens it at its first byte."""

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

    file: McapFile
    src: ByteSource
    channels: WatchedChannels
    report: Report
    schemas: dict[int, Recorded] = field(default_factory=dict)
    budget: Budget = field(default_factory=Budget)
    messages: int = 0  # seen so far, wanted or not
    declared: int | None = None  # messages that the file's own statistics count
    last_ns: int | None = None
    loose: bool = False  # messages stand outside chunks
    data_ended: bool = False
    closed: bool = False
    data_checked: bool = False  # the data section as a whole has a checksum
    checked: int = 0  # chunks with a checksum of their own
    unchecked: int = 0
    learned: bool = False
    resumes: int = 0
    safe_at: int = len(rec.MAGIC)  # nothing before this byte is searched after broken framing

    def run(self) -> Iterator[Item]:
        """Yield everything."""
        self.src.skip(len(rec.MAGIC))
        going = True
        while going:
            at, crc = self.src.offset, self.src.crc
            head = self.src.read(rec.RECORD.size)
            kind, length = rec.RECORD.unpack(head) if len(head) == rec.RECORD.size else (0, 0)
            if kind != rec.MESSAGE_INDEX:
                yield from self.report.flush()
            if len(head) < rec.RECORD.size:
                going = False
                yield self.end(at, whole=not head)
            elif not self.plausible(kind, length):
                going = yield from self.broken(at, head, None)
            else:
                going = yield from self.record(at, head, crc)
        yield from self.channels.report()
        yield from self.report.totals(self.src.offset, self.messages, self.declared, self.channels.nameless)
        yield FileFacts(self.file.source, "MCAP", self.closed, self.checksums())

    def checksums(self) -> str:
        """Whether the messages are covered by checksums."""
        if self.data_checked or (self.checked and not self.unchecked and not self.loose):
            return "yes"
        if not (self.checked or self.unchecked or self.loose):
            return "unknown"
        return "in part" if self.checked else "no"

    def plausible(self, kind: int, length: int) -> bool:
        """Whether a record could have this kind and length here."""
        if length > self.src.left or length != rec.FIXED.get(kind, length):
            return False
        return kind in rec.KNOWN or kind >= 0x80

    def record(self, at: int, head: bytes, crc: int) -> Generator[Item, None, bool]:
        """Read one record's content and take it in."""
        kind, length = rec.RECORD.unpack(head)
        taken = kind in rec.READ and length <= RECORD_LIMIT
        body = self.src.read(length) if taken else b""
        if len(body) < length and (taken or self.src.skip(length) < length):
            return (yield from self.broken(at, head, body))
        self.safe_at = at + 1
        if kind in rec.READ and not taken:
            yield self.report.too_large(at, length)
            return True
        if kind == rec.CHUNK:
            yield from self.chunk(at, body)
        elif kind == rec.MESSAGE:
            self.loose = True
            yield from self.records(head + body, at)
        elif kind in {rec.SCHEMA, rec.CHANNEL}:
            yield from self.define(kind, body)
        else:
            yield from self.housekeeping(at, kind, head + body, crc)
        return bool(kind != rec.FOOTER)

    def housekeeping(self, at: int, kind: int, record: bytes, crc: int) -> Iterator[Item]:
        """Records about the records: indexes, statistics, checksums, the end."""
        if kind == rec.MESSAGE_INDEX and self.report.bad_chunk is not None:
            count = (self.report.bad_chunk.messages or 0) + rec.index_entries(record[9:])
            self.report.bad_chunk = replace(self.report.bad_chunk, messages=count)
        elif kind == rec.STATISTICS and len(record) >= 17:
            (self.declared,) = struct.unpack_from("<Q", record, 9)
        elif kind == rec.DATA_END:
            (declared,) = struct.unpack_from("<I", record, 9)
            if declared not in {0, crc} and self.src.crc_valid and not self.report.hurt:
                yield self.report.lost(at, "data section fails its checksum; something outside its chunks was altered")
            self.data_checked = declared != 0
            self.data_ended, self.src.crc, self.src.crc_valid = True, 0, True
        elif kind == rec.FOOTER:
            yield from self.close(at, record, crc)

    def close(self, at: int, footer: bytes, crc: int) -> Iterator[Item]:
        """Check what the footer says of the summary, and the mark at the end of the file."""
        self.closed = True
        (declared,) = struct.unpack_from("<I", footer, 25)
        if declared not in {0, zlib.crc32(footer[:25], crc)} and self.src.crc_valid and self.data_ended:
            self.declared = None
            yield self.report.harmless(at, "summary fails its checksum and is not used")
        if self.src.read(len(rec.MAGIC)) != rec.MAGIC:
            yield self.report.harmless(at, "file lacks its closing mark")
        elif rest := self.src.read(len(rec.MAGIC)):
            end = self.src.offset - len(rest)
            if rest == rec.MAGIC:
                yield self.report.lost(end, f"another log follows at byte {end}; it is not read, split the file there")
            else:
                yield self.report.harmless(end, "bytes after the end of the log are ignored")

    def define(self, kind: int, body: bytes) -> Iterator[Item]:
        """Take in a schema or a channel; a malformed one shows when its messages come."""
        if kind == rec.SCHEMA:
            schema = rec.parse_schema(body)
            if schema is not None:
                self.schemas[schema[0]] = schema[1]
        elif (channel := rec.parse_channel(body, self.schemas)) is not None and self.channels.add(*channel):
            yield channel[1]

    def chunk(self, at: int, body: bytes) -> Iterator[Item]:
        """Messages of one chunk, or nothing of it."""
        head = rec.parse_chunk_head(body)
        try:
            if head is None or head.data_at + head.data_length != len(body):
                raise CorruptError("is malformed")  # noqa: TRY301 - every way to drop a chunk ends below
            packed = memoryview(body)[head.data_at :]
            plain = inflate(packed, head.compression, head.size, self.budget)
            self.checked, self.unchecked = self.checked + bool(head.crc), self.unchecked + (not head.crc)
            if head.crc and zlib.crc32(plain) != head.crc:
                raise CorruptError("fails its checksum")  # noqa: TRY301
        except CorruptError as error:
            span = (head.first_ns, head.last_ns) if head and head.first_ns <= head.last_ns else (None, None)
            self.report.bad_chunk = self.report.lost(at, f"chunk at byte {at} {error}", None, *span)
        else:
            in_place = plain is packed
            yield from self.records(body if in_place else bytes(plain), at, head.data_at if in_place else 0)
            self.safe_at = self.src.offset

    def records(self, plain: bytes, at: int, pos: int = 0, *, cut: bool = False) -> Iterator[Item]:
        """Messages of a run of records from ``pos`` on, and what is wrong with it; ``cut``: it may end anywhere."""
        end, count, channels = len(plain), 0, self.channels.by_number
        while pos + 9 <= end:
            kind, length = rec.RECORD.unpack_from(plain, pos)
            stop = pos + 9 + length
            if stop > end or length < rec.SHORTEST.get(kind, stop):
                break
            if kind == rec.MESSAGE:
                number, _, stamp, published = rec.MESSAGE_HEAD.unpack_from(plain, pos + 9)
                if number not in channels:
                    yield from self.learn()
                count += 1
                watched = channels.get(number)
                if watched is None:
                    self.channels.nameless += 1
                elif watched.wanted:
                    data = (
                        plain[pos + 31 : stop] if length < LARGE else cast("bytes", memoryview(plain)[pos + 31 : stop])
                    )
                    yield RawMessage(watched.channel, stamp, data, published)
                else:
                    watched.pass_over(stamp)
                    if not self.channels.reported:
                        yield from self.channels.report()
                self.last_ns = stamp
            elif kind in {rec.SCHEMA, rec.CHANNEL}:
                yield from self.define(kind, plain[pos + 9 : stop])
            pos = stop
        self.messages += count
        if pos < end and not cut:
            yield self.report.lost(at, f"records at byte {at} are broken inside; the rest of them is skipped")

    def learn(self) -> Iterator[Item]:
        """Take the channels that the summary repeats, once, where the records that defined them were lost."""
        if not self.learned and self.src.size is not None:
            with self.file.start() as src:
                summary = rec.read_summary(src)
            for number, channel in rec.parse_definitions(summary):
                if number not in self.channels.by_number and self.channels.add(number, channel):
                    yield channel
        self.learned = True

    def broken(self, at: int, head: bytes, body: bytes | None) -> Generator[Item, None, bool]:
        """Framing is wrong at byte ``at``: find the next record that makes sense, or see the file as cut there."""
        if self.data_ended:
            self.declared = None
            yield self.report.harmless(at, f"summary is damaged at byte {at}, or cut; it is not needed")
            return False
        self.src.unread(head[1:] + (body or b""))
        if rec.RECORD.unpack(head)[0] not in rec.KNOWN:
            self.src.go_to(self.safe_at)
        if self.resumes < RESUMES and self.search():
            self.resumes += 1
            next_chunk = rec.peek_chunk(self.src)
            span = (self.last_ns, next_chunk.first_ns) if next_chunk and self.last_ns is not None else (None, None)
            what = f"framing is broken at byte {at}; read on from byte {self.src.offset}"
            yield self.report.lost(at, what, None, *span)
            return True
        yield from self.cut(at, head, body)
        return False

    def search(self) -> bool:
        """Go to the next chunk, or message where messages stand outside chunks."""
        if self.loose and self.channels.by_number:
            return self.src.find(rec.messages_like(self.channels.by_number), rec.message_start)
        return self.src.find(rec.CHUNK_START, rec.chunk_start)

    def cut(self, at: int, head: bytes, body: bytes | None) -> Iterator[Item]:
        """Nothing follows a broken record: take what the beginning of a chunk gives."""
        kind, length = rec.RECORD.unpack(head)
        if kind not in rec.KNOWN or (body is None and self.src.size is None):
            yield self.report.lost(at, f"framing is broken at byte {at}; nothing readable follows")
            return
        if body is None:
            self.src.go_to(at + len(head))
            body = self.src.read(min(length, self.src.left, CHUNK_LIMIT))
        chunk = rec.parse_chunk_head(body) if kind == rec.CHUNK else None
        if chunk is None:
            yield self.report.lost(at, CUT)
            return
        before = self.messages
        plain = inflate_start(body[chunk.data_at :], chunk.compression, chunk.size, self.budget)
        yield from self.records(plain, at, cut=True)
        recovered = self.messages - before
        first = self.last_ns if recovered else chunk.first_ns
        what = f"{CUT}; {recovered} messages of its last chunk were recovered unverified" if recovered else CUT
        yield self.report.lost(at, what, None, first, chunk.last_ns)

    def end(self, at: int, *, whole: bool) -> Damage:
        """The file is over without a footer."""
        if self.data_ended:
            return self.report.harmless(at, "file ends within its summary; no message is lost")
        return self.report.lost(at, UNCLOSED if whole else CUT)
