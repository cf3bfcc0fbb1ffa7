from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.logs.base import Channel, RawMessage, Tally
from mclcli.io.messages.decoding import Undecodable, decode
from mclcli.io.messages.definition_parsing import parse_definition
from mclcli.records import LandmarkSightings, LaserScan
from tests.io.logs import seeded
from tests.io.ros_messages import BEARINGS, SAMPLES, SCAN, STORES, build, raw

if TYPE_CHECKING:
    from collections.abc import Callable

BOTH = pytest.mark.parametrize("encoding", ["cdr", "ros1"])


@BOTH
@pytest.mark.parametrize("kind", SAMPLES)
def test_bytes_missing_or_left_over_make_a_message_undecodable(encoding: str, kind: str) -> None:
    message = raw(encoding, kind, SAMPLES[kind])
    for data in (message.data[:-1], message.data[:-8], message.data + bytes(4), b""):
        tally = Tally(read={"/t": 1})
        result = decode(RawMessage(message.channel, 0, data), tally)
        assert isinstance(result, Undecodable)
        assert (tally.read, tally.skipped, tally.lossy) == ({"/t": 0}, {"/t": {result.reason: 1}}, True)


def test_the_padding_of_middleware_is_no_trailing_rubbish() -> None:
    message = raw("cdr", "sensor_msgs/msg/LaserScan", SCAN)
    assert isinstance(decode(RawMessage(message.channel, 0, message.data + bytes(3))), LaserScan)


def test_big_endian_messages_are_read() -> None:
    store, kind = STORES["cdr"], "mcl_msgs/msg/LandmarkBearings"
    data = bytes(store.serialize_cdr(build("cdr", kind, BEARINGS), kind, little_endian=False))
    record = decode(RawMessage(Channel("/t", kind, "cdr"), 0, data))
    assert isinstance(record, LandmarkSightings)
    np.testing.assert_allclose(record.rays[:, 0], np.cos([0.5, -3.0]))


@BOTH
@pytest.mark.parametrize("kind", SAMPLES)
def test_no_bytes_raise(encoding: str, kind: str) -> None:
    message = raw(encoding, kind, SAMPLES[kind])
    rng = seeded(f"{encoding} {kind}")
    outcomes = set()
    for _ in range(150):
        hurt = bytearray(message.data)
        for _ in range(rng.randrange(1, 5)):
            hurt[rng.randrange(len(hurt))] = rng.choice([0, 1, 127, 128, 255, rng.randrange(256)])
        if rng.random() < 0.3:
            at = rng.randrange(len(hurt))
            hurt[at : at + rng.randrange(9)] = rng.randbytes(rng.randrange(9))
        outcomes.add(type(decode(RawMessage(message.channel, 0, bytes(hurt)), Tally())))
    assert Undecodable in outcomes


DEFINITIONS: list[tuple[str, Callable[[str], str], bool]] = [
    ("as it is", lambda text: text, True),
    ("comments, blanks, constants", lambda text: f"# x\n\nuint8 A=1\nstring B='# no'\n{text}  # y\n", True),
    ("long names", lambda text: text.replace("std_msgs/Header", "std_msgs/msg/Header"), True),
    ("a default", lambda text: text.replace("float32 angle_min", "float32 angle_min 0.5"), True),
    ("a type's name alone", lambda _: "sensor_msgs/msg/LaserScan", True),
    ("nothing but a comment", lambda _: "# sensor_msgs/msg/LaserScan\n", True),
    ("another type's name", lambda _: "nav_msgs/msg/Odometry", False),
    ("another type", lambda text: text.replace("float32 angle_min", "float64 angle_min"), False),
    ("another order", lambda text: text.replace("angle_min", "q").replace("angle_max", "angle_min"), False),
    ("a field more", lambda text: "uint8 more\n" + text, False),
    (
        "a nested field more",
        lambda text: text.replace("MSG: std_msgs/Header\n", "MSG: std_msgs/Header\nint8 q\n"),
        False,
    ),
    ("nonsense", lambda _: "module a { struct b { }; };", False),
]


@BOTH
@pytest.mark.parametrize(("change", "known"), [row[1:] for row in DEFINITIONS], ids=[row[0] for row in DEFINITIONS])
def test_the_logs_own_definition_must_agree(encoding: str, change: Callable[[str], str], known: bool) -> None:  # noqa: FBT001
    kind = "sensor_msgs/msg/LaserScan"
    text, _ = STORES[encoding].generate_msgdef(kind, ros_version=1 if encoding == "ros1" else 2)
    record = decode(raw(encoding, kind, SCAN, definition=change(text)))
    assert isinstance(record, LaserScan) == known
    assert known or isinstance(record, Undecodable)


def test_ros1_definitions_are_told_by_their_md5sum() -> None:
    kind = "tf2_msgs/msg/TFMessage"
    values = SAMPLES[kind]
    good = raw("ros1", kind, values, digest="94810edda583a504dfda3829e70d7eec", definition="other text")
    assert isinstance(decode(good), tuple)
    assert isinstance(decode(raw("ros1", kind, values, digest="0" * 32)), Undecodable)
    assert isinstance(decode(raw("ros1", kind, values, digest="*")), tuple)


def test_definitions_are_only_ever_compared() -> None:
    parsed = parse_definition("a/msg/B", "Header h\nC[<=3] c\nstring<=9 s\nbyte[4] d\n===\nMSG: a/C\nint8 x\n")
    assert parsed == {
        "a/B": (("std_msgs/Header", "h"), ("a/C[]", "c"), ("string", "s"), ("uint8[4]", "d")),
        "a/C": (("int8", "x"),),
    }
    assert parse_definition("a/B", "__import__('os')") is None
