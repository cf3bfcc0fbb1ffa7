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
_DISPUTED = re.compile("[\x85\u2028\u2029\ufeff]")  # end lines and comments, or vanish, in YAML 1.1 and not in 1.2
_TAB = re.compile(r"(?m)(?<=[:,\[{-])[ \t]*\t[ \t]*|[ \t]*\t[ \t]*(?=[#:,\]}\r]|$)")
"""Tabs that separate, as YAML allows: PyYAML's own parser takes none, libyaml's not all. They never indent."""
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
    for pattern, what in (
        (_DIRECTIVE, "a directive (%)"),
        (_DISPUTED, "a line separator or byte order mark (U+0085, U+2028, U+2029, U+FEFF)"),
    ):
        if found := pattern.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise InputError(f"{name}: {what}, line {line}; write it without")
    text = _TAB.sub(lambda found: " " * len(found.group()), text) if "\t" in text else text
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

    def _value(self, kind: str, event: Any, path: Path_) -> Value:  # noqa: ANN401 - events of every kind
        self._check(kind, event, path)
        if kind == "Scalar":
            return str(event.value) if event.style else resolve(event.value)
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

    def _key(self, kind: str, event: Any, path: Path_) -> str:  # noqa: ANN401 - events of every kind
        self._check(kind, event, path)
        line = event.start_mark.line + 1
        if kind != "Scalar":
            self._refuse("a key that is not plain text", line)
        if event.value == "<<" and not event.style:
            self._refuse("a merge (<<)", line)
        return str(event.value)

    def _check(self, kind: str, event: Any, path: Path_) -> None:  # noqa: ANN401 - events of every kind
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
    """The parser's events with the names of their kinds; its errors become InputError.

    libyaml's parser where PyYAML was built with it, else PyYAML's own, which takes ten times as long.
    """
    import yaml

    try:
        for event in yaml.parse(text, Loader=yaml.CLoader if yaml.__with_libyaml__ else yaml.SafeLoader):
            yield type(event).__name__.removesuffix("Event"), event
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # ValueError, OverflowError: impossible \U escapes
        raise InputError(f"{name}: not valid YAML: {_describe(error)}; correct it") from None


def _describe(error: Exception) -> str:
    """What the parser found, in one line."""
    what = getattr(error, "problem", None) or str(error).split("\n", maxsplit=1)[0]
    mark = getattr(error, "problem_mark", None)
    return clean(str(what), 100) + (f", line {mark.line + 1}" if mark is not None else "")
