"""Parameters of amcl in a roslaunch file: its <param>, <rosparam> and <remap>, with the file's own <arg>.

Of roslaunch's substitutions ``$(arg NAME)`` alone is made, from the values that the file itself gives; what needs
more (other files, ``$(find …)``, the environment, commands) is told and not guessed. Included files are not read.

Source: roslaunch's ``xmlloader.py`` and ``loader.py`` (noetic-devel).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.errors import InputError, UsageError
from mclcli.io.tables import launch_xml, safe_yaml
from mclcli.io.tables.params_yaml import LIMITS, Given, listed
from mclcli.settings.robots import others
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.io.tables.launch_xml import Element

_ARG = re.compile(r"\$\(\s*arg\s+([^\s()]+)\s*\)")
_MOST = 64 * 1024  # characters that arguments may add to a value
_NODES = 64
_REMAPPED = {"scan": "scan_topic", "map": "map_topic"}
_ROS2 = {"nav2_amcl", "beluga_amcl"}


@final
@dataclass(frozen=True, slots=True)
class _Scope:
    """What holds where an element stands: the namespace, the arguments by name, and the topics' new names."""

    namespace: str = ""
    args: dict[str, str | None] = field(default_factory=dict)
    remapped: dict[str, Given] = field(default_factory=dict)

    def inner(self, namespace: str) -> _Scope:
        """The scope within an element of that namespace; arguments and names that it sets end with it."""
        joined = namespace.rstrip("/") if namespace.startswith("/") else f"{self.namespace}/{namespace}".rstrip("/")
        return _Scope(joined if namespace else self.namespace, dict(self.args), dict(self.remapped))


@final
@dataclass(frozen=True, slots=True)
class Launched:
    """Parameters of every amcl that a launch file starts, by the node's full name.

    ``problems`` are what only roslaunch can find, by the name of the parameter, empty where it may be any of them.
    """

    nodes: dict[str, dict[str, Given]]
    problems: tuple[tuple[str, str], ...] = ()


def parameters_of_amcl(data: bytes, name: str) -> Launched:
    """Parameters of every amcl that a launch file starts.

    Raises
    ------
    InputError
        If the file is not XML or YAML that is read.
    UsageError
        If it is no launch file, one of ROS 2, or starts no amcl.

    """
    root = launch_xml.parse(data, name)
    if root.tag != "launch":
        raise UsageError(f"{name}: XML, but no launch file (<{clean(root.tag, 40)}>); name a YAML or launch file")
    reader = _Reader(name)
    reader.read(root, _Scope())
    _require_amcl(name, reader)
    found = {}
    for node, topics in reader.nodes.items():
        below = {key: given for key, given in reader.given.items() if key.startswith(f"{node}/")}
        found[node] = {**topics, **{key.removeprefix(f"{node}/"): given for key, given in below.items()}}
    ours = tuple(f"{node}/" for node in found)
    told = [(target, text) for target, text in reader.problems if not target or f"{target}/".startswith(ours)]
    leaves = [("" if f"{target}/" in ours else target.rpartition("/")[2], text) for target, text in told]
    return Launched(found, tuple(leaves))


def _require_amcl(name: str, reader: _Reader) -> None:
    if len(reader.nodes) > _NODES:
        raise UsageError(
            f"{name}: starts more than {_NODES} amcl; write the one robot's parameters to a file of their own"
        )
    if reader.nodes or any(not target for target, _ in reader.problems):
        return
    if whose := others.localizer((), reader.types):
        raise UsageError(f"{name}: starts {whose}, which mcl does not read; name a file of amcl's, or mcl's own")
    includes = f"; it includes {listed(reader.includes)}" if reader.includes else ""
    raise UsageError(f"{name}: a launch file that starts no amcl of ROS 1{includes}; name the one that does")


