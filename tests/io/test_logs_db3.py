from __future__ import annotations

import contextlib
import shutil
import sqlite3
from typing import TYPE_CHECKING

from mclcli.io.logs.db3_file import Db3File
from tests.data import shared
from tests.io.logs import Seen, look, look_at, numbers, payload, seeded

if TYPE_CHECKING:
    from pathlib import Path

OLIN = "olin/macfirst_floor_take_2/macfirst_floor_take_2_0.db3"


def read(path: Path) -> Seen:
    return look(Db3File(path.name, path))


def make(path: Path, count: int, *, mode: str = "delete") -> sqlite3.Connection:
    """Database as rosbag2 lays it out, left open."""
    database = sqlite3.connect(path)
    database.execute(f"PRAGMA journal_mode={mode}")
    database.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
        " data BLOB NOT NULL);"
        "INSERT INTO topics VALUES (1, '/a', 'std_msgs/msg/String', 'cdr', '- durability: 1');"
    )
    add(database, 0, count)
    return database


def add(database: sqlite3.Connection, start: int, stop: int) -> None:
    rows = [(1, 10**9 + k, payload(k)) for k in range(start, stop)]
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.commit()


def test_a_healthy_database_gives_every_message_and_leaves_no_files(tmp_path: Path) -> None:
    make(tmp_path / "x.db3", 500, mode="wal").close()
    seen = read(tmp_path / "x.db3")
    assert numbers(seen) == list(range(500))
    assert seen.messages[0].channel.latched
    assert seen.damages == []
    assert [path.name for path in tmp_path.iterdir()] == ["x.db3"]


def test_messages_in_a_write_ahead_log_are_read(tmp_path: Path) -> None:
    with contextlib.closing(make(tmp_path / "open.db3", 500, mode="wal")) as database:
        database.execute("PRAGMA wal_autocheckpoint=0")
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        add(database, 500, 550)
        for name in ("open.db3", "open.db3-wal"):
            shutil.copyfile(tmp_path / name, tmp_path / name.replace("open", "copy"))
    before = sorted((path.name, path.read_bytes()) for path in tmp_path.glob("copy*"))
    assert numbers(read(tmp_path / "copy.db3")) == list(range(550))
    assert sorted((path.name, path.read_bytes()) for path in tmp_path.glob("copy*")) == before


def test_a_cut_database_reads_almost_up_to_the_cut_and_alters_nothing(tmp_path: Path) -> None:
    make(tmp_path / "x.db3", 3000).close()
    data = (tmp_path / "x.db3").read_bytes()
    for share in (0.2, 0.5, 0.77, 0.99):
        (tmp_path / "cut.db3").write_bytes(data[: int(len(data) * share)])
        seen = read(tmp_path / "cut.db3")
        found = numbers(seen)
        assert found == list(range(len(found)))
        assert len(found) > 3000 * (share - 0.05)
        assert "cut off" in seen.damages[0].what


def test_a_real_database_cut_in_the_middle_of_long_messages(tmp_path: Path) -> None:
    path = shared(OLIN)
    healthy = set(read(path).stamped)
    data = path.read_bytes()
    rng = seeded(12)
    for _ in range(12):
        cut = rng.randrange(len(data) // 5, len(data))
        (tmp_path / "cut.db3").write_bytes(data[:cut])
        stamped = read(tmp_path / "cut.db3").stamped
        assert set(stamped) <= healthy, f"a message was altered by the cut at byte {cut}"
        assert len(stamped) >= 2425 * (cut / len(data) - 0.03)


def test_reading_goes_on_behind_damaged_pages(tmp_path: Path) -> None:
    make(tmp_path / "x.db3", 3000).close()
    data = bytearray((tmp_path / "x.db3").read_bytes())
    for page in (30, 31, 90):
        data[page * 4096 : page * 4096 + 4096] = seeded(page).randbytes(4096)
    (tmp_path / "x.db3").write_bytes(data)
    seen = read(tmp_path / "x.db3")
    found = numbers(seen)
    assert found[-1] == 2999
    assert 2900 < len(found) < 3000
    *holes, last = seen.damages
    assert all("damaged" in damage.what for damage in holes)
    assert last.messages == 3000 - len(found)
    assert len(seen.damages) >= 2


def test_views_and_foreign_databases_are_refused(tmp_path: Path) -> None:
    with contextlib.closing(sqlite3.connect(tmp_path / "x.db3")) as database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER); CREATE VIEW messages AS WITH RECURSIVE n(id) AS"
            " (SELECT 1 UNION ALL SELECT id + 1 FROM n) SELECT id, 1 topic_id, 2 timestamp, x'00' data FROM n;"
        )
    (damage,) = read(tmp_path / "x.db3").damages
    assert "no plain table messages" in damage.what


