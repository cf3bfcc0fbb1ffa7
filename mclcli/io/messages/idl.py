"""Message definitions in IDL, as far as rosidl and DDS recorders write it: structs within modules, typedefs, constants.

The text is only ever read as data. What is not understood (unions, enumerations, optional members, arrays of more than
one dimension) becomes a type that agrees with none that is known. Sources: OMG IDL 4.2; ROS 2's rosidl.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import final

Members = tuple[tuple[str, str], ...]

_NOT_UNDERSTOOD = "?"  # a type that agrees with none
_COMMENT = re.compile(r'"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
_DIRECTIVE = re.compile(r"^[ \t]*#[^\n]*", re.MULTILINE)
_TOKEN = re.compile(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|::|[A-Za-z_]\w*|[^\s\w]|\d[\w.]*')
_MOST_TOKENS = 1 << 17
_DEEPEST = 16
_NUMBERS = {
    "boolean": "bool",
    "octet": "uint8",
    "char": "uint8",
    "float": "float32",
    "double": "float64",
    "short": "int16",
    "unsigned short": "uint16",
    "long": "int32",
    "unsigned long": "uint32",
    "long long": "int64",
    "unsigned long long": "uint64",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_WORDS = frozenset({"unsigned", "long", "short", "double"})


def parse(text: str) -> dict[str, Members] | None:
    """Members (type, name in lower case) of structs in a text, by ``package/Name``; None where it makes no sense."""
    plain = _DIRECTIVE.sub("", _COMMENT.sub(_without_comment, text))
    tokens = _TOKEN.findall(plain)
    if len(tokens) > _MOST_TOKENS:
        return None
    parser = _Parser(tokens)
    try:
        parser.definitions((), 0)
    except (IndexError, ValueError):  # the text ends too early, or something else stands where a mark should
        return None
    return parser.structs


def _without_comment(match: re.Match[str]) -> str:
    return match.group() if match.group().startswith('"') else " "


@final
@dataclass(slots=True)
class _Parser:
    """Reads definitions in order; ``names`` are those of typedefs, ``constants`` numbers, by their full names."""

    tokens: list[str]
    at: int = 0
    structs: dict[str, Members] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)

    def take(self) -> str:
        """The next token. Raises IndexError at the end."""
        self.at += 1
        return self.tokens[self.at - 1]

    def expect(self, mark: str) -> None:
        """Pass a mark. Raises ValueError if something else stands there."""
        if self.take() != mark:
            raise ValueError(mark)

    def passed(self, mark: str) -> bool:
        """Whether a mark stands here; it is passed if so."""
        if self.tokens[self.at] != mark:
            return False
        self.at += 1
        return True

    def definitions(self, scope: tuple[str, ...], depth: int) -> None:
        """Everything up to the end of a module, or of the text."""
        if depth > _DEEPEST:
            raise ValueError("modules within modules")
        while self.at < len(self.tokens) and not (depth and self.tokens[self.at] == "}"):
            self.annotations()
            word = self.take()
            if word == "module":
                name = self.take()
                self.expect("{")
                self.definitions((*scope, name), depth + 1)
                self.expect("}")
                if self.at < len(self.tokens):  # some leave the last semicolon out
                    self.passed(";")
            elif word == "struct":
                self.struct(scope)
            elif word == "typedef":
                for kind, name in self.declared(scope):
                    self.names["::".join((*scope, name))] = kind
            elif word == "const":
                self.constant(scope)
            elif word != ";":
                self.pass_over()

    def struct(self, scope: tuple[str, ...]) -> None:
        """Members of a struct; one with a base, or only declared, is none that is understood."""
        name = self.take()
        if not self.passed("{"):
            self.pass_over()
            return
        members: list[tuple[str, str]] = []
        while not self.passed("}"):
            odd = self.annotations()
            members += [(_NOT_UNDERSTOOD if odd else kind, label.lower()) for kind, label in self.declared(scope)]
        self.expect(";")
        self.structs[_ros_name((*scope, name))] = tuple(members)

    def declared(self, scope: tuple[str, ...]) -> list[tuple[str, str]]:
        """Type and name of each declarator up to a semicolon."""
        kind, found = self.type(scope, 0), []
        while True:
            name, whole = self.take(), kind
            while self.passed("["):
                size = self.take()
                size = size if size.isdecimal() else self.constants.get(self.resolve(size, scope, self.constants), "?")
                whole = f"{whole}[{size}]" if "[" not in whole else _NOT_UNDERSTOOD
                self.expect("]")
            found.append((whole, name))
            if not self.passed(","):
                self.expect(";")
                return found

    def type(self, scope: tuple[str, ...], depth: int) -> str:
        """A type as ROS writes it."""
        word = self.take()
        if word == "sequence" and depth < _DEEPEST:
            self.expect("<")
            inner = self.type(scope, depth + 1)
            self.bound(">")
            return f"{inner}[]" if "[" not in inner else _NOT_UNDERSTOOD
        if word in {"string", "wstring"}:
            if self.passed("<"):
                self.bound(">")
            return word
        while self.tokens[self.at] in _WORDS and word.split()[-1] in _WORDS:
            word = f"{word} {self.take()}"
        if word in _NUMBERS:
            return _NUMBERS[word]
        parts = [] if word == "::" else [word]
        while parts == [] or self.passed("::"):
            parts.append(self.take())
        full = self.resolve("::".join(parts), scope, {**self.names, **dict.fromkeys(self.structs, "")})
        return self.names.get(full) or _ros_name(tuple(full.split("::")))

    def resolve(self, name: str, scope: tuple[str, ...], known: dict[str, str]) -> str:
        """Full name of what is called so within a scope: the innermost that is known, or else the name itself."""
        for depth in range(len(scope), -1, -1):
            full = "::".join((*scope[:depth], name))
            if full in known or _ros_name(tuple(full.split("::"))) in known:
                return full
        return name if "::" in name else "::".join((*scope, name))

    def constant(self, scope: tuple[str, ...]) -> None:
        """Keep a constant that is a plain number: it may be the size of an array."""
        self.type(scope, 0)
        name = self.take()
        self.expect("=")
        if self.tokens[self.at].isdecimal() and self.tokens[self.at + 1] == ";":
            self.constants["::".join((*scope, name))] = self.tokens[self.at]
        self.pass_over()

    def annotations(self) -> bool:
        """Pass over annotations; whether one of them changes how the member is written."""
        changes = False
        while self.passed("@"):
            name = self.take()
            while self.passed("::"):
                name = self.take()
            changes |= name in {"optional", "bit_bound", "must_understand"}
            if self.passed("("):
                self.bound(")")
        return changes

    def bound(self, end: str) -> None:
        """Pass over everything up to a closing mark, pairs of parentheses included."""
        depth = 0
        while (token := self.take()) != end or depth:
            depth += (token == "(") - (token == ")")  # noqa: S105 - a mark, no secret

    def pass_over(self) -> None:
        """Pass over a definition that is not understood, to its semicolon."""
        depth = 0
        while (token := self.take()) != ";" or depth:
            depth += (token == "{") - (token == "}")  # noqa: S105 - a mark, no secret


def _ros_name(parts: tuple[str, ...]) -> str:
    """Name of a type as ROS writes it, without ``msg``: DDS puts ``dds_`` before it, and an underscore behind it."""
    if "dds_" in parts:
        parts = (*(part for part in parts[:-1] if part != "dds_"), parts[-1].removesuffix("_"))
    return "/".join(part for number, part in enumerate(parts) if part != "msg" or number in {0, len(parts) - 1})
