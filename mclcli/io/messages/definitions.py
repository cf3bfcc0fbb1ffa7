"""Message definitions: which types are known, field by field, and whether a log's own definition agrees.

Types come from rosbags' built-in stores and from our own texts (``definition_texts``). What a log says of its types is
only ever compared, never registered or executed: a definition that differs makes its messages undecodable, by name.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from mclcli.io.messages.definition_parsing import (
    Fields,
    long_name,
    parse_definition,
    plain_name,
    says_nothing,
    short_name,
)
from mclcli.io.messages.definition_texts import OLDER, OWN, ROS1, ROS2
from mclcli.io.messages.sightings import vision_messages

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rosbags.typesys.store import Typestore

    from mclcli.io.logs.base import Channel

_STORES = {
    "ros1": (("ROS1_NOETIC", 0),),
    "cdr": (("ROS2_HUMBLE", 0), ("LATEST", 0), ("ROS2_FOXY", 0), ("ROS2_HUMBLE", 1), ("ROS2_HUMBLE", 2)),
}  # rosbags' name, and how many versions back our own texts go
_DEFINITION_LIMIT = 1 << 20  # longer texts are not compared, and count as unknown


def stores_for(channel: Channel) -> Iterator[Typestore]:
    """Type stores that know a channel's type, the newest version first; each is built when it is asked for."""
    stores = (_store(name, age) for name, age in _STORES.get(channel.encoding, ()))
    return (store for store in stores if channel.type in store.fielddefs)


def store_for(channel: Channel) -> Typestore | str:
    """Type store whose definition a channel's messages are written by, or the reason why there is none.

    A channel without a definition of its own is taken for the newest version known.
    """
    found = next((store for store in stores_for(channel) if _agrees(store, channel)), None)
    return found or _unknown(channel) or f"its definition of {channel.type} is another version than those known"


def _unknown(channel: Channel) -> str:
    """Why no store knows a channel's type, empty if one does."""
    if not channel.type:
        return "it has no schema, and nothing else says its type"
    if channel.encoding not in _STORES:
        encoding = channel.encoding[:40]
        return f"its encoding {encoding!r} is not supported: mcl reads CDR, and ROS 1's own serialization"
    return "" if any(stores_for(channel)) else f"its type {channel.type[:100]!r} is not known"


def recorded_definition(channel: Channel) -> dict[str, Fields] | None:
    """Fields by type of the log's own definition, None where it has none that makes sense."""
    text = channel.definition
    if len(text) > _DEFINITION_LIMIT or says_nothing(channel.type, text):
        return None
    return parse_definition(channel.type, text)


def definition_of(channel: Channel) -> str:
    """Full definition of a channel's type as text with all types it uses, '' where we know none that fits."""
    store = store_for(channel)
    if isinstance(store, str):
        return ""
    text, _ = store.generate_msgdef(channel.type, ros_version=1 if channel.encoding == "ros1" else 2)
    return text


def begins_with_header(channel: Channel) -> bool:
    """Whether the messages of a channel begin with a std_msgs/Header; False where their type is not known."""
    store = store_for(channel)
    if isinstance(store, str):
        fields = (recorded_definition(channel) or {}).get(short_name(channel.type), ())
    else:
        fields = fields_of(store, channel.type)
    return fields[:1] == (("std_msgs/Header", "header"),)


@lru_cache(maxsize=8)
def _store(name: str, age: int) -> Typestore:
    """Build one type store, with our own texts added: expensive, so once per process and only when needed."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores[name])
    seen = [text for message in vision_messages().values() for text in message.texts.items()]
    own = {**OWN, **dict(seen), **(ROS1 if name.startswith("ROS1") else ROS2)} if age == 0 else OLDER[age - 1]
    types: dict[str, Any] = {}
    for kind, text in own.items():
        if kind not in store.fielddefs:
            types.update(get_types_from_msg(text, kind))
    store.register(types)
    return store


def _agrees(store: Typestore, channel: Channel) -> bool:
    """Whether the log's own definition, where it has one, describes the same bytes as the store's."""
    if channel.encoding == "ros1" and re.fullmatch(r"[0-9a-f]{32}", channel.digest):
        return bool(store.generate_msgdef(channel.type, ros_version=1)[1] == channel.digest)
    if len(channel.definition) <= _DEFINITION_LIMIT and says_nothing(channel.type, channel.definition):
        return True
    recorded = recorded_definition(channel)
    return recorded is not None and _same(store, channel.type, recorded, set())


def _same(store: Typestore, kind: str, recorded: dict[str, Fields], seen: set[str]) -> bool:
    """Compare a type, and all those its fields have, as far as the recorded text describes them."""
    if kind in seen or short_name(kind) not in recorded:
        return bool(seen)  # a text may leave out types it takes for granted, but not its own
    seen.add(kind)
    known = fields_of(store, kind)
    if known != recorded[short_name(kind)]:
        return False
    inner = (long_name(field.partition("[")[0]) for field, _ in known if "/" in field)
    return all(_same(store, name, recorded, seen) for name in inner)


def fields_of(store: Typestore, kind: str) -> Fields:
    """Fields of a type in a store, names in lower case."""
    from rosbags.interfaces import Nodetype

    def name_of(node: tuple[Any, Any]) -> str:
        what, detail = node
        if what == Nodetype.NAME:
            return short_name(detail)
        if what == Nodetype.BASE:
            return plain_name(str(detail[0]))
        inner, count = detail
        return name_of(inner) + (f"[{count}]" if what == Nodetype.ARRAY else "[]")

    return tuple(
        (name_of(node), name.lower())
        for name, node in store.fielddefs[kind][1]
        if name != "structure_needs_at_least_one_member"
    )
