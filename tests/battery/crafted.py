"""Crafted logs: made to break a reader, with the whole drive in them as well."""

from __future__ import annotations

import struct
from functools import partial
from typing import TYPE_CHECKING

import zstandard

from tests.battery import content, crafted_db3
from tests.battery import records as r
from tests.battery.damaged import read_all
from tests.battery.harness import LOSS, WRONG, Case, Verdict
from tests.battery.outcome import unclean
from tests.cli.support import mcl
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from random import Random

HUGE = 2**63 - 1
AGAIN = "sensor_msgs/LaserScan again\n"
TWIN = "std_msgs/Header header\nfloat32 angle_min\n"
SCAN, STRING, TF = "sensor_msgs/msg/LaserScan", "std_msgs/msg/String", "tf2_msgs/msg/TFMessage"
AT = content.START_NS + 5 * 10**9


def cases(seed: int, share: float) -> list[Case]:
    """All crafted logs, the odd records somewhere among the others; or a ``share`` of them."""
    rng = seeded(f"{seed} crafted")
    made = [
        *(Case(f"mcap: {name}", partial(check, "x.mcap", data, least)) for name, data, least in _mcaps(rng)),
        *(Case(f"bag: {name}", partial(check, "x.bag", data, least)) for name, data, least in _bags(rng)),
        *(Case(f"message: {name}", partial(check, "x.mcap", data, 313)) for name, data in _contents(rng)),
        *(
            Case(f"db3: {name}", partial(check_database, name, change, least))
            for name, change, least in crafted_db3.CHANGES
        ),
    ]
    return made if share == 1.0 else rng.sample(made, max(4, round(share * len(made))))


def check_database(name: str, change: Callable[[Path], None], least: int, folder: Path) -> Verdict:
    """A database after an edit by SQLite itself."""
    del name
    change(folder / "x.db3")
    return _judged(folder, folder / "x.db3", least)


def check(name: str, data: bytes, least: int, folder: Path) -> Verdict:
    """Read, describe, run and recover one crafted log, which holds at ``least`` so many messages of the drive."""
    (folder / name).write_bytes(data)
    return _judged(folder, folder / name, least)


def _judged(folder: Path, path: Path, least: int) -> Verdict:
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    info = mcl("info", path)
    problems = unclean(info)
    words = ("run", path, "--map", folder / "room.yaml", "--init", content.INIT, "--particles", 50, "--track", "-")
    ran, recovered = mcl(*words), mcl("recover", path, "-o", folder / "good.mcap")
    problems += unclean(ran) + unclean(recovered)
    if least == 0:
        return Verdict(problems, {})
    if info.code == 1:
        return Verdict([*problems, (LOSS, f"refused: {info.err}")], {})
    found, tally = read_all(path)
    kept = len(
        {(t, d) for t, _, d in found} & {(m.topic, m.data) for e in ("cdr", "ros1") for m in content.messages(e)}
    )
    if kept < least:
        problems.append((LOSS if not tally.lossy else WRONG, f"{kept} of {least} messages of the drive"))
    if least == 313 and ran.code not in {0, 3}:
        problems.append((WRONG, f"run ended with {ran.code}: {ran.err[-300:]}"))
    return Verdict(problems, {"messages of the drive": least, "read": kept})


