"""Definitions in IDL, none at all, or of another age; messages in XCDR2: what can be read is, the rest is named."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.messages import idl
from mclcli.io.messages.decoding import Undecodable, decode, to_plain
from mclcli.io.messages.definition_parsing import parse_definition
from mclcli.records import LaserScan
from tests.io.definition_samples import ROS1, idl_of, write
from tests.io.ros_messages import ODOMETRY, SAMPLES, SCAN, STORES, raw

if TYPE_CHECKING:
    from collections.abc import Callable

LASER, ODOM = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
TYPES = STORES["cdr"].fielddefs
EACH = pytest.mark.parametrize("kind", SAMPLES)


def plain(message: RawMessage) -> str:
    """What a message holds; NaN is like NaN."""
    return repr(to_plain(message))


@EACH
def test_idl_says_what_ros_own_language_says(kind: str) -> None:
    text, _ = STORES["cdr"].generate_msgdef(kind, ros_version=2)
    assert parse_definition(kind, idl_of(TYPES, kind)) == parse_definition(kind, text)


@EACH
@pytest.mark.parametrize("change", [str, lambda text: text.partition("\n")[2], lambda text: text.replace("\n", "\r\n")])
def test_messages_described_in_idl_are_read(kind: str, change: Callable[[str], str]) -> None:
    known, by_idl = (raw("cdr", kind, SAMPLES[kind], definition=text) for text in ("", change(idl_of(TYPES, kind))))
    assert not isinstance(decode(by_idl), Undecodable)
    assert plain(by_idl) == plain(known)


def test_idl_is_read_as_far_as_it_is_understood() -> None:
    text = """
        import "other.idl";
        module a { module msg {
          enum Color { RED, GREEN };
          union U switch (long) { case 1: long x; };
          const unsigned long N = 3; const string S = "};";
          typedef float Three[N];
          @final struct P { float x, y; };
          struct Q : P { float z; };
          struct R {
            unsigned long long big; P near; ::a::msg::P far; b::msg::dds_::P_ other; Three three;
            sequence<P, 5> some; string<9> name; double grid[2][2]; sequence<sequence<octet>> rows;
            @key long id; @optional long perhaps; @default (value=(1)) short s; Color color;
          };
        }; };
    """
    assert idl.parse(text) == {
        "a/P": (("float32", "x"), ("float32", "y")),
        "a/R": (
            ("uint64", "big"),
            ("a/P", "near"),
            ("a/P", "far"),
            ("b/P", "other"),
            ("float32[3]", "three"),
            ("a/P[]", "some"),
            ("string", "name"),
            ("?", "grid"),
            ("?", "rows"),
            ("int32", "id"),
            ("?", "perhaps"),
            ("int16", "s"),
            ("a/Color", "color"),
        ),
    }


@pytest.mark.parametrize(
    "text",
    [
        "module a {",
        "module a { struct B { float x }; };",
        "struct",
        "module " * 40,
        "module a { " * 40 + "};" * 40,
        "typedef sequence<float x;",
        "@a(((",
        '"',
        "module a { struct B { float x[; }; };",
    ],
)
def test_idl_that_makes_no_sense_describes_nothing(text: str) -> None:
    assert not idl.parse(text)


@pytest.mark.parametrize(
    "text", ["", "\n", "  # nothing\n", LASER, "sensor_msgs/LaserScan\n", f"MSG: {LASER}\n", f"IDL: {LASER}"]
)
def test_a_definition_that_says_nothing_is_taken_for_the_newest(text: str) -> None:
    assert isinstance(decode(raw("cdr", LASER, SCAN, definition=text)), LaserScan)


@pytest.mark.parametrize("form", [0, 1, 6, 7, 8, 9])
@EACH
def test_every_order_of_bytes_and_plain_or_delimited_xcdr2_is_read(kind: str, form: int) -> None:
    known = raw("cdr", kind, SAMPLES[kind])
    data = write(TYPES, kind, SAMPLES[kind], form)
    assert form != 1 or data == known.data, "the tests' own writer writes as rosbags does"
    assert plain(known._replace(data=data)) == plain(known)
    if form >= 6:
        drafted = bytes((0, form + (10 if form < 8 else 12))) + data[2:]  # as earlier drafts numbered them
        assert plain(known._replace(data=drafted)) == plain(known)
    for wrong in (data[:-5], data + bytes(4), data[:9]):
        assert isinstance(decode(known._replace(data=wrong)), Undecodable)


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        (b"\0\2", "mutable"),
        (b"\0\3", "mutable"),
        (b"\0\x0a", "mutable"),
        (b"\0\x0b", "mutable"),
        (b"\0\4", "XML"),
        (b"\x28\xb5\x2f\xfd", "zstd"),
        (b"\x04\x22\x4d\x18", "lz4"),
        (b"\x1f\x8b", "gzip"),
        (b"BZh9", "bzip2"),
        (b'{"a"', "JSON"),
        (b"\0\x7f", "not plain CDR"),
    ],
)
def test_what_is_no_cdr_is_named(start: bytes, reason: str) -> None:
    result = decode(RawMessage(Channel("/t", LASER, "cdr"), 0, start + bytes(100)))
    assert isinstance(result, Undecodable)
    assert reason in result.reason


EXTRA = {"more": 7, "device": "x", "tags": [1, 2, 3], "q": 0.5, "three": [True, False, True], "names": ["a", "bc"]}
AGES: list[tuple[str, str, Callable[[str], str]]] = [
    ("first", LASER, lambda text: "uint8 more\n" + text),
    ("last", LASER, lambda text: text.replace("float32[] intensities", "float32[] intensities\nstring device")),
    ("between", LASER, lambda text: text.replace("float32 range_min", "uint16[] tags\nfloat64 q\nfloat32 range_min")),
    ("nested", LASER, lambda text: text.replace("string frame_id", "string frame_id\nbool[3] three\nstring[] names")),
    ("wider numbers", LASER, lambda text: text.replace("float32", "float64")),
    (
        "another order",
        LASER,
        lambda text: text.replace("angle_min", "_").replace("angle_max", "angle_min").replace("_\n", "angle_max\n"),
    ),
    ("of a type", ODOM, lambda text: text.replace("string child", "geometry_msgs/Point[] path\nstring child")),
]


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize(("kind", "change"), [row[1:] for row in AGES], ids=[row[0] for row in AGES])
def test_fields_that_we_do_not_know_are_passed_over(encoding: str, kind: str, change: Callable[[str], str]) -> None:
    values: Any = {LASER: SCAN, ODOM: ODOMETRY}[kind]
    values = values | EXTRA | {"header": values["header"] | EXTRA, "path": [{"x": 1.0}, {"y": 2.0}]}
    known = raw(encoding, kind, values)
    own, _ = STORES[encoding].generate_msgdef(kind, ros_version=1 if encoding == "ros1" else 2)
    text = change(own)
    types = STORES[encoding].fielddefs | get_types_from_msg(text, kind)
    digest = "0" * 32 if encoding == "ros1" else ""
    for form in (ROS1,) if encoding == "ros1" else (0, 1, 7, 9):
        data = write(types, kind, values, form)
        channel = dataclasses.replace(known.channel, definition=text, digest=digest)
        _assert_same(decode(RawMessage(channel, 1, data)), decode(known))
        for wrong in (data[:-5], data + bytes(4)):
            assert isinstance(decode(RawMessage(channel, 0, wrong)), Undecodable)


def _assert_same(read: Any, known: Any) -> None:
    assert not isinstance(read, Undecodable), read
    for item in dataclasses.fields(known):
        expected, found = getattr(known, item.name), getattr(read, item.name)
        if isinstance(expected, np.ndarray | float):
            np.testing.assert_allclose(found, expected, rtol=1e-6)
        else:
            assert found == expected


def test_a_stamp_of_ros1s_names_is_a_stamp() -> None:
    own, _ = STORES["cdr"].generate_msgdef(LASER, ros_version=2)
    read = decode(raw("cdr", LASER, SCAN, definition=own.replace("nanosec", "nsec").replace("frame_id", "frameId")))
    assert isinstance(read, LaserScan)
    assert (read.stamp_ns, read.frame_id) == (5 * 10**9 + 7, "laser")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.replace("angle_min", "first_angle"), "sensor_msgs/LaserScan has no field angle_min"),
        (
            lambda text: text.replace("float32[] ranges", "float32[4] ranges"),
            "ranges of sensor_msgs/LaserScan is float32[4]",
        ),
        (
            lambda text: text.replace("float32 scan_time", "int32 scan_time"),
            "scan_time of sensor_msgs/LaserScan is int32",
        ),
        (lambda text: text.replace("string frame_id", ""), "std_msgs/Header has no field frame_id"),
        (
            lambda text: text.replace("std_msgs/Header header", "other/Header header"),
            "is other/Header, not std_msgs/Header",
        ),
        (lambda text: text.replace("float32 range_min", "other/Thing thing\nfloat32 range_min"), "other/Thing"),
        (lambda text: text.replace("float32 range_min", "wstring name\nfloat32 range_min"), "wstring"),
    ],
)
def test_a_definition_that_lacks_what_we_need_is_named_with_what_it_lacks(
    change: Callable[[str], str], reason: str
) -> None:
    own, _ = STORES["cdr"].generate_msgdef(LASER, ros_version=2)
    result = decode(raw("cdr", LASER, SCAN, definition=change(own)))
    assert isinstance(result, Undecodable)
    assert f"definition of {LASER}" in result.reason
    assert reason in result.reason


def test_a_type_within_itself_ends() -> None:
    own, _ = STORES["cdr"].generate_msgdef(LASER, ros_version=2)
    endless = own.replace("string frame_id", "string frame_id\nstd_msgs/Header again")
    result = decode(raw("cdr", LASER, SCAN, definition=endless))
    assert isinstance(result, Undecodable)
    assert "definition" in result.reason
