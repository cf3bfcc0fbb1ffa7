"""Containers and messages as targets."""

from __future__ import annotations

import contextlib
import io
import struct
from typing import TYPE_CHECKING, Any

import zstandard

from mclcli.errors import InputError, UsageError
from mclcli.io.logs import open_log
from mclcli.io.logs.base import Channel, RawMessage, Tally
from mclcli.io.messages.decoding import DECODABLE, Undecodable, decode
from mclcli.io.messages.definition_parsing import parse_definition
from mclcli.io.messages.definitions import begins_with_header, definition_of
from mclcli.io.messages.parsing import NOT_PARSED, parser_for, to_plain
from tests.fuzz import small_logs
from tests.fuzz.engine import Target
from tests.io import ros_messages
from tests.io.definition_samples import idl_of, write
from tests.io.ros_messages import TEXTS, TF

if TYPE_CHECKING:
    from pathlib import Path

KINDS = tuple((kind, encoding) for kind in sorted(DECODABLE) for encoding in ("cdr", "ros1"))
REFUSED = (InputError, UsageError)
RECORDS = tuple(bytes([kind]) + struct.pack("<Q", length) for kind in range(1, 16) for length in (0, 4, 20, 25))
FIELDS = tuple(struct.pack("<I", len(field)) + field for field in (b"op=\2", b"op=\4", b"op=\5", b"op=\6", b"op=\7"))
DEFINITION = (b"float32 ", b"string ", b"std_msgs/Header header\n", b"[]", b"[3]", b"[<=5] ", b"=" * 80, b"\nMSG: ")
IDL = (
    b"module a { module msg {",
    b"struct B { ",
    b"sequence<a::msg::B, 3> ",
    b"typedef double ",
    b"};",
    b"\nIDL: ",
    b"@optional",
)


def targets(folder: Path) -> list[Target]:
    """All of them; files are written in a folder."""
    mcaps, bags, databases = small_logs.mcaps(), small_logs.bags(), small_logs.databases()
    packed = [zstandard.compress(data) for data in (mcaps[0], bags[0])]
    return [
        Target("mcap", lambda data: _file(folder / "x.mcap", data), REFUSED, mcaps, RECORDS, limit=4096),
        Target("mcap stream", _stream, REFUSED, mcaps, RECORDS, limit=4096),
        Target("bag", lambda data: _file(folder / "x.bag", data), REFUSED, bags, FIELDS, limit=6000),
        Target("bag stream", _stream, REFUSED, bags, FIELDS, limit=6000),
        Target("db3", lambda data: _file(folder / "x.db3", data), REFUSED, databases, limit=8192),
        Target("zstd file", lambda data: _file(folder / "x.zstd", data), REFUSED, packed, limit=2048),
        Target("message", message, REFUSED, _messages(), limit=600),
        Target("definition", definition, (), _definitions(), DEFINITION + IDL, limit=3000),
    ]


def _file(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    _read(open_log([path]))


def _stream(data: bytes) -> None:
    _read(open_log(["-"], stdin=io.BytesIO(data)))


def _read(log: Any) -> None:
    tally = Tally()
    count = sum(1 for _ in log.messages(None, tally, announce=False))
    if count != sum(tally.read.values()):
        raise AssertionError(f"{count} messages came out, {tally.read} were counted")
    for damage in tally.damages:
        damage.describe(None)


def message(data: bytes) -> None:
    """A message of the type that the first byte tells: what rosbags parses must convert."""
    if not data:
        return
    kind, encoding = KINDS[data[0] % len(KINDS)]
    raw = RawMessage(CHANNELS[kind, encoding], 5, data[1:])
    parse, parsed = parser_for(raw.channel), False
    if not isinstance(parse, Undecodable):
        with contextlib.suppress(Exception):  # rosbags' own errors; decode() makes the best of them
            parsed = not isinstance(parse(raw.data), Undecodable)
    result = decode(raw)
    if parsed and isinstance(result, Undecodable) and result.reason == NOT_PARSED:
        raise AssertionError(f"{kind} in {encoding} parses, and does not convert")
    to_plain(raw)


CHANNELS = {(kind, encoding): Channel("/t", kind, encoding) for kind, encoding in KINDS}


def definition(data: bytes) -> None:
    """A recorded definition of the type that the first byte tells."""
    if not data:
        return
    kind, encoding = KINDS[data[0] % len(KINDS)]
    text = data[1:].decode("utf-8", "replace")
    parse_definition(kind, text)
    channel = Channel("/t", kind, encoding, text)
    begins_with_header(channel)
    definition_of(channel)
    for start in (b"\0\1\0\0", b"\0\7\0\0", b"\0\x09\0\0", b""):
        decode(RawMessage(channel, 0, start + text[:64].encode() + bytes(400)))


def _messages() -> list[bytes]:
    """A message of each type in each encoding, all zeros where nothing better is at hand."""
    values = {"sensor_msgs/msg/LaserScan": ros_messages.SCAN, "nav_msgs/msg/Odometry": ros_messages.ODOMETRY}
    made = []
    for number, (kind, encoding) in enumerate(KINDS):
        data = bytes(200)
        if kind in values or kind in TF:
            given = values.get(kind, {"transforms": [ros_messages.edge()]})
            with contextlib.suppress(KeyError):  # types that one encoding alone has
                data = ros_messages.raw(encoding, kind, given).data
        made.append(bytes([number]) + data)
        if kind in values and encoding == "cdr":
            types = ros_messages.STORES["cdr"].fielddefs
            made += [bytes([number]) + write(types, kind, values[kind], form) for form in (7, 9)]
    return made


def _definitions() -> list[bytes]:
    """The definition of each type as mcl knows it."""
    texts = {number: definition_of(CHANNELS[kind]) for number, kind in enumerate(KINDS)}
    made = [bytes([number]) + text.encode() for number, text in texts.items() if text]
    own = (b"\0" + text.encode() for text in TEXTS.values())
    by_idl = (
        bytes([number]) + idl_of(ros_messages.STORES["cdr"].fielddefs, kind).encode()
        for number, (kind, encoding) in enumerate(KINDS)
        if encoding == "cdr" and kind in ros_messages.SAMPLES
    )
    return [*made, *own, *by_idl]
