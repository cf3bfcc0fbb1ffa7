"""rosbag2's SQLite files (.db3), read without leaving a trace beside them.

The file is opened immutable, so that SQLite creates no -wal or -shm. Where such a file stands beside it with content,
database and journal are copied to a temporary folder and read there. Where pages are damaged, reading goes on behind
them. Source: rosbag2_storage_sqlite3; SQLite database file format, https://sqlite.org/fileformat2.html.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import sqlite3
import struct
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import EVERYTHING, Channel, FileFacts, Item, RawMessage, Recorded, Wish
from mclcli.io.logs.channels import WatchedChannels
from mclcli.io.logs.inflate import CHUNK_LIMIT
from mclcli.io.logs.mcap_records import is_latched, ros2_name
from mclcli.io.logs.report import Report

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from mclcli.io.logs.base import Damage
    from mclcli.io.logs.source import Origin

_ROWS = 256  # messages fetched at a time
_HOLES = 200  # damaged places that are walked around before giving up
_FILLER = bytes.fromhex("9f3a00c1e75bd204868dfe11a97c3360")  # what missing pages are filled with
_FILLED = 1 << 26  # bytes of missing pages filled so; no message reaches farther
_SPARSE = 2  # ids of which more than half is missing count nothing
_COUNT = re.compile(r"^( *)message_count: ([1-9]\d{0,17})\s*$", re.MULTILINE)
_IDS = "ids count"
_FARTHEST = 1 << 62  # ids above this are not looked for

_BROKEN = (sqlite3.Error, ValueError)  # an error's own text may be bytes that are no text


def open_db3(source: str, start: Origin) -> Db3File:
    """Container for a file; SQLite opens it itself."""
    assert start.path is not None  # noqa: S101 - it is not read from pipes
    return Db3File(source, start.path, start.counted)


@final
@dataclass(frozen=True, slots=True)
class Db3File:
    """A rosbag2 SQLite file, messages in the order of their ids (as they were written).

    ``counted`` messages stand in it, says what describes its folder, if anything does.
    """

    source: str
    path: Path
    counted: int | None = None

    def items(self, wish: Wish = EVERYTHING) -> Iterator[Item]:
        """Channels, messages and damage in file order (see ``Container``)."""
        report = Report(self.source)
        missing = missing_bytes(self.path)
        if missing:  # the rest is read from a copy, filled up to its declared length
            what = f"file ends {missing} bytes before its last page; it was cut off"
            yield report.lost(self.path.stat().st_size, what)
        with _readable(self.path, missing) as (path, immutable):
            uri = f"{path.absolute().as_uri()}?{'immutable=1&' if immutable else ''}mode={'ro' if immutable else 'rw'}"
            with contextlib.closing(sqlite3.connect(uri, uri=True)) as database:
                yield from _Pass(database, WatchedChannels(wish), report, self.counted).run()
        yield FileFacts(self.source, "rosbag2 database", not missing and not journals(self.path), "no")


@final
@dataclass(slots=True)
class _Pass:
    """One pass over an open database."""

    database: sqlite3.Connection
    channels: WatchedChannels
    report: Report
    counted: int | None
    last_id: int = -_FARTHEST  # last message read
    last_ns: int | None = None
    first_id: int | None = None
    rows_read: int = 0
    odd: int = 0  # rows whose columns have the wrong types

    def run(self) -> Iterator[Item]:
        """Yield everything."""
        self.database.text_factory = lambda raw: raw.decode("utf-8", "replace")
        try:
            self.harden()
            self.check_tables()
            yield from self.recorded_channels()
        except _BROKEN as error:
            yield self.report.lost(0, f"cannot be read as a rosbag2 database ({error})", self.described())
            return
        yield from self.messages()
        yield from self.channels.report()
        if self.odd:
            yield self.report.lost(0, "rows without a topic, a time or data", self.odd)
        declared, by = yield from self.declared()
        yield from self.report.totals(0, self.rows_read - self.odd, declared, by, least=by == _IDS)

    def declared(self) -> Generator[Damage, None, tuple[int, str]]:
        """Messages that there should be, and what says so: the index over times, a description, or else the ids.

        Rows that were deleted are in no index. So only where something is damaged is the greater number believed.
        """
        indexed, described = None, self.described()
        try:
            indexed = self.indexed()
        except _BROKEN:
            yield self.report.lost(0, "the index over times is damaged")
        if indexed is not None and (described is None or indexed >= described or not self.report.hurt):
            return indexed, "file counts"
        if described is not None:
            return described, "file is described with"
        span = 0 if self.first_id is None else self.last_id - self.first_id + 1
        return (span if span <= _SPARSE * self.rows_read else self.rows_read), _IDS

    def described(self) -> int | None:
        """Messages that the file's own description counts (since Iron), or that of its folder."""
        with contextlib.suppress(TypeError, *_BROKEN):
            if self.is_plain("metadata"):
                query = "SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1"
                found = _COUNT.findall(str(self.database.execute(query).fetchone()[0]))
                if found:
                    return int(min(found)[1])  # the least indented one, not that of a topic
        return self.counted

    def indexed(self) -> int | None:
        """Messages that the index over their times counts, None where there is no such index; sqlite3.DatabaseError."""
        if not self.database.execute("SELECT 1 FROM sqlite_master WHERE name = 'timestamp_idx'").fetchone():
            return None
        query = "SELECT count(*) FROM messages INDEXED BY timestamp_idx"
        return int(self.database.execute(query).fetchone()[0])

    def harden(self) -> None:
        """Take the database for hostile: no functions from its schema, no blob larger than a chunk may be."""
        self.database.execute("PRAGMA trusted_schema=OFF")
        self.database.execute("PRAGMA cell_size_check=ON")
        self.database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, CHUNK_LIMIT)

    def check_tables(self) -> None:
        """Only plain tables are read: a view could compute for ever, a computed column fill any memory."""
        for table in ("topics", "messages"):
            if not self.is_plain(table):
                raise ValueError(f"it has no plain table {table}")

    def is_plain(self, table: str) -> bool:
        """Whether there is a table of this name, neither virtual nor with columns that are computed."""
        query = "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?"
        found = self.database.execute(query, (table,)).fetchone()
        if found is None or "VIRTUAL" in str(found[0])[:20].upper():
            return False
        return not any(column[-1] for column in self.database.execute(f"PRAGMA table_xinfo({table})"))

    def recorded_channels(self) -> Iterator[Channel]:
        """Topics with their types, and definitions where the file has them (since Iron)."""
        definitions: dict[str, tuple[str, str]] = {}
        if self.is_plain("message_definitions"):  # older files have no such table
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            definitions = {kind: (str(form), str(text)) for kind, form, text in self.database.execute(query)}
        for row in self.database.execute("SELECT * FROM topics"):
            number, name, kind, encoding, *rest = row
            if isinstance(number, int) and all(isinstance(text, str) for text in row[1:4]):
                qos = str(rest[0]) if rest else ""
                form, text = definitions.get(kind, ("", ""))
                recorded = Recorded(kind, form, text.encode(), (("offered_qos_profiles", qos),) if qos else ())
                channel = Channel(name, ros2_name(kind), encoding, text, "", is_latched(qos), recorded)
                if self.channels.add(number, channel):
                    yield channel

    def messages(self) -> Iterator[Item]:
        """All messages; damaged pages are walked around."""
        for _ in range(_HOLES):
            try:
                yield from self.rows()
            except _BROKEN:
                first, before = self.last_id + 1, self.last_ns
                found = self.next_readable(first)
                yield self.report.lost(0, "pages of the database are damaged", None, before, found and found[1])
                if found is None:
                    return
                self.last_id = found[0] - 1
            else:
                return
        yield self.report.lost(0, f"more than {_HOLES} places are damaged; reading stopped")

    def rows(self) -> Iterator[Item]:
        """Messages after the last one read, until the end or the first damage."""
        query = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ? ORDER BY id"
        cursor = self.database.execute(query, (self.last_id,))
        cursor.arraysize = _ROWS
        channels = self.channels.by_number
        for number, topic, stamp, data in cursor:
            if number <= self.last_id:
                raise sqlite3.DatabaseError("a page is its own successor")
            self.last_id = number
            if self.first_id is None:
                self.first_id = number
            self.rows_read += 1
            watched = channels.get(topic)
            if (
                watched is None
                or type(stamp) is not int
                or type(data) is not bytes
                or (self.report.hurt and _FILLER in data)
            ):
                self.odd += 1
                continue
            self.last_ns = stamp
            if watched.wanted:
                yield RawMessage(watched.channel, stamp, data)
            else:
                watched.pass_over(stamp)
                if not self.channels.reported:
                    yield from self.channels.report()

    def next_readable(self, first: int) -> tuple[int, int | None] | None:
        """Id and time of the first message at or after ``first`` that can be read again."""
        bad, step = first, 1
        while (found := self.probe(bad + step)) is None:
            bad, step = bad + step, 2 * step
            if step > _FARTHEST:
                return None
        low, high = bad, bad + step  # probe(low) fails, probe(high) answers
        while high - low > 1:
            middle = (low + high) // 2
            answer = self.probe(middle)
            low, high, found = (middle, high, found) if answer is None else (low, middle, answer)
        return found if found[0] >= first else None

    def probe(self, number: int) -> tuple[int, int | None] | None:
        """Message at or after an id, None where the database is damaged; beyond the last: as if at the end."""
        query = "SELECT id, timestamp, data FROM messages WHERE id >= ? ORDER BY id LIMIT 1"
        try:
            row = self.database.execute(query, (number,)).fetchone()
        except _BROKEN:
            return None
        return (row[0], row[1] if type(row[1]) is int else None) if row else (_FARTHEST, None)