@final
@dataclass(slots=True)
class _Reader:
    """Everything that a file gives: values by full name, amcl nodes with their topics, and what cannot be found.

    ``problems`` have the full name of what they would have set; without one they are about which nodes there are.
    """

    name: str
    given: dict[str, Given] = field(default_factory=dict)
    nodes: dict[str, dict[str, Given]] = field(default_factory=dict)
    problems: list[tuple[str, str]] = field(default_factory=list)
    types: list[str] = field(default_factory=list)
    includes: list[str] = field(default_factory=list)

    def read(self, parent: Element, scope: _Scope) -> None:
        """Read what stands in an element, in its order."""
        for element in parent.children:
            if self._is_wanted(element, scope):
                self._take(element, scope)

    def _take(self, element: Element, scope: _Scope) -> None:
        a = element.attributes
        if element.tag == "arg" and "name" in a:
            text = a.get("value", a.get("default"))
            scope.args[a["name"]] = None if text is None else _filled(text, scope)
        elif element.tag == "group":
            self.read(element, scope.inner(_filled(a.get("ns", ""), scope) or ""))
        elif element.tag == "node":
            self._node(element, scope)
        elif element.tag == "param":
            self._param(element, scope)
        elif element.tag == "rosparam":
            self._rosparam(element, scope)
        elif element.tag == "remap":
            self._remap(element, scope)
        elif element.tag == "include":
            self.includes.append(clean(a.get("file", ""), 80))

    def _node(self, element: Element, scope: _Scope) -> None:
        a = {key: _filled(text, scope) or "" for key, text in element.attributes.items()}
        if a.get("pkg") in _ROS2:
            raise UsageError(f"{self.name}: a launch file of ROS 2, line {element.line}; name the YAML that it loads")
        inner = scope.inner(a.get("ns", ""))
        self.types.append(a.get("type", ""))
        full = f"{inner.namespace}/{a.get('name') or 'amcl'}"
        if _is_amcl(a):
            private = _Scope(full, inner.args, inner.remapped)
            self.read(element, private)
            self.nodes[full] = private.remapped

    def _param(self, element: Element, scope: _Scope) -> None:
        a = element.attributes
        key = self._full(a.get("name", ""), scope)
        text = None if "value" not in a else _filled(a["value"], scope)
        if text is None:
            source = next((a[k] for k in ("value", "textfile", "binfile", "command") if k in a), "")
            self._miss(key, f"{clean(a.get('name', ''), 60)} = {clean(source, 60)}", element)
            return
        value = _typed(text, a.get("type", "auto"), f"{self.name}, line {element.line}")
        self.given[key] = Given(value, element.line, key in self.given)

    def _rosparam(self, element: Element, scope: _Scope) -> None:
        a = element.attributes
        if a.get("command", "load") != "load":
            return
        inner = scope.inner(_filled(a.get("ns", ""), scope) or "")
        if "file" in a:
            self._miss(inner.namespace, f"the file {clean(a['file'], 80)}", element)
            return
        wants = a.get("subst_value", "").lower() in {"true", "1"}
        text = _filled(element.text, scope) if wants else element.text
        if text is None:
            self._miss(inner.namespace, "a substitution", element)
            return
        if not text.strip():
            return
        try:
            value = safe_yaml.parse(text.encode(), self.name, LIMITS).value
        except InputError as error:
            raise InputError(f"{error} (within <rosparam>, line {element.line} of the file)") from None
        self._spread(value, self._full(a["param"], inner) if "param" in a else inner.namespace, element.line)

    def _spread(self, value: object, name: str, line: int) -> None:
        if isinstance(value, dict):
            for key, below in value.items():
                self._spread(below, f"{name}/{key}", line)
        else:
            self.given[name] = Given(value, line, name in self.given)

    def _remap(self, element: Element, scope: _Scope) -> None:
        a = element.attributes
        key = _REMAPPED.get(a.get("from", "").lstrip("/"))
        to = _filled(a.get("to", ""), scope)
        if key and to:
            scope.remapped[key] = Given(to, element.line)

    def _full(self, name: str, scope: _Scope) -> str:
        return name if name.startswith("/") else f"{scope.namespace}/{name.removeprefix('~')}"

    def _miss(self, target: str, what: str, element: Element) -> None:
        self.problems.append((target, f"{what}, line {element.line}"))

    def _is_wanted(self, element: Element, scope: _Scope) -> bool:
        """Whether ``if`` and ``unless`` let an element count; those that cannot be told do not, and are told."""
        for key in ("if", "unless"):
            if key in element.attributes:
                word = (_filled(element.attributes[key], scope) or "").lower()
                if word not in {"true", "1", "false", "0"}:
                    if element.tag not in {"node", "group"}:
                        self._miss(scope.namespace or "/", f"{key}={clean(element.attributes[key], 60)}", element)
                    elif _holds_amcl(element):
                        self._miss("", f"{key}={clean(element.attributes[key], 60)}", element)
                    return False
                if (word in {"true", "1"}) != (key == "if"):
                    return False
        return True


def _holds_amcl(element: Element) -> bool:
    return _is_amcl(element.attributes) or any(_holds_amcl(child) for child in element.children)


def _is_amcl(attributes: Mapping[str, str]) -> bool:
    return attributes.get("type") == "amcl"  # the package has other programs, and others have copies of amcl


def _filled(text: str, scope: _Scope) -> str | None:
    """Text with its arguments put in, None if one has no value, or if it needs more of roslaunch than that."""
    if "$(" not in text:
        return text
    parts, at, size = [], 0, 0
    for match in _ARG.finditer(text):
        value = scope.args.get(match[1])
        if value is None:
            return None
        parts += [text[at : match.start()], value]
        at, size = match.end(), size + len(value)
        if size > _MOST:
            return None
    filled = "".join([*parts, text[at:]])
    return None if "$(" in filled else filled


def _typed(text: str, kind: str, where: str) -> object:
    """A value as roslaunch makes it of a text: with a point a real number, else a whole one, true or false, or text."""
    if kind in {"str", "string"}:
        return text
    if kind == "yaml":
        return safe_yaml.parse(text.encode(), where, LIMITS).value
    word = text.strip().lower()
    if kind in {"auto", "bool", "boolean"} and word in {"true", "false"}:
        return word == "true"
    try:
        return float(text) if "." in text or kind == "double" else int(text)
    except ValueError:
        return text
