"""Message definitions: which types are known, field by field, and whether a log's own definition agrees.

Types come from rosbags' built-in stores and from our own texts (``definition_texts``). What a log says of its types is
only ever compared, never registered or executed: a definition that differs makes its messages undecodable, by name.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from mclcli.io.messages.definition_texts import OLDER, OWN, ROS1, ROS2
from mclcli.io.messages.sightings import vision_messages

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from mclcli.io.logs.base import Channel

Fields = tuple[tuple[str, str], ...]
"""(type, name) of each field: types as ``float64``, ``geometry_msgs/Pose[]``, ``float64[36]``; bounds left out."""

_STORES = {
    "ros1": (("ROS1_NOETIC", 0),),
    "cdr": (("ROS2_HUMBLE", 0), ("LATEST", 0), ("ROS2_FOXY", 0), ("ROS2_HUMBLE", 1), ("ROS2_HUMBLE", 2)),
}  # rosbags' name, and how many versions back our own texts go
_ALIASES = {
    "time": "builtin_interfaces/Time",
    "duration": "builtin_interfaces/Duration",
    "Header": "std_msgs/Header",
    "char": "uint8",
    "byte": "uint8",
    "octet": "uint8",
}
_FIELD = re.compile(r"^([A-Za-z]\w*(?:/\w+)*)((?:<=\d+)?)((?:\[(?:<=)?\d*\])?) +([A-Za-z]\w*)(?: *| +[^=\s].*)$")
_CONSTANT = re.compile(r"^\S+ +\w+ *=")
_DEFINITION_LIMIT = 1 << 20  # longer texts are not compared, and count as unknown


def store_for(channel: Channel) -> Typestore | str:
    """Type store that decodes a channel's messages, or the reason why there is none.

    A channel without a definition of its own is taken for the newest version known.
    """
    versions = _STORES.get(channel.encoding)
    if versions is None:
        return f"its encoding {channel.encoding[:40]!r} is not supported"
    known = False
    for name, age in versions:
        store = _store(name, age)
        if channel.type in store.fielddefs:
            known = True
            if _agrees(store, channel):
                return store
    if not known:
        return f"its type {channel.type[:100]!r} is not known"
    return f"its definition of {channel.type} is another version than those known"


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
        recorded = parse_definition(channel.type, channel.definition[:_DEFINITION_LIMIT]) or {}
        return recorded.get(_short(channel.type), (("", ""),))[:1] == (("std_msgs/Header", "header"),)
    return _fields(store, channel.type)[:1] == (("std_msgs/Header", "header"),)


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
    if not channel.definition:
        return True
    if len(channel.definition) > _DEFINITION_LIMIT:
        return False
    recorded = parse_definition(channel.type, channel.definition)
    return recorded is not None and _same(store, channel.type, recorded, set())


def _same(store: Typestore, kind: str, recorded: dict[str, Fields], seen: set[str]) -> bool:
    """Compare a type, and all those its fields have, as far as the recorded text describes them."""
    if kind in seen or _short(kind) not in recorded:
        return bool(seen)  # a text may leave out types it takes for granted, but not its own
    seen.add(kind)
    known = _fields(store, kind)
    if known != recorded[_short(kind)]:
        return False
    inner = (_long(field.partition("[")[0]) for field, _ in known if "/" in field)
    return all(_same(store, name, recorded, seen) for name in inner)


def _fields(store: Typestore, kind: str) -> Fields:
    """Fields of a type in a store."""
    from rosbags.interfaces import Nodetype

    def name_of(node: tuple[Any, Any]) -> str:
        what, detail = node
        if what == Nodetype.NAME:
            return _short(detail)
        if what == Nodetype.BASE:
            return _ALIASES.get(detail[0], str(detail[0]))
        inner, count = detail
        return name_of(inner) + (f"[{count}]" if what == Nodetype.ARRAY else "[]")

    return tuple(
        (name_of(node), name.lower())
        for name, node in store.fielddefs[kind][1]
        if name != "structure_needs_at_least_one_member"
    )


def parse_definition(kind: str, text: str) -> dict[str, Fields] | None:
    """Fields of every type that a recorded definition describes, by short name; None where it makes no sense.

    The text is that of rosbag and of MCAP's ros1msg and ros2msg: the type's own fields, then a line of ``=`` and a
    line ``MSG: package/Type`` before those of each type it uses.
    """
    result: dict[str, Fields] = {}
    name = _short(kind)
    for number, section in enumerate(re.split(r"^={3,}[ \t]*$", text, flags=re.MULTILINE)):
        lines = [line.partition("#")[0].strip() for line in section.splitlines()]
        lines = [re.sub(r"\s+", " ", line) for line in lines if line]
        if number:
            if not lines or not lines[0].startswith("MSG: "):
                return None
            name = _short(lines.pop(0)[5:].strip())
        fields = _parse_fields(lines, name.partition("/")[0])
        if fields is None:
            return None
        result.setdefault(name, fields)
    return result


def _parse_fields(lines: list[str], package: str) -> Fields | None:
    fields = []
    for line in lines:
        if _CONSTANT.match(line):
            continue
        match = _FIELD.match(line)
        if match is None:
            return None
        base, _, array, name = match.groups()
        fields.append((_full(base, package) + re.sub(r"\[<=\d+\]", "[]", array), name.lower()))
    return tuple(fields)


def _full(base: str, package: str) -> str:
    """Type of a field with its package: types of the same package may be written without."""
    base = _ALIASES.get(base, base)
    if "/" in base or re.fullmatch(r"bool|string|wstring|u?int(8|16|32|64)|float(32|64)", base):
        return _short(base)
    return f"{package}/{base}"


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")


def _long(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"