def _mcaps(rng: Random) -> Iterator[tuple[str, bytes, int]]:
    """(name, file, messages of the drive that must come out): records that lie."""
    beside = partial(r.beside, rng)
    drive, text = r.drive(), b"\0\1\0\0\5\0\0\0abcd\0"
    own = r.schema(9, STRING, "ros2msg", "string data\n") + r.channel(9, 9, "/own")
    for kind in range(16):
        for length in (0, 3):
            yield (
                f"kind {kind} of {length} bytes",
                beside(r.record(kind, bytes(length))),
                313 if kind not in {2, 15} else 0,
            )
    for kind in (3, 4, 5, 6, 7, 9, 128):
        yield f"kind {kind} said to have 2^63 − 1 bytes", beside(r.record(kind, b"abc", HUGE)), 313
    yield "all of it twice", r.mcap(drive, drive), 313
    yield "two files in one", r.mcap(drive) * 2, 313
    yield "end in the middle", r.mcap(r.record(r.DATA_END, bytes(4)), drive), 313
    yield "unclosed", beside(end=False), 313
    yield "a chunk in a chunk", beside(r.chunk(r.chunk(own + r.message(9, AT, text)))), 313
    yield "a chunk said to be empty", beside(r.chunk(own, size=0)), 313
    yield "a chunk of nothing", beside(r.chunk(b"")), 313
    yield "a chunk said to hold 2^40 bytes", beside(r.chunk(own, size=2**40)), 313
    yield "a chunk with too short a length", beside(r.chunk(own, length=3)), 313
    yield "a chunk compressed by an unknown method", beside(r.chunk(own, "snappy")), 313
    yield "a chunk said to be zstd", beside(r.chunk(own, "zstd")), 313
    yield "a chunk said to be lz4", beside(r.chunk(own, "lz4")), 313
    yield (
        "a chunk in two zstd frames",
        r.mcap(r.chunk(drive, "zstd", zstandard.compress(drive[:9999]) + zstandard.compress(drive[9999:]))),
        313,
    )
    yield (
        "a chunk with more behind its zstd frame",
        beside(r.chunk(own, "zstd", zstandard.compress(own) + b"more")),
        313,
    )
    yield "a message of an unknown channel", beside(r.message(77, AT, text)), 313
    yield "a message shorter than its head", beside(r.record(5, b"\1\0\0")), 313
    yield "a channel of an unknown schema", beside(r.channel(9, 99, "/own"), r.message(9, AT, text)), 313
    yield (
        "a channel that changes its topic",
        beside(own, r.message(9, AT, text), r.channel(9, 9, "/new"), r.message(9, AT, text)),
        313,
    )
    yield (
        "a channel that takes over another's number",
        beside(r.channel(4, 5, "/scan"), r.message(4, AT, text)),
        313,
    )
    yield (
        "a channel with endless metadata",
        beside(r.record(4, struct.pack("<HH", 9, 9) + r.text("/own") + r.text("cdr") + struct.pack("<I", 2**32 - 1))),
        313,
    )
    yield "a schema with a string beyond its end", beside(r.record(3, struct.pack("<HI", 9, 2**32 - 1))), 313
    yield (
        "names that are not UTF-8",
        beside(r.schema(9, b"\xff\xfe", "ros2msg", b"\xff"), r.channel(9, 9, b"\xc3\x28"), r.message(9, AT, text)),
        313,
    )
    yield "a topic without a name", beside(own.replace(r.text("/own"), r.text("")), r.message(9, AT, text)), 313
    yield "an encoding nobody knows", beside(r.channel(9, 1, "/own", "protobuf"), r.message(9, AT, text)), 313
    yield "no encoding", beside(r.channel(9, 1, "/own", ""), r.message(9, AT, text)), 313
    yield (
        "times at the ends of time",
        beside(own, *(r.message(9, at, text) for at in (0, 1, 2**63 - 1, 2**63, 2**64 - 1))),
        313,
    )
    yield (
        "65,535 channels",
        beside(
            r.schema(9, STRING, "ros2msg", "string data\n"),
            *(r.channel(n, 9, f"/t{n}") for n in range(6, 65535)),
        ),
        313,
    )
    yield "another profile", r.mcap(drive, profile="ros1"), 313
    yield "no profile", r.mcap(drive, profile=""), 313
    yield "nothing but the head", r.mcap(), 0
    yield "nothing but the magic", r.MAGIC, 0


def _bags(rng: Random) -> Iterator[tuple[str, bytes, int]]:
    """The same of ROS 1 bags."""
    beside = partial(r.bag_beside, rng)
    drive, own = (
        r.bag_drive(),
        r.connection(9, "/own", "std_msgs/String", "string data\n", "992ce8a1687cec8c8bd883ec73ca41d1"),
    )
    conn, time, one = struct.pack("<I", 9), bytes(8), struct.pack("<I", 1)
    yield "whole", r.bag(drive), 313
    yield "all of it twice", r.bag(drive, drive), 313
    yield "a header of 2^32 − 1 bytes", beside(b"\xff" * 4 + b"abc"), 313
    yield "a field longer than its header", beside(struct.pack("<II", 8, 99) + b"op=\2" + bytes(4)), 313
    yield "a header without op", beside(r.bag_record(b"", conn=conn)), 313
    yield "an op nobody knows", beside(r.bag_record(b"", op=b"\x63")), 313
    yield "data of 2^32 − 1 bytes", beside(r.bag_record(b"abc", 2**32 - 1, op=b"\2", conn=conn, time=time)), 313
    yield "a message without conn", beside(r.bag_record(b"abcd", op=b"\2", time=time)), 313
    yield "a message without time", beside(own, r.bag_record(b"\1\0\0\0a", op=b"\2", conn=conn)), 313
    yield "a message of an unknown connection", beside(r.bag_message(77, AT, b"")), 313
    yield "a conn of 9 bytes", beside(r.bag_record(b"", op=b"\2", conn=b"\xff" * 9, time=time)), 313
    yield "a connection without topic", beside(r.bag_record(b"", op=b"\7", conn=conn)), 313
    yield "a connection without type", beside(r.bag_record(b"", op=b"\7", conn=conn, topic=b"/own")), 313
    yield (
        "a digest that is not the definition's",
        beside(r.connection(9, "/scan2", "sensor_msgs/LaserScan", TWIN, "0" * 32), r.bag_message(9, AT, b"abcd")),
        313,
    )
    yield (
        "index data said to have 2^32 − 1 entries",
        beside(r.bag_record(b"", op=b"\4", ver=one, conn=conn, count=b"\xff" * 4)),
        313,
    )
    yield (
        "index data with a count of 8 bytes",
        beside(r.bag_record(b"", op=b"\4", ver=one, conn=conn, count=b"\xff" * 8)),
        313,
    )
    for method in ("none", "bz2", "lz4", "zip", ""):
        body = r.bag_record(own, op=b"\5", compression=method.encode(), size=struct.pack("<I", len(own)))
        yield f"a chunk said to be {method or 'nothing'}", beside(body), 313
        yield (
            f"a chunk said to be {method or 'nothing'} of 2^32 − 1 bytes",
            beside(body.replace(struct.pack("<I", len(own)), b"\xff" * 4, 1)),
            0,
        )


