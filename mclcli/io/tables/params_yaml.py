"""Parameters as YAML: mcl's own, which is plain names and values, and ROS 2's, which has a block per node."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

from mclcli.errors import UsageError
from mclcli.io.tables import safe_yaml
from mclcli.io.tables.yaml_text import scalar
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    Keys = tuple[str, ...]

# Whole robots are described in such files. ROS takes the last of two equal keys, and other nodes' blocks are not ours.
LIMITS = safe_yaml.Limits(size=1024 * 1024, depth=24, repeats=True)
_BLOCK = "ros__parameters"


@final
@dataclass(frozen=True, slots=True)
class Given:
    """A value as the file has it, and its line; ``twice`` if the key stood there before."""

    value: Any
    line: int
    twice: bool = False


@final
@dataclass(frozen=True, slots=True)
class Block:
    """Parameters of the nodes that a pattern like ``/robot1/amcl`` or ``/**`` names; nested names joined by dots.

    ``line`` is where it begins; ``torn`` says that a key that leads to it stands there twice, so that part is lost.
    """

    node: str
    values: dict[str, Given]
    line: int = 1
    torn: bool = False

    @property
    def leaf(self) -> str:
        """Last part of the node's name."""
        return self.node.rpartition("/")[2]

    def matches(self, node: str) -> bool:
        r"""Whether a node's full name fits: ``*`` is one part of a name, ``**`` any number, as in rclcpp."""
        parts = re.escape(self.node).replace(r"/\*\*", r"(/\w+)*").replace(r"/\*", r"/\w+")
        return re.fullmatch(parts, node) is not None


@final
@dataclass(frozen=True, slots=True)
class ParameterFile:
    """What a file of parameters holds: ``own`` names and values in mcl's dialect, or ``blocks`` in ROS 2's.

    ``plain`` are the mappings of a file that is nested without being ROS 2's, as ``rosparam`` takes it.
    """

    name: str
    own: dict[str, Given]
    blocks: tuple[Block, ...] = ()
    plain: tuple[Block, ...] = ()

    def refuse_plain(self) -> None:
        """Raise UsageError if the file is nested without being ROS 2's."""
        if nested := [block.node.strip("/") for block in self.plain if block.node != "/"]:
            raise UsageError(
                f"{self.name}: no block '{_BLOCK}' below {listed(nested)}; in a ROS file parameters stand below "
                f"NODE: {_BLOCK}:, in mcl's own as NAME: VALUE lines"
            )


def parse_params(data: bytes, name: str) -> ParameterFile:
    """Parameters of YAML in any dialect; ``name`` is the file's.

    Raises
    ------
    UsageError
        If there is no such file, or it is no mapping of names.
    InputError
        If it is not YAML that can be read.

    """
    document = safe_yaml.parse(data, name, LIMITS)
    values = document.value
    if not isinstance(values, dict) or not values:
        raise UsageError(f"{name}: not a mapping of parameter names to values; `mcl params` prints one to start from")
    blocks = tuple(_blocks(values, (), document))
    if blocks:
        return ParameterFile(name, {}, blocks)
    if any(isinstance(value, dict) for value in values.values()):
        return ParameterFile(name, {}, plain=tuple(_mappings(values, (), document)))
    return ParameterFile(name, _own(values, document))


def _own(values: dict[str, Any], document: safe_yaml.Document) -> dict[str, Given]:
    _refuse_repeats(document)
    for name, value in values.items():
        if not isinstance(value, int | float | str):
            raise UsageError(
                f"{document.name}: '{clean(name, 40)}' is not a number or a word, line {document.line(name)}; "
                "write NAME: VALUE lines as `mcl params` does"
            )
    return {name: Given(value, document.line(name)) for name, value in values.items()}


def _blocks(values: dict[str, Any], path: Keys, document: safe_yaml.Document) -> Iterator[Block]:
    """Every block below a mapping, in the file's order."""
    for key, value in values.items():
        if key == _BLOCK and isinstance(value, dict):
            here = (*path, key)
            torn = any(here[:depth] in document.repeated for depth in range(1, len(here) + 1))
            yield Block(_node(path), dict(_flat(value, here, (), document)), document.line(*here), torn)
        elif isinstance(value, dict):
            yield from _blocks(value, (*path, key), document)


def _mappings(values: dict[str, Any], path: Keys, document: safe_yaml.Document) -> Iterator[Block]:
    """Every mapping of a file with what stands in it, but for mappings below."""
    plain = {key: value for key, value in values.items() if not isinstance(value, dict)}
    given = {
        key: Given(value, document.line(*path, key), (*path, key) in document.repeated) for key, value in plain.items()
    }
    if given or path:
        yield Block(_node(path), given, document.line(*path))
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _mappings(value, (*path, key), document)


def _node(path: Keys) -> str:
    return "/" + "/".join(part for key in path for part in key.split("/") if part)


def _flat(values: dict[str, Any], at: Keys, name: Keys, document: safe_yaml.Document) -> Iterator[tuple[str, Given]]:
    for key, value in values.items():
        here = (*name, key)
        if isinstance(value, dict):
            yield from _flat(value, at, here, document)
        else:
            yield ".".join(here), Given(value, document.line(*at, *here), (*at, *here) in document.repeated)


def _refuse_repeats(document: safe_yaml.Document) -> None:
    for path in sorted(document.repeated, key=document.lines.__getitem__):
        raise UsageError(
            f"{document.name}: key '{clean(str(path[-1]), 40)}' stands there twice, line {document.line(*path)}; "
            "write it once"
        )


def listed(names: list[str], most: int = 12) -> str:
    """The first few names from a file, for messages."""
    shown = ", ".join(clean(name, 60) for name in names[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"


def format_params(values: Mapping[str, float | str], comments: Mapping[str, str] | None = None) -> str:
    """YAML mapping, a line per parameter, each with its comment."""
    lines = []
    for name, value in values.items():
        text = f"{name}: {scalar(value)}"
        comment = (comments or {}).get(name, "")
        lines.append(f"{text:<40} # {comment}" if comment else text)
    return "\n".join(lines) + "\n"
