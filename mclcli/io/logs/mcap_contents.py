"""Messages, schemas and channels of an MCAP, from runs of records: whole chunks, or single records outside chunks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast, final

from mclcli.io.logs import mcap_records as rec
from mclcli.io.logs import mcap_search as search
from mclcli.io.logs.base import LARGE, RawMessage
from mclcli.io.logs.holding import Nameless, name
from mclcli.io.logs.report import RESUMES

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from mclcli.io.logs.base import Channel, Item, Recorded
    from mclcli.io.logs.channels import WatchedChannels
    from mclcli.io.logs.report import Report

_new = tuple.__new__  # half the time of a named tuple's own


@final
@dataclass(frozen=True, slots=True)
class Definitions:
    """Schemas and channels by their numbers."""

    schemas: dict[int, Recorded]
    channels: dict[int, Channel]


@final
@dataclass(slots=True)
class Contents:
    """What was found so far: ``schemas`` by number, ``messages`` counted, log time of the last one.

    ``search_file`` gives the definitions that stand anywhere in the file; None where it cannot be read again.
    """

    channels: WatchedChannels
    report: Report
    search_file: Callable[[], Definitions] | None
    schemas: dict[int, Recorded] = field(default_factory=dict)
    messages: int = 0  # seen so far, wanted or not
    last_ns: int | None = None
    resumes: int = 0
    began: int = 0  # where the last record of a run began

    def records(self, plain: bytes, at: int, pos: int = 0, *, cut: bool = False) -> Iterator[Item | Nameless]:
        """Messages of a run of records from ``pos`` on, and what is wrong with it; ``cut``: it may end anywhere."""
        pos = yield from self.unbroken(plain, pos)
        if not cut:
            yield from self.mended(plain, at, pos)

    def mended(self, plain: bytes, at: int, pos: int) -> Iterator[Item | Nameless]:
        """The rest of a run of records that is broken at ``pos``, as far as records can be found in it."""
        if pos > len(plain):
            yield self.report.beyond(at, f"the last record of those at byte {at} has swallowed the next chunk's head")
        while pos < len(plain):
            again = self.next_record(plain, pos)
            rest = "the rest of them is skipped" if again == len(plain) else f"{again - pos} bytes of them are skipped"
            yield self.report.beyond(at, f"records at byte {at} are broken inside; {rest}")
            pos = yield from self.unbroken(plain, again)

    def unbroken(self, plain: bytes, pos: int) -> Generator[Item | Nameless, None, int]:  # noqa: C901 - every message passes
        """Messages up to the first record that makes no sense; returns where that is."""
        end, count, channels, began = len(plain), 0, self.channels.by_number, pos
        while pos + 9 <= end:
            kind, length = rec.RECORD.unpack_from(plain, pos)
            stop = pos + 9 + length
            if stop > end or length < rec.SHORTEST.get(kind, stop):
                break
            if kind == rec.MESSAGE:
                number, sequence, stamp, published = rec.MESSAGE_HEAD.unpack_from(plain, pos + 9)
                if number not in channels:
                    yield from self.learn()
                count += 1
                watched = channels.get(number)
                if watched is None:
                    yield from self.nameless(Nameless(number, stamp, plain[pos + 31 : stop], published, sequence))
                    began, pos = pos, stop
                    continue
                if sequence > watched.high:  # noqa: PLR1730 - calls take longer
                    watched.high = sequence
                if sequence < watched.low:  # noqa: PLR1730
                    watched.low = sequence
                if watched.wanted:
                    data = (
                        plain[pos + 31 : stop] if length < LARGE else cast("bytes", memoryview(plain)[pos + 31 : stop])
                    )
                    yield _new(RawMessage, (watched.channel, stamp, data, published, sequence))
                else:
                    watched.pass_over(stamp)
                    if not self.channels.reported:
                        yield from self.channels.report()
                self.last_ns = stamp
            elif kind in {rec.SCHEMA, rec.CHANNEL}:
                yield from self.define(kind, plain[pos + 9 : stop])
            elif self.reads_as_message(kind, plain[pos + 9 : stop]):
                break
            began, pos = pos, stop
        self.messages += count
        self.began = began
        return pos

    def nameless(self, message: Nameless) -> Iterator[Item | Nameless]:
        """A message that nothing has described: to be held where it is read from a stream, or else lost."""
        if self.channels.later:
            yield message
        else:
            yield from name(message, self.channels)

    def reads_as_message(self, kind: int, content: bytes) -> bool:
        """Whether a private record differs from a message by the one bit that makes it private."""
        if kind & 0x7F != rec.MESSAGE or kind == rec.MESSAGE or len(content) < rec.MESSAGE_HEAD.size:
            return False
        return int.from_bytes(content[:2], "little") in self.channels.by_number

    def next_record(self, plain: bytes, pos: int) -> int:
        """Where the next message or definition after ``pos`` starts within a run of records; its end if none does."""
        self.resumes += 1
        if self.resumes > RESUMES:
            return len(plain)
        start_of = search.record_start(self.last_ns, frozenset(self.channels.by_number), messages=True)
        matches = search.RECORD_START.finditer(plain, pos + 1)
        found = (
            match.start() for match in matches if plain[match.start()] in rec.SHORTEST and start_of(match, len(plain))
        )
        return next(found, len(plain))

    def define(self, kind: int, body: bytes) -> Iterator[Item]:
        """Take in a schema or a channel."""
        if kind == rec.SCHEMA:
            schema = rec.parse_schema(body)
            if schema is None:
                yield self.malformed("schema")
            else:
                self.schemas[schema[0]] = schema[1]
            return
        if int.from_bytes(body[2:4], "little") not in {0, *self.schemas}:
            yield from self.learn()
        channel = rec.parse_channel(body, self.schemas)
        if channel is None:
            yield self.malformed("channel")
        elif added := self.channels.add(*channel):
            yield added

    def malformed(self, what: str) -> Item:
        """Damage for a definition that does not parse: perhaps it was a message."""
        return self.report.beyond(0, f"a {what} record does not parse")

    def learn(self) -> Iterator[Item]:
        """Take the definitions that stand anywhere in the file, once, where those that should come first are lost."""
        if self.search_file is None:
            return
        search_file, self.search_file = self.search_file, None
        found = search_file()
        self.schemas = found.schemas | self.schemas
        for number, channel in found.channels.items():
            if number not in self.channels.by_number and (added := self.channels.add(number, channel)):
                yield added