def _contents(rng: Random) -> Iterator[tuple[str, bytes]]:
    """Messages and definitions that lie, on topics beside the drive's."""
    head = b"\0\1\0\0"
    header = struct.pack("<iI", 5, 0) + r.text(b"laser\0") + b"\0\0"
    scan = header + struct.pack("<7f", -1, 1, 0.1, 0, 0, 0.1, 10)

    def with_message(kind: str, data: bytes, definition: str | None = None, topic: str = "/other") -> bytes:
        known = content.definition("cdr", kind)[0] if definition is None else definition
        return r.beside(rng, r.schema(9, kind, "ros2msg", known), r.channel(9, 9, topic), r.message(9, AT, data))

    for name, data in {
        "nothing": b"",
        "one byte": b"\0",
        "the head alone": head,
        "ranges of 2^32 − 1": head + scan + b"\xff" * 4,
        "ranges of 2^30": head + scan + struct.pack("<I", 2**30),
        "ranges and bytes left over": head + scan + struct.pack("<If", 1, 1.0) + bytes(40),
        "parameter list": b"\0\3\0\0" + scan,
        "big-endian head": b"\0\0\0\0" + scan,
        "XCDR2": b"\0\7\0\0" + scan,
        "a frame of 2^32 − 1 bytes": head + struct.pack("<iI", 5, 0) + b"\xff" * 4,
        "a frame without its zero": head + struct.pack("<iI", 5, 0) + r.text(b"abc"),
        "a frame of no bytes": head + struct.pack("<iII", 5, 0, 0) + bytes(100),
        "a frame that is not UTF-8": head + struct.pack("<iI", 5, 0) + r.text(b"\xff\xfe\0\0") + bytes(100),
    }.items():
        yield f"scan with {name}", with_message(SCAN, data)
    yield "transforms without end", with_message(TF, head + b"\xff" * 4, topic="/tf_other")
    yield "a transform of a frame to itself", with_message(TF, _transform("base_link", "base_link"), topic="/tf")
    yield "transforms in a circle", with_message(TF, _transform("laser", "base_link"), topic="/tf_static")
    for name, text in {
        "other fields": TWIN,
        "no sense": "((((",
        "code": "float32 x\n__import__('os').system('false')\n",
        "a megabyte": "float32 abcdefgh\n" * 70_000,
        "three megabytes in one line": "float32 " + "a" * 3_000_000,
        "a type within itself": f"{AGAIN}{'=' * 80}\nMSG: sensor_msgs/LaserScan\n{AGAIN}",
        "ten thousand types": "".join(f"{'=' * 80}\nMSG: a/T{n}\na/T{n + 1} x\n" for n in range(10_000)),
    }.items():
        yield f"definition of {name}", with_message(SCAN, head + scan + struct.pack("<II", 0, 0), text)


def _transform(parent: str, child: str) -> bytes:
    data = b"\0\1\0\0" + struct.pack("<IiI", 1, content.START_NS // 10**9 + 5, 0) + r.text(parent.encode() + b"\0")
    data += bytes(-(len(data)) % 4) + r.text(child.encode() + b"\0")
    data += bytes((4 - len(data)) % 8)
    return data + struct.pack("<7d", 1, 2, 0, 0, 0, 0, 1)
