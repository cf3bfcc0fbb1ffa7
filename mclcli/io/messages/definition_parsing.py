"""Recorded message definitions as fields: ROS's own language, and IDL (see ``idl``).

The text is that of rosbag and of MCAP's ros1msg, ros2msg and ros2idl: the type's own fields, then a line of ``=`` and a
line ``MSG: package/Type`` or ``IDL: package/msg/Type`` before those of each type it uses. Which of the two languages a
section is in is told by the section itself: files exist that name the wrong one.
"""

from __future__ import annotations

import re

Fields = tuple[tuple[str, str], ...]
"""(type, name) of each field: types as ``float64``, ``geometry_msgs/Pose[]``, ``float64[36]``; bounds left out."""

_ALIASES = {
    "time": "builtin_interfaces/Time",
    "duration": "builtin_interfaces/Duration",
    "Header": "std_msgs/Header",
    "char": "uint8",
    "byte": "uint8",
    "octet": "uint8",
}
_PLAIN = re.compile(r"bool|string|wstring|u?int(8|16|32|64)|float(32|64)")
_FIELD = re.compile(r"^([A-Za-z]\w*(?:/\w+)*)((?:<=\d+)?)((?:\[(?:<=)?\d*\])?) +([A-Za-z]\w*)(?: *| +[^=\s].*)$")
_CONSTANT = re.compile(r"^\S+ +\w+ *=")
_BORDER = re.compile(r"^={3,}[ \t\r]*$", re.MULTILINE)
_COMMENT = re.compile(r"#[^\n]*")
_MODULE = re.compile(r"^\s*module\s+\w+\s*\{", re.MULTILINE)  # what IDL has, and ROS's own language has not


def parse_definition(kind: str, text: str) -> dict[str, Fields] | None:
    """Fields of every type that a recorded definition describes, by short name; None where it makes no sense."""
    result: dict[str, Fields] = {}
    for number, section in enumerate(_BORDER.split(text)):
        if number == 0 and not section.strip():
            continue
        types = _parse_section(section, short_name(kind) if number == 0 else "")
        if types is None:
            return None
        for name, fields in types.items():
            result.setdefault(name, fields)
    return result


def says_nothing(kind: str, text: str) -> bool:
    """Whether a text describes no field, of this type or of any other: it is empty, or holds the type's name alone."""
    rest = _COMMENT.sub("", text).strip()
    return not rest or short_name(re.sub(r"^(MSG|IDL): *", "", rest)) == short_name(kind)


def short_name(kind: str) -> str:
    """Name of a type without ``msg``."""
    return kind.replace("/msg/", "/")


def long_name(kind: str) -> str:
    """Name of a type with ``msg``, as the stores have it."""
    package, _, name = short_name(kind).partition("/")
    return f"{package}/msg/{name}"


def plain_name(kind: str) -> str:
    """A number's type by its newest name."""
    return _ALIASES.get(kind, kind)


def _parse_section(section: str, name: str) -> dict[str, Fields] | None:
    """Types of one section; ``name`` is that of the first one, which needs none of its own."""
    head, _, rest = section.lstrip().partition("\n")
    language, colon, title = head.strip().partition(": ")
    if colon and language in {"MSG", "IDL"}:
        name, section = short_name(title.strip()), rest
    elif not name:
        return None
    if (colon and language == "IDL") or _MODULE.search(section):
        from mclcli.io.messages import idl

        return idl.parse(section)
    lines = [line.partition("#")[0].strip() for line in section.splitlines()]
    fields = _parse_fields([re.sub(r"\s+", " ", line) for line in lines if line], name.partition("/")[0])
    return None if fields is None else {name: fields}


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
    base = plain_name(base)
    return short_name(base) if "/" in base or _PLAIN.fullmatch(base) else f"{package}/{base}"
