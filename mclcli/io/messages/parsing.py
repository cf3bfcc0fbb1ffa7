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

_LONGEST = 16 << 20  # [bytes] of a message to be told as text: each number takes many times its bytes
_MOST = 1024  # parsers kept


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
    from mclcli.io.messages.definitions import store_for

    store = store_for(channel)
    if isinstance(store, str):
        return Undecodable(store)
    definition = store.get_msgdef(channel.type)
    ros1 = channel.encoding == "ros1"

    def parse(data: bytes) -> Parsed:
        if ros1:
            value, end = definition.deserialize_ros1(data, 0, definition.cls, store)
            return value if end == len(data) else Undecodable("its length is wrong")
        if data[:2] not in {b"\x00\x00", b"\x00\x01"} or len(data) < 4:
            return Undecodable("it is not plain CDR")
        read = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
        value, end = read(data[4:], 0, definition.cls, store)
        # Middleware pads messages to a multiple of four bytes.
        return value if 0 <= len(data) - 4 - end <= 3 else Undecodable("its length is wrong")

    return parse


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
        value = Undecodable("it does not parse")
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
