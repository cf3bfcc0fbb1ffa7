"""YAML from strangers: of bounded size and depth, and without what makes a small file large or ambiguous.

No anchors, aliases, merges, tags or duplicate keys. Values are built here, from the parser's events, so that a
forbidden construct ends the reading where it stands, before anything was built from it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

from mclcli.errors import InputError
from mclcli.io.tables.text_file import decode, read_bytes, refuse_stand_ins
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

Value = None | bool | int | float | str | list["Value"] | dict[str, "Value"]
Path_ = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,18})")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]{1,5})?")
_DIRECTIVE = re.compile("^%", re.MULTILINE)  # changes what the rest means, or trips the parser
# Possessive throughout (``++``): a list that is none in the end must not be split in every other way as well.
_ITEM = r"[-+]?+[0-9A-Za-z.]{1,40}+(?:(?<=[eE])[-+][0-9]{1,5})?+"
_LONG_LIST = re.compile(
    rf"^(?P<key>[A-Za-z_]\w*):(?:"
    rf"[ ]*\n(?P<block>(?P<indent>[ ]*)-[ ]+{_ITEM}[ ]*\n(?:(?P=indent)-[ ]+{_ITEM}[ ]*\n){{15,}}+)(?=[A-Za-z_]|---|\Z)"
    rf"|[ ]+\[(?P<flow>[ ]*{_ITEM}(?:[ ]*,[ ]*(?:\n[ ]+)?{_ITEM}){{15,}}+[ ]*)\][ ]*\n(?=[A-Za-z_]|---|\Z))",
    re.MULTILINE,
)
"""A key at the top level with at least 16 plain scalars, one a line or between brackets."""
_MARK = "__long_list_"
_WORDS: dict[str, Value] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """What a document may have at most: ``size`` [bytes], ``depth`` of nesting.

    ``repeats``: a key may stand twice in a mapping; the last one counts, and ``Document.repeated`` names it.
    """

    size: int = 64 * 1024
    depth: int = 8
    repeats: bool = False


MAP_LIMITS = Limits()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """One YAML document: its ``value`` in plain Python, and where everything in it stands.

    ``name`` is the file's, for messages. ``more`` says that further documents follow in the file. ``repeated`` are keys
    that stand there twice, where the limits allow it.
    """

    value: Value
    name: str
    lines: dict[Path_, int]
    more: bool = False
    repeated: frozenset[Path_] = frozenset()

    def line(self, *path: str | int) -> int:
        """Line from 1 of a key or item, named by the keys and indices that lead to it, or of what holds it."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)


def read(path: str | Path, limits: Limits = MAP_LIMITS, *, several: bool = False) -> Document:
    """First document of a YAML file; see ``parse``. UsageError if there is no such file."""
    return parse(read_bytes(path, limits.size), str(path), limits, several=several)


def load_yaml_file(path: str | Path, limits: Limits = MAP_LIMITS) -> Value:
    """Plain value of a YAML file with one document; errors as of ``read``."""
    return read(path, limits).value


def parse(data: bytes, name: str, limits: Limits = MAP_LIMITS, *, several: bool = False) -> Document:
    """First document of YAML text in UTF-8; ``name`` is what messages call it.

    Mappings keep their keys as written, as text. Plain scalars become None, bool, int, float or str by the core schema
    of YAML 1.2, except that ``5e-2`` is a number and ``007`` is text; quoted ones stay str.

    Raises
    ------
    InputError
        Naming the line, if the text is not YAML, breaks a limit or uses a forbidden construct; if further documents
        follow, other than empty ones, and ``several`` is not set.

    """
    if len(data) > limits.size:
        raise InputError(f"{name}: is longer than {limits.size} bytes, the most that is read; check the file")
    refuse_stand_ins(data, name)
    text = decode(data, name)
    if directive := _DIRECTIVE.search(text):
        line = text.count("\n", 0, directive.start()) + 1
        raise InputError(f"{name}: a directive (%), line {line}; write it without")
    short, lists = _without_long_lists(text)
    builder = _Builder(_events(short, name), name, limits, {}, set())
    value = builder.document()
    if lists and isinstance(value, dict):
        value = {key: lists.pop(item, item) if isinstance(item, str) else item for key, item in value.items()}
    if lists:  # a mark within something else: read it as it stands
        builder = _Builder(_events(text, name), name, limits, {}, set())
        value = builder.document()
    try:
        more = builder.goes_on()
    except InputError:
        if not several:
            raise
        more = True  # a stream of documents was cut off in the next one
    if more and not several:
        raise InputError(f"{name}: holds more than one document (---); keep one")
    return Document(value, name, builder.lines, more, frozenset(builder.repeated))