def missing_bytes(path: Path) -> int:
    """Bytes that the database header counts beyond the end of the file; 0 for a whole file."""
    with path.open("rb") as stream:
        header = stream.read(100)
    if len(header) < 100 or journals(path):
        return 0
    changes, pages = struct.unpack_from(">II", header, 24)
    (valid_for,) = struct.unpack_from(">I", header, 92)
    if changes != valid_for:  # the page count was not kept up to date
        return 0
    return int(max(0, _page_size(header) * pages - path.stat().st_size))


def _page_size(header: bytes) -> int:
    (page,) = struct.unpack_from(">H", header, 16)
    return 65536 if page == 1 else int(page)


def journals(path: Path) -> list[Path]:
    """Files with content beside a database that belong to it."""
    candidates = (path.with_name(path.name + suffix) for suffix in ("-wal", "-journal"))
    return [file for file in candidates if file.is_file() and file.stat().st_size > 0]


@contextlib.contextmanager
def _readable(path: Path, missing: int) -> Iterator[tuple[Path, bool]]:
    """Path to read and whether to open it immutable: the file itself, or a copy with its journals or missing pages."""
    beside = journals(path)
    if not beside and not missing:
        yield path, True
        return
    with tempfile.TemporaryDirectory(prefix="mcl-") as folder:
        copy = Path(shutil.copyfile(path, Path(folder) / path.name))
        for file in beside:
            shutil.copyfile(file, copy.with_name(file.name))
        if missing:
            _fill_up(copy, missing)
        yield copy, not beside


def _fill_up(path: Path, missing: int) -> None:
    """Lengthen a cut database to its declared length, so that every message that reached into the cut shows it."""
    with path.open("r+b") as stream:
        page = max(512, _page_size(stream.read(100)))
        size = path.stat().st_size
        if missing > 1000 * size:  # a lie: the file has as many pages as it has
            stream.seek(28)
            stream.write(struct.pack(">I", -(-size // page)))
            return
        start = size - size % page
        stream.seek(start)
        stream.write(_FILLER * (min(size + missing - start, _FILLED) // len(_FILLER)))
        stream.truncate(size + missing)  # zeros behind, as sparse as the file system can
