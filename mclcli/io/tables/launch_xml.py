"""XML of a roslaunch file as a tree with lines: bounded, and without what could make it large or read other files.

A document type is refused, and with it every entity but XML's own five; nothing is fetched.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn, final
from xml.parsers import expat

from mclcli.errors import InputError
from mclcli.io.tables.text_file import decode
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Mapping

_DEPTH = 64


@final
@dataclass(slots=True)
class Element:
    """One element: its tag and attributes, its line from 1, the elements in it, and the pieces of text beside them."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """All text directly in it."""
        return "".join(self.texts)


def looks_like_xml(data: bytes) -> bool:
    """Whether a file begins as XML does; no YAML mapping does."""
    return data[:256].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")


def parse(data: bytes, name: str) -> Element:
    """Root of an XML document in UTF-8; ``name`` is what messages call the file, whose size the caller bounds.

    Raises
    ------
    InputError
        Naming the line, if it is not XML, too deep, or has a document type.

    """
    text = decode(data, name)
    parser = expat.ParserCreate(encoding="utf-8")
    stack = [Element("", {}, 1)]

    def refuse(*_: object) -> NoReturn:
        raise InputError(f"{name}: a document type (<!DOCTYPE>), line {parser.CurrentLineNumber}; write it without")

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) > _DEPTH:
            raise InputError(f"{name}: elements nested deeper than {_DEPTH}, line {parser.CurrentLineNumber}")
        element = Element(tag, attributes, parser.CurrentLineNumber)
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop()

    def characters(text: str) -> None:
        stack[-1].texts.append(text)

    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        reason = clean(expat.ErrorString(error.code) or "", 80)
        raise InputError(f"{name}: not XML that can be read: {reason}, line {error.lineno}; correct the file") from None
    return stack[0].children[0]