def _without_long_lists(text: str) -> tuple[str, dict[str, Value]]:
    """The text with a mark in the place of every long list of plain scalars at its top level, and the lists by mark.

    A scan is hundreds of numbers, and the parser takes half a millisecond for each. Lines keep their numbers.
    """
    lists: dict[str, Value] = {}
    if _MARK in text:
        return text, lists

    def taken(match: re.Match[str]) -> str:
        mark = f"{_MARK}{len(lists)}"
        items = re.split(r"\s*,\s*", match["flow"].strip()) if match["flow"] else re.findall(_ITEM, match["block"])
        lists[mark] = [resolve(item) for item in items]
        return f"{match['key']}: {mark}" + "\n" * match[0].count("\n")

    return _LONG_LIST.sub(taken, text), lists


def resolve(text: str) -> Value:
    """Value of a plain scalar."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Builder:
    """Turns events into values, refusing on the way; ``lines`` and ``repeated`` are filled meanwhile."""

    events: Iterator[tuple[str, Any]]
    name: str
    limits: Limits
    lines: dict[Path_, int]
    repeated: set[Path_]

    def document(self) -> Value:
        """Value of the first document."""
        kind, _ = next(self.events)
        while kind in {"StreamStart", "DocumentStart"}:
            kind, event = next(self.events)
        if kind == "StreamEnd":
            raise InputError(f"{self.name}: holds nothing but comments; check the file")
        value = self._value(kind, event, ())
        while kind != "DocumentEnd":
            kind, _ = next(self.events)
        return value

    def goes_on(self) -> bool:
        """Whether a second document that is not empty follows."""
        while (step := next(self.events))[0] in {"DocumentStart", "DocumentEnd", "Scalar"}:
            if getattr(step[1], "value", ""):
                return True
        return step[0] != "StreamEnd"

    def _value(self, kind: str, event: Any, path: Path_) -> Value:  # noqa: ANN401 - ruamel's events are untyped
        self._check(kind, event, path)
        if kind == "Scalar":
            return resolve(event.value) if event.style is None else str(event.value)
        return self._mapping(path) if kind == "MappingStart" else self._sequence(path)

    def _sequence(self, path: Path_) -> list[Value]:
        items: list[Value] = []
        while (step := next(self.events))[0] != "SequenceEnd":
            here = (*path, len(items))
            if step[0] != "Scalar":
                self.lines[here] = step[1].start_mark.line + 1
            items.append(self._value(*step, here))
        return items

    def _mapping(self, path: Path_) -> dict[str, Value]:
        pairs: dict[str, Value] = {}
        while (step := next(self.events))[0] != "MappingEnd":
            key, line = self._key(*step, path), step[1].start_mark.line + 1
            if key in pairs and not self.limits.repeats:
                self._refuse(f"key '{clean(key, 40)}' stands there twice", line)
            if key in pairs:
                self.repeated.add((*path, key))
            self.lines[*path, key] = line
            pairs[key] = self._value(*next(self.events), (*path, key))
        return pairs

    def _key(self, kind: str, event: Any, path: Path_) -> str:  # noqa: ANN401 - ruamel's events are untyped
        self._check(kind, event, path)
        line = event.start_mark.line + 1
        if kind != "Scalar":
            self._refuse("a key that is not plain text", line)
        if event.value == "<<" and event.style is None:
            self._refuse("a merge (<<)", line)
        return str(event.value)

    def _check(self, kind: str, event: Any, path: Path_) -> None:  # noqa: ANN401 - ruamel's events are untyped
        line = event.start_mark.line + 1
        if kind == "Alias" or event.anchor is not None:
            self._refuse("an anchor or alias (& or *)", line)
        if event.tag is not None:
            self._refuse(f"a tag ({clean(str(event.tag), 40)})", line)
        if kind != "Scalar" and len(path) >= self.limits.depth:
            self._refuse(f"nesting deeper than {self.limits.depth}", line)

    def _refuse(self, what: str, line: int) -> None:
        raise InputError(f"{self.name}: {what}, line {line}; write it without")


def _events(text: str, name: str) -> Iterator[tuple[str, Any]]:
    """The parser's events with the names of their kinds; its errors become InputError."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            yield type(event).__name__.removesuffix("Event"), event
    except (YAMLError, ValueError, OverflowError) as error:  # ValueError, OverflowError: impossible \U escapes
        raise InputError(f"{name}: not valid YAML: {_describe(error)}; correct it") from None


def _describe(error: Exception) -> str:
    """What ruamel.yaml found, in one line."""
    what = getattr(error, "problem", None) or str(error).split("\n", maxsplit=1)[0]
    mark = getattr(error, "problem_mark", None)
    return clean(str(what), 100) + (f", line {mark.line + 1}" if mark is not None else "")
