"""MCAP files, read from front to back: whole, cut off, unclosed or damaged in the middle.

Nothing is sought while all is well, so a pipe does as well as a file. Every checksum is verified: a chunk that fails is
dropped whole and named. Where the framing itself is broken, reading goes on at the next record that can be found.
Source: MCAP format specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, cast, final

from mclcli.io.logs import mcap_records as rec
from mclcli.io.logs import mcap_search as search
from mclcli.io.logs.base import DEFINITIONS, EVERYTHING, Damage, FileFacts, Heading, Item, Wish
from mclcli.io.logs.channels import WatchedChannels
from mclcli.io.logs.holding import hold
from mclcli.io.logs.inflate import CHUNK_LIMIT, RECORD_LIMIT, Budget, CorruptError, inflate, inflate_start
from mclcli.io.logs.inventory import Inventory
from mclcli.io.logs.mcap_contents import Contents, Definitions
from mclcli.io.logs.report import CUT, DATA_ALTERED, RESUMES, Report

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Mapping

    from mclcli.io.logs.holding import Nameless
    from mclcli.io.logs.source import ByteSource, Origin


def open_mcap(source: str, start: Origin) -> McapFile:
    """Container for a file or a stream."""
    return McapFile(source, start, start.types)


@final
@dataclass(frozen=True, slots=True)
class McapFile:
    """An MCAP file or stream; ``start`` opens it at its first byte; ``types`` are those of topics without a schema."""

    source: str
    start: Callable[[], ByteSource]
    types: Mapping[str, str] = field(default_factory=dict)

    def items(self, wish: Wish = EVERYTHING) -> Iterator[Item]:
        """Channels, messages and damage in file order (see ``Container``)."""
        with self.start() as src:
            yield from _Pass(self, src, WatchedChannels(wish, src.size is None, self.types), Report(self.source)).run()


@final
@dataclass(slots=True)
class _Pass:
    """One pass over a file. Generators that answer a bool say whether reading can go on."""

    file: McapFile
    src: ByteSource
    channels: WatchedChannels
    report: Report
    contents: Contents = field(init=False)
    budget: Budget = field(default_factory=Budget)
    inventory: Inventory = field(default_factory=Inventory)
    last_span: tuple[int, int] | None = None  # log times of the chunk before
    loose: bool = False  # messages stand outside chunks
    chunked: bool = False  # chunks were met
    data_ended: bool = False
    closed: bool = False
    data_checked: bool = False  # the data section as a whole has a checksum
    checked: int = 0  # chunks with a checksum of their own
    unchecked: int = 0
    resumes: int = 0
    safe_at: int = len(rec.MAGIC)  # nothing before this byte is searched after broken framing

    def __post_init__(self) -> None:
        """Search the file for definitions only where it can be read again, and not while that is done."""
        again = self.src.size is not None and self.channels.wish is not DEFINITIONS
        self.contents = Contents(self.channels, self.report, self.definitions if again else None)

    def run(self) -> Iterator[Item]:
        """Everything; messages pass through as few hands as possible."""
        found = self.records_of_file()
        items = hold(found, self.channels) if self.channels.later else cast("Iterator[Item]", found)
        return chain(items, self.last_words())

    def last_words(self) -> Iterator[Item]:
        """What was passed over, what is missing, and what the file is."""
        yield from self.channels.report()
        yield from self.inventory.settle(self.src.offset, self.report, self.contents.messages, self.channels)
        yield FileFacts(self.file.source, "MCAP", self.closed, self.checksums())

    def records_of_file(self) -> Iterator[Item | Nameless]:
        """Read one record after the other, and at last the chunks that only the index knows of."""
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
            elif not search.plausible(kind, length, self.src.left):
                going = yield from self.broken(at, head, None)
            else:
                going = yield from self.record(at, head, crc)
        yield from self.passed_chunks()

    def checksums(self) -> str:
        """Whether the messages are covered by checksums."""
        unchecked = self.unchecked or self.loose
        if self.data_checked or (self.checked and not unchecked):
            return "yes"
        return "in part" if self.checked else "no" if unchecked else "unknown"

    def record(self, at: int, head: bytes, crc: int) -> Generator[Item | Nameless, None, bool]:
        """Read one record's content and take it in."""
        kind, length = rec.RECORD.unpack(head)
        taken = kind not in self.skipped() and length <= RECORD_LIMIT
        body = self.src.read(length if taken else min(length, search.WINDOW))
        if (
            len(body) < min(length, search.WINDOW)
            or (taken and len(body) < length)
            or self.disguised(kind, length, body)
        ):
            return (yield from self.broken(at, head, body))
        if not taken and self.src.skip(length - len(body)) < length - len(body):
            return (yield from self.broken(at, head, None))
        self.safe_at = at + 1
        if kind in rec.KNOWN and length > RECORD_LIMIT:
            yield self.report.too_large(at, length)
            if kind == rec.CHUNK and (chunk := rec.parse_chunk_head(body)) is not None:
                self.inventory.meet(chunk.key(length))
        elif kind == rec.CHUNK:
            yield from self.chunk(at, body)
        elif kind == rec.MESSAGE:
            self.loose = True
            yield from self.contents.records(head + body, at)
        elif kind in {rec.SCHEMA, rec.CHANNEL}:
            yield from self.contents.define(kind, body)
        elif kind == rec.FOOTER:
            return (yield from self.close(at, head + body, crc))
        elif taken:
            yield from self.housekeeping(at, kind, body, crc)
        return True

    def skipped(self) -> frozenset[int]:
        """Kinds of records that are not read as a whole."""
        return search.PASSED if self.channels.wish.beside else search.PASSED | {rec.ATTACHMENT}

    def disguised(self, kind: int, length: int, start: bytes) -> bool:
        """Whether a record is not what its kind says."""
        if kind & 0x7F == rec.MESSAGE:
            return self.contents.reads_as_message(kind, start)
        return not search.fits(kind, length, start, self.src.left + len(start))

    def housekeeping(self, at: int, kind: int, body: bytes, crc: int) -> Iterator[Item]:
        """Records about the records: indexes, statistics, checksums; and what stands beside the messages."""
        if kind == rec.MESSAGE_INDEX:
            self.report.count_index(rec.index_entries(body), int.from_bytes(body[6:14], "little"), self.last_span)
        elif kind == rec.CHUNK_INDEX and (index := rec.parse_chunk_index(body)) is not None:
            self.inventory.listed[index.start] = index
        elif kind == rec.STATISTICS:
            (self.inventory.declared,) = struct.unpack_from("<Q", body)
        elif kind == rec.DATA_END:
            (declared,) = struct.unpack_from("<I", body)
            if declared not in {0, crc} and self.src.crc_valid and not self.report.hurt:
                yield self.report.beyond(at, DATA_ALTERED)
            self.data_checked = declared != 0
            self.data_ended, self.src.crc, self.src.crc_valid = True, 0, True
        elif self.channels.wish.beside:
            yield from self.beside(at, kind, body)

    def beside(self, at: int, kind: int, body: bytes) -> Iterator[Item]:
        """What stands beside the messages."""
        if kind == rec.HEADER and (said := rec.parse_header(body)):
            yield Heading(*said)
        elif kind in {rec.ATTACHMENT, rec.METADATA}:
            parsed = rec.parse_attachment(body) if kind == rec.ATTACHMENT else rec.parse_metadata(body)
            what = "attachment" if kind == rec.ATTACHMENT else "metadata record"
            yield parsed or self.report.lost(at, f"{what} at byte {at} is damaged and left out", 0)

    def close(self, at: int, footer: bytes, crc: int) -> Generator[Item, None, bool]:
        """Check the summary and the mark at the end; True if records follow, and messages are missing so far."""
        (declared,) = struct.unpack_from("<I", footer, 25)
        if declared not in {0, zlib.crc32(footer[:25], crc)} and self.src.crc_valid and self.data_ended:
            self.inventory.forget()
            yield self.report.harmless(at, "summary fails its checksum and is not used")
        mark = self.src.read(len(rec.MAGIC))
        rest = self.src.read(len(rec.MAGIC)) if mark == rec.MAGIC else mark[:0]
        another, end = rest == rec.MAGIC, self.src.offset - len(rest)
        whole = self.data_ended and self.inventory.expected() in {None, self.contents.messages}
        if (rest or mark != rec.MAGIC) and not another and not whole:
            self.src.unread(rest or mark)
            self.data_ended = False
            if self.resume(at, f"footer at byte {at} is not the end"):
                return True
        self.closed = True
        if mark != rec.MAGIC:
            yield self.report.harmless(at, "file lacks its closing mark")
        elif another:
            yield self.report.beyond(end, f"another log follows at byte {end}; it is not read, split the file there")
        elif rest:
            yield self.report.harmless(end, "bytes after the end of the log are ignored")
        return False

    def chunk(self, at: int, body: bytes) -> Iterator[Item | Nameless]:
        """Messages of one chunk, or nothing of it."""
        head = rec.parse_chunk_head(body)
        self.chunked = True
        try:
            if head is None or head.data_at + head.data_length != len(body):
                raise CorruptError("is malformed")  # noqa: TRY301 - every way to drop a chunk ends below
            key = head.key(len(body))
            self.inventory.meet(key)
            packed = memoryview(body)[head.data_at :]
            plain = inflate(packed, head.compression, head.size, self.budget)
            if head.crc and zlib.crc32(plain) != head.crc:
                raise CorruptError("fails its checksum")  # noqa: TRY301
        except CorruptError as error:
            self.drop(at, body, head, str(error))
            return
        self.checked, self.unchecked = self.checked + bool(head.crc), self.unchecked + (not head.crc)
        first = self.inventory.original(key, body, at)
        if first is not None:
            yield self.report.lost(at, f"chunk at byte {at} repeats the one at byte {first}; the copy is left out", 0)
            return
        in_place = plain is packed
        self.last_span = head.first_ns, head.last_ns
        records = body if in_place else bytes(plain)
        stop = yield from self.contents.unbroken(records, head.data_at if in_place else 0)
        self.safe_at = at + 1 if in_place and not head.crc else self.src.offset
        if stop < len(records):
            inside = self.look_within(at, records, self.contents.began) if in_place else None
            yield from self.contents.mended(records[:inside], at, stop)

    def drop(self, at: int, body: bytes, head: rec.ChunkHead | None, error: str) -> None:
        """Say that a chunk cannot be used, and go on at the chunk that its length has swallowed, if there is one."""
        span = (head.first_ns, head.last_ns) if head and head.first_ns <= head.last_ns else (None, None)
        self.report.bad_chunk = self.report.lost(at, f"chunk at byte {at} {error}", None, *span)
        self.look_within(at, body, 0)

    def look_within(self, at: int, body: bytes, start: int) -> int | None:
        """Go on at the chunk that a damaged one has swallowed behind ``start``; returns where, None if there is none.

        One that begins in it and ends behind it is searched from the start, once framing breaks.
        """
        inside = self.src.go_on_within(body, start, search.chunk_within)
        self.safe_at = at + 1 if inside is None else self.src.offset
        return inside

    def definitions(self) -> Definitions:
        """Schemas and channels that stand anywhere in the file."""
        with self.file.start() as src:
            whole = _Pass(self.file, src, WatchedChannels(DEFINITIONS, types=self.file.types), Report(self.file.source))
            for _ in whole.run():
                pass
        found = {number: watched.channel for number, watched in whole.channels.by_number.items()}
        return Definitions(whole.contents.schemas, found)

    def passed_chunks(self) -> Iterator[Item | Nameless]:
        """Chunks that the index names, that are where it says, and that were not met on the way."""
        if self.src.size is None:
            return
        for index in sorted(self.inventory.missing(), key=lambda index: index.start):
            length = index.key[2]
            if not len(rec.MAGIC) <= index.start <= self.src.size - length or length > RECORD_LIMIT:
                continue
            self.src.go_to(index.start)
            body = self.src.read(length)[rec.RECORD.size :]
            head = rec.parse_chunk_head(body)
            if head is not None and head.key(len(body)) == index.key:
                before = self.contents.messages
                yield from self.chunk(index.start, body)
                yield from self.report.flush()
                yield from self.report.regained(index.start, self.contents.messages - before)
        self.src.go_to(self.src.size)

    def broken(self, at: int, head: bytes, body: bytes | None) -> Generator[Item | Nameless, None, bool]:
        """Framing is wrong at byte ``at``: find the next record that makes sense, or see the file as cut there."""
        yield from self.report.flush(broken=True)
        self.src.unread(head[1:] + (body or b""))
        if self.safe_at < at:
            self.src.go_to(self.safe_at)
        if self.resume(at, f"framing is broken at byte {at}"):
            return True
        if self.data_ended:
            self.inventory.forget()
            yield self.report.harmless(at, f"summary is damaged at byte {at}, or cut; it is not needed")
            return False
        yield from self.cut(at, head, body)
        return False

    def resume(self, at: int, what: str) -> bool:
        """Go on at the next record behind damage at byte ``at``, which ``what`` says; False if there is none."""
        if self.resumes >= RESUMES or not self.search():
            return False
        self.resumes += 1
        self.report.apart = self.report.apart or self.loose or self.unchecked > 0
        until = search.until_chunk(self.src, self.contents.last_ns)
        lost = self.report.lost(at, f"{what}; read on from byte {self.src.offset}", None, *until)
        self.report.bad_chunk = replace(lost, least=True)  # what its length has swallowed is not known
        return True

    def search(self) -> bool:
        """Go to the next record: of any kind before the data end, then to the next chunk."""
        if self.data_ended:
            return self.src.find(search.CHUNK_START, search.chunk_start)
        known, wants = frozenset(self.channels.by_number), self.channels.wish is DEFINITIONS
        last_ns, loose = self.contents.last_ns, not self.in_chunks()
        return self.src.find(
            search.RECORD_START, search.record_start(last_ns, known, messages=loose, definitions=wants)
        )

    def in_chunks(self) -> bool:
        """Whether messages stand in chunks; a chunk that is still to come says so as well."""
        if self.loose or self.chunked or self.src.size is None:
            return self.chunked and not self.loose
        with self.file.start() as src:
            src.go_to(self.src.offset)
            return src.find(search.CHUNK_START, search.chunk_start)

    def cut(self, at: int, head: bytes, body: bytes | None) -> Iterator[Item | Nameless]:
        """Nothing follows a broken record: take what the beginning of a chunk gives."""
        kind, length = rec.RECORD.unpack(head)
        if kind not in rec.KNOWN or (body is None and self.src.size is None):
            yield self.report.lost(at, f"framing is broken at byte {at}; nothing readable follows")
            return
        if body is None:
            self.src.go_to(at + len(head))
            body = self.src.read(min(length, self.src.left, CHUNK_LIMIT))
        if kind != rec.CHUNK or (chunk := rec.parse_chunk_head(body)) is None:
            yield self.report.lost(at, CUT)
            return
        before = self.contents.messages
        plain = inflate_start(body[chunk.data_at :], chunk.compression, chunk.size, self.budget)
        yield from self.contents.records(plain, at, cut=True)
        recovered = self.contents.messages - before
        more = f"; {recovered} messages of its last chunk were recovered unverified" if recovered else ""
        first_ns = self.contents.last_ns if recovered else chunk.first_ns
        yield self.report.lost(at, CUT + more, None, first_ns, chunk.last_ns)

    def end(self, at: int, *, whole: bool) -> Damage:
        """The file is over without a footer."""
        if self.data_ended:
            return self.report.harmless(at, "file ends within its summary; no message is lost")
        return self.report.unclosed(at) if whole else self.report.lost(at, CUT)
