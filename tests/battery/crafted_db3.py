"""Databases that SQLite takes and a reader should not take at their word."""

from __future__ import annotations

import contextlib
import sqlite3
import struct
from functools import partial
from typing import TYPE_CHECKING

from tests.battery.bases import db3_log, fill_database

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def _edited(script: str, path: Path) -> None:
    with contextlib.closing(sqlite3.connect(path)) as database:
        fill_database(database)
        database.executescript(script)


def _prepared(pragmas: str, path: Path) -> None:
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.executescript(pragmas)
        fill_database(database)


def _with_bytes(at: int, data: bytes, path: Path) -> None:
    raw = bytearray(db3_log())
    raw[at : at + len(data)] = data
    path.write_bytes(raw)


def _leaf_again(path: Path) -> None:
    """Every child of the root of the messages is the same page: rows without end, if one believes it."""
    raw = bytearray(db3_log())
    path.write_bytes(raw)
    with contextlib.closing(sqlite3.connect(path)) as database:
        (root,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    start = (root - 1) * 4096
    (cells,) = struct.unpack_from(">H", raw, start + 3)
    pointers = struct.unpack_from(f">{cells}H", raw, start + 12)
    child = raw[start + pointers[0] : start + pointers[0] + 4]
    for pointer in pointers:
        raw[start + pointer : start + pointer + 4] = child
    path.write_bytes(raw)


_ENDLESS = "WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)"
_BOMB = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB AS (zeroblob(200000000)) VIRTUAL"
_SCRIPTS = {
    "whole": "",
    "messages are an endless view": f"""
        DROP TABLE messages;
        CREATE VIEW messages AS {_ENDLESS} SELECT id, 1 topic_id, 2 timestamp, x'00' data FROM n;""",
    "topics are an endless view": f"""
        DROP TABLE topics;
        CREATE VIEW topics AS {_ENDLESS} SELECT id, 'a' name, 'b' type, 'cdr' form, '' qos FROM n;""",
    "definitions are an endless view": f"""
        DROP TABLE message_definitions;
        CREATE VIEW message_definitions AS
        {_ENDLESS} SELECT id, 'a' topic_type, '' encoding, '' encoded_message_definition FROM n;""",
    "data are computed": f"""
        ALTER TABLE messages RENAME TO old;
        CREATE TABLE messages({_BOMB});
        INSERT INTO messages(topic_id, timestamp)
        {_ENDLESS.replace("FROM n)", "FROM n LIMIT 100000)")} SELECT 1, id FROM n;""",
    "a virtual table": """
        DROP TABLE messages;
        CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data);""",
    "no table topics": "DROP TABLE topics;",
    "no table messages": "DROP TABLE messages;",
    "a missing column": """
        ALTER TABLE messages RENAME TO old;
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, data BLOB);""",
    "a table without rowid": """
        ALTER TABLE messages RENAME TO old;
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB) WITHOUT ROWID;
        INSERT INTO messages SELECT * FROM old;""",
    "columns in another order": """
        ALTER TABLE messages RENAME TO old;
        CREATE TABLE messages(data BLOB, timestamp INTEGER, topic_id INTEGER, id INTEGER PRIMARY KEY);
        INSERT INTO messages SELECT data, timestamp, topic_id, id FROM old;""",
    "an id that is no key": """
        ALTER TABLE messages RENAME TO old;
        CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB);
        INSERT INTO messages SELECT * FROM old;""",
    "ids below zero": "UPDATE messages SET id = id - 10000;",
    "ids at both ends": """
        INSERT INTO messages VALUES (-9223372036854775808, 1, 5, x'00'), (9223372036854775807, 1, 5, x'00');""",
    "rows of NULL": """
        DROP TABLE topics;
        CREATE TABLE topics(id, name, type, form, qos);
        INSERT INTO topics VALUES (NULL, NULL, NULL, NULL, NULL);""",
    "a topic of two ids": """
        INSERT INTO topics SELECT 77, name, type, serialization_format, '', '' FROM topics WHERE id = 4;
        UPDATE messages SET topic_id = 77 WHERE topic_id = 4 AND id % 2;""",
    "stamps as text and as reals": """
        INSERT INTO messages(topic_id, timestamp, data)
        VALUES (1, 'now', x'00'), (1, 1.5, x'00'), (1, 5, 'text'), (1, 5, 7.5);""",
    "stamps at both ends": """
        INSERT INTO messages(topic_id, timestamp, data)
        VALUES (5, -9223372036854775808, x'00'), (5, 9223372036854775807, x'00');""",
    "an index that lacks rows": """
        DROP INDEX timestamp_idx;
        CREATE INDEX timestamp_idx ON messages(timestamp) WHERE id < 100;""",
    "an index over an expression": """
        DROP INDEX timestamp_idx;
        CREATE INDEX timestamp_idx ON messages(abs(timestamp));""",
    "a trigger": "CREATE TRIGGER t AFTER INSERT ON messages BEGIN DELETE FROM messages; END;",
}
_PRAGMAS = {
    "pages of 512 bytes": "PRAGMA page_size=512;",
    "pages of 65,536 bytes": "PRAGMA page_size=65536;",
    "UTF-16": "PRAGMA encoding='UTF-16le';",
    "a vacuum of its own": "PRAGMA auto_vacuum=FULL;",
    "left in WAL mode": "PRAGMA journal_mode=WAL;",
}
_BYTES = {
    "a page size of 0": (16, b"\0\0"),
    "a page size of 3": (16, b"\0\3"),
    "2^32 − 1 pages": (28, b"\xff" * 4),
    "a schema format of 99": (44, b"\0\0\0\x63"),
}
_EMPTY = (*list(_SCRIPTS)[1:3], *list(_SCRIPTS)[4:9], "rows of NULL", *(name for name in _BYTES if "pages" not in name))

CHANGES: list[tuple[str, Callable[[Path], None], int]] = [
    *((name, partial(_edited, script), 0 if name in _EMPTY else 313) for name, script in _SCRIPTS.items()),
    *((name, partial(_prepared, pragmas), 313) for name, pragmas in _PRAGMAS.items()),
    *((name, partial(_with_bytes, at, data), 0 if name in _EMPTY else 313) for name, (at, data) in _BYTES.items()),
    ("one leaf again and again", _leaf_again, 0),
]
"""(name, what makes the database, messages of the drive that must come out)"""
