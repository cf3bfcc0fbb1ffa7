"""Which blocks of a ROS parameter file are for amcl, and which for mcl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.errors import UsageError, nearest_name
from mclcli.io.tables.params_yaml import listed
from mclcli.settings.robots import names
from mclcli.text import clean

if TYPE_CHECKING:
    from mclcli.io.tables.params_yaml import Block, Given, ParameterFile

NODE = "amcl"
OWN = "mcl"  # a block of this name goes with nav2's file; no ROS node reads it
_PATTERNS = {"*", "**"}


@final
@dataclass(frozen=True, slots=True)
class NodeParameters:
    """Parameters of one node: its full ``name``, what it is given, and which of it is surely meant for it.

    Other names may come from a block for several nodes, and be for another one.
    """

    name: str
    values: dict[str, Given]
    certain: frozenset[str]


def parameters_of_amcl(file: ParameterFile) -> NodeParameters:
    """Parameters that amcl would be given: of all blocks that name it, later ones override earlier, as in rclcpp.

    Raises
    ------
    UsageError
        If no block is for amcl, if the file has several amcl that differ, or a parameter of its block is unknown.

    """
    nodes = _nodes(file)
    found = [_parameters(file, node) for node in nodes]
    if not found:
        held = listed(_others(file))
        raise UsageError(f"{file.name}: no block for {NODE}; it holds {held}; name the file with {NODE}'s")
    if any(_plain(other) != _plain(found[0]) for other in found[1:]):
        raise UsageError(
            f"{file.name}: {NODE} stands there for several robots, differently: {', '.join(nodes)}; "
            "write the one robot's block to a file of its own"
        )
    return found[0]


def own_values(file: ParameterFile) -> dict[str, Given]:
    """Parameters of the file's block for mcl itself, by mcl's names."""
    return {name: given for block in file.blocks if block.leaf == OWN for name, given in block.values.items()}


def _nodes(file: ParameterFile) -> list[str]:
    """Full names of the nodes called amcl; with patterns alone, the simplest name that fits."""
    named = list(dict.fromkeys(block.node for block in file.blocks if block.leaf == NODE))
    exact = [node for node in named if "*" not in node]
    if exact:
        return exact
    if named:
        return [f"/{NODE}"] if any(block.matches(f"/{NODE}") for block in file.blocks) else [f"/robot/{NODE}"]
    everyones = {name for block in file.blocks if block.leaf in _PATTERNS for name in block.values}
    return [f"/{NODE}"] if everyones & set(names.NAMES) else []


def _parameters(file: ParameterFile, node: str) -> NodeParameters:
    values: dict[str, Given] = {}
    certain: set[str] = set()
    for block in file.blocks:
        if not block.matches(node):
            continue
        _refuse_torn(file.name, block)
        values.update(block.values)
        if block.leaf == NODE:
            certain |= set(block.values)
            _refuse_unknown(file.name, block)
    return NodeParameters(node, values, frozenset(certain or values))


def _refuse_unknown(name: str, block: Block) -> None:
    for key, given in block.values.items():
        if key not in names.NAMES and not names.is_of_any_node(key):
            hint = nearest_name(key, [*names.NAMES, *names.OF_ANY_NODE]) or "; delete it"
            raise UsageError(
                f"{name}: neither nav2_amcl nor Beluga has a parameter '{clean(key, 60)}', line {given.line}{hint}"
            )


def _refuse_torn(name: str, block: Block) -> None:
    if block.torn:
        raise UsageError(
            f"{name}: the block of {clean(block.node, 60)}, line {block.line}, stands there twice; join the two"
        )


def _plain(node: NodeParameters) -> dict[str, object]:
    return {name: given.value for name, given in node.values.items()}


def _others(file: ParameterFile) -> list[str]:
    return list(dict.fromkeys(block.node.lstrip("/") or "/" for block in file.blocks))
