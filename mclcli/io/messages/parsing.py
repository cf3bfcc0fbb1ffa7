"""Bytes of one message into an object with its fields, by the definitions we know: exact lengths, no guesses."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.errors import InputError
from mclcli.io.messages.conversion import Parsed, Undecodable

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.io.logs.base import Channel, RawMessage
    from mclcli.io.messages.layouts import Layout
    from mclcli.io.messages.walking import Reader

_LONGEST = 16 << 20  # [bytes] of a message to be told as text: each number takes many times its bytes
_MOST = 1024  # parsers kept
NOT_PARSED = "it does not parse: it was cut short, or its bytes are not of its type"
"""Reason for messages whose parser fails."""
_LENGTH = "its length is wrong: it was cut short, or is of another version of its type"
_MUTABLE = "it is XCDR of mutable types (parameter lists), which is not supported; record with plain CDR"
_CDR = {b"\0\0": "be", b"\0\1": "le"}
_OTHERS = {
    **{bytes((0, kind)): _MUTABLE for kind in (2, 3, 0x0A, 0x0B, 0x12, 0x13)},
    b"\0\4": "it is XML, not CDR",
    b"\x28\xb5\x2f\xfd": "it is compressed (zstd), and cannot be decompressed",
    b"\x04\x22\x4d\x18": "it is compressed (lz4); record without compression of messages, or with zstd",
    b"\x1f\x8b": "it is compressed (gzip); record without compression of messages, or with zstd",
    b"BZh": "it is compressed (bzip2); record without compression of messages, or with zstd",
    b"{": "it is JSON, not CDR",
}
"""What other messages begin with."""


# A channel's hash takes longer than a message's parsing. What stands here keeps its channel, and so its id.
_BY_ID: dict[int, tuple[Channel, Callable[[bytes], Parsed] | Undecodable]] = {}


def parser_for(channel: Channel) -> Callable[[bytes], Parsed] | Undecodable:
    """Bytes → rosbags' message object or Undecodable, for one channel."""
    known = _BY_ID.get(id(channel))
    if known is None:
        if len(_BY_ID) == _MOST:
            _BY_ID.clear()
        known = _BY_ID[id(channel)] = channel, _make_parser(channel)
    return known[1]


@lru_cache(maxsize=_MOST)
def _make_parser(channel: Channel) -> Callable[[bytes], Parsed] | Undecodable:
    from mclcli.io.messages.layouts import layout_for

    layout = layout_for(channel)
    if isinstance(layout, str):
        return Undecodable(layout)
    try:
        return (_ros1 if channel.encoding == "ros1" else _cdr)(layout, channel.type, exact=not layout.recorded)
    except ValueError as error:
        return Undecodable(f"its definition of {channel.type} cannot be read: {error}")


def _ros1(layout: Layout, kind: str, *, exact: bool) -> Callable[[bytes], Parsed]:
    """Parser of ROS 1's serialization; ``exact`` where the layout is the store's own."""
    if exact:
        read = _own(layout, kind, "deserialize_ros1")
    else:
        from mclcli.io.messages import walking

        read = walking.reader_for(layout, kind, walking.ROS1)

    def parse(data: bytes) -> Parsed:
        value, end = read(data, 0)
        return value if end == len(data) else Undecodable(_LENGTH)

    return parse


def _cdr(layout: Layout, kind: str, *, exact: bool) -> Callable[[bytes], Parsed]:
    """Parser of CDR in any encapsulation that can be read; those of XCDR2 get their readers when they are met."""
    readers: dict[bytes, Reader | None] = {
        form: _own(layout, kind, f"deserialize_cdr_{order}") if exact else _walker(layout, kind, form)
        for form, order in _CDR.items()
    }

    def parse(data: bytes) -> Parsed:
        form = data[:2]
        read = readers.get(form)
        if read is None and form not in readers:
            read = readers[bytes(form)] = _walker(layout, kind, bytes(form))
        if read is None or len(data) < 4:
            return Undecodable(_not_cdr(data))
        value, end = read(data[4:], 0)
        # Middleware pads messages to a multiple of four bytes.
        return value if 0 <= len(data) - 4 - end <= 3 else Undecodable(_LENGTH)

    return parse


def _walker(layout: Layout, kind: str, form: bytes) -> Reader | None:
    """Reader by fields alone of the encapsulation ``form``; None for one that cannot be read.

    Raises ValueError for a definition that cannot be read.
    """
    from mclcli.io.messages import walking

    encoding = walking.CDR.get(form)
    return None if encoding is None else walking.reader_for(layout, kind, encoding)


def _own(layout: Layout, kind: str, name: str) -> Reader:
    """rosbags' own reader of a type."""
    definition, store = layout.store.get_msgdef(kind), layout.store
    read, make = getattr(definition, name), definition.cls
    return lambda data, at: read(data, at, make, store)


def _not_cdr(data: bytes) -> str:
    """Why bytes are no CDR that can be read, by the first of them."""
    names = (what for start, what in _OTHERS.items() if data[: len(start)] == start)
    return next(names, "it is not plain CDR" if len(data) >= 4 else "it is shorter than a CDR message can be")


def to_plain(message: RawMessage) -> dict[str, Any]:
    """Message as nested dicts, lists, numbers and texts, fields in order; any type that the stores know.

    Raises InputError, naming the topic and the reason, if it cannot be decoded.
    """
    parse = parser_for(message.channel)
    if len(message.data) > _LONGEST:
        parse = Undecodable(f"it is longer than {_LONGEST >> 20} MiB")
    try:
        value = parse if isinstance(parse, Undecodable) else parse(message.data)
    except Exception:  # noqa: BLE001 - as in decode
        value = Undecodable(NOT_PARSED)
    if isinstance(value, Undecodable):
        topic = message.channel.topic
        raise InputError(f"{topic}: message cannot be decoded: {value.reason}; choose another topic")
    plain: dict[str, Any] = _plain(value)
    return plain


def _plain(value: Parsed) -> Parsed:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [_plain(item) for item in value]
    fields = getattr(value, "__dataclass_fields__", None)
    if fields is None:
        return value
    names = (name for name in fields if name not in {"__msgtype__", "structure_needs_at_least_one_member"})
    return {name: _plain(getattr(value, name)) for name in names}