def test_rows_of_wrong_types_are_counted(tmp_path: Path) -> None:
    with contextlib.closing(make(tmp_path / "x.db3", 5)) as database:
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (9, 1, x'00'), (1, 'now', x'00')")
        database.commit()
    seen = read(tmp_path / "x.db3")
    assert len(seen.messages) == 5
    assert [damage.messages for damage in seen.damages] == [2]


def test_messages_are_compared_with_their_index(tmp_path: Path) -> None:
    with contextlib.closing(make(tmp_path / "x.db3", 300)) as database:
        database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        (root,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    data = bytearray((tmp_path / "x.db3").read_bytes())
    data[(root - 1) * 4096 + 3 : (root - 1) * 4096 + 5] = bytes([0, 5])  # only 5 cells in the root of the table
    (tmp_path / "x.db3").write_bytes(data)
    seen = read(tmp_path / "x.db3")
    assert len(seen.messages) < 300
    assert any(damage.messages == 300 - len(seen.messages) for damage in seen.damages)


def test_a_database_damaged_anywhere_never_raises(tmp_path: Path) -> None:
    make(tmp_path / "x.db3", 300).close()
    data = (tmp_path / "x.db3").read_bytes()
    rng = seeded(13)
    for _ in range(60):
        hurt = bytearray(data)
        at, length = rng.randrange(20, len(data)), rng.randrange(1, 5000)
        hurt[at : at + length] = rng.randbytes(len(hurt[at : at + length]))
        (tmp_path / "hurt.db3").write_bytes(hurt)
        seen = read(tmp_path / "hurt.db3")
        assert len(seen.messages) <= 310


def cut_root(path: Path) -> None:
    """Leave five cells only in the root page of the table: most rows are lost, and nothing looks broken."""
    with contextlib.closing(sqlite3.connect(path)) as database:
        (root,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    data = bytearray(path.read_bytes())
    data[(root - 1) * 4096 + 3 : (root - 1) * 4096 + 5] = bytes([0, 5])
    path.write_bytes(data)


def test_messages_are_compared_with_what_describes_the_file(tmp_path: Path) -> None:
    with contextlib.closing(make(tmp_path / "x.db3", 300)) as database:
        database.execute("CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER, metadata TEXT)")
        text = "message_count: 300\ntopics:\n- message_count: 17\nfiles:\n- path: a\n  message_count: 1\n"
        database.execute("INSERT INTO metadata VALUES (1, 9, ?)", (text,))
        database.commit()
    assert read(tmp_path / "x.db3").damages == []
    cut_root(tmp_path / "x.db3")
    seen = read(tmp_path / "x.db3")
    assert [damage.messages for damage in seen.damages] == [300 - len(seen.messages)]


def test_messages_are_compared_with_the_metadata_of_the_folder(tmp_path: Path) -> None:
    for name in ("x_0.db3", "x_1.db3"):
        make(tmp_path / name, 300).close()
    entries = "".join(f"    - path: x_{n}.db3\n      message_count: 300\n" for n in range(2))
    listed = "  relative_file_paths:\n    - x_0.db3\n    - x_1.db3\n"
    text = f"rosbag2_bagfile_information:\n  message_count: 600\n  files:\n{entries}{listed}"
    (tmp_path / "metadata.yaml").write_text(text)
    assert look_at(tmp_path).damages == []
    cut_root(tmp_path / "x_1.db3")
    seen = look_at(tmp_path)
    assert [(d.source, d.messages) for d in seen.damages] == [("x_1.db3", 600 - len(seen.messages))]


def test_rows_that_are_missing_show_in_the_ids_where_nothing_else_counts_them(tmp_path: Path) -> None:
    with contextlib.closing(make(tmp_path / "x.db3", 300)) as database:
        database.execute("DELETE FROM messages WHERE id BETWEEN 100 AND 119")
        database.commit()
        assert [damage.messages for damage in read(tmp_path / "x.db3").damages] == [20]
        database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        database.commit()
    assert read(tmp_path / "x.db3").damages == [], "rows that somebody deleted are in no index"
