"""Which blocks of a ROS parameter file are for amcl, and which for mcl."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, final

from mclcli.errors import UsageError
from mclcli.io.tables.params_yaml import listed
from mclcli.settings.robots import names, others, unknown
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.io.tables.params_yaml import Block, Given, ParameterFile

NODE = "amcl"
OWN = "mcl"  # a block of this name goes with nav2's file; no ROS node reads it
_PATTERNS = {"*", "**"}
# Names that nodes of many kinds have: such a name alone does not make a block for all nodes one for amcl.
_COMMON = {"scan_topic", "map_topic", "point_cloud_topic", "tf_broadcast", "transform_tolerance", "first_map_only"} | {
    "base_frame_id",
    "odom_frame_id",
    "global_frame_id",
    "debug",
    "autostart",
    "autostart_delay",
    "bond_timeout",
    "random_seed",
    "initial_pose_topic",
    "execution_policy",
    "laser_min_range",
    "laser_max_range",
    "allow_parameter_qos_overrides",
}
_TELLING = set(names.NAMES) - _COMMON


@final
@dataclass(frozen=True, slots=True)
class NodeParameters:
    """Parameters of one node: its full ``name``, what it is given, and which of it is surely meant for it.

    Other names may come from a block for several nodes, and be for another one: ``foreign`` are those that amcl does
    not have, ``idle`` those without a part in a replay that ``values`` do not hold. ``labels`` are the names in the
    file where they differ. ``warnings`` are lines for the user. ``dialect`` is whose names these are, empty if the
    names have to tell; ``implied`` are parameters of mcl that it brings.
    """

    name: str
    values: dict[str, Given]
    certain: frozenset[str]
    foreign: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    dialect: str = ""
    implied: Mapping[str, names.Value] = field(default_factory=dict)

    def label(self, key: str) -> str:
        """What the file calls a parameter."""
        return self.labels.get(key, key)

    def warned(self, line: str) -> NodeParameters:
        """The same with another line for the user."""
        return replace(self, warnings=(*self.warnings, line))


def parameters_of_amcl(file: ParameterFile, *, lenient: bool = False) -> NodeParameters:
    """Parameters that amcl would be given: of all blocks that name it, later ones override earlier, as in rclcpp.

    Raises
    ------
    UsageError
        If no block is for amcl, or it is for another localizer; if the file has several amcl that differ; unless
        ``lenient``, if there are unknown parameters.

    """
    nodes = _nodes(file)
    found = [_parameters(file, node) for node in nodes]
    _refuse_others(file, found)
    if not found:
        held = listed(_others(file))
        raise UsageError(f"{file.name}: no block for {NODE}; it holds {held}; name the file with {NODE}'s")
    if any(_plain(other) != _plain(found[0]) for other in found[1:]):
        raise UsageError(
            f"{file.name}: {NODE} stands there for several robots, differently: {', '.join(nodes)}; "
            "write the one robot's block to a file of its own"
        )
    return _settled(file, found[0], lenient=lenient)


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
    return [f"/{NODE}"] if everyones & _TELLING else []


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
    return NodeParameters(node, values, frozenset(certain or values))


def _settled(file: ParameterFile, node: NodeParameters, *, lenient: bool) -> NodeParameters:
    """Parameters of amcl with what is to be said of the names that it does not have.

    In a block for all nodes such a name may be another node's, if the file is for others as well.
    """
    strange = {k: v for k, v in node.values.items() if k not in names.NAMES and not names.is_of_any_node(k)}
    named = {name for block in file.blocks if block.leaf == NODE for name in block.values}
    alone = all(block.leaf in {OWN, *_PATTERNS} for block in file.blocks)
    ours = {k: v for k, v in strange.items() if alone or k in named}
    near = {k: v for k, v in strange.items() if k not in ours and unknown.is_near(k)}
    warnings = unknown.settle(
        file.name, "neither nav2_amcl nor Beluga has", ours, unknown.hint_of_nav2, lenient=lenient
    )
    if near:
        warnings += (f"{file.name}: not {NODE}'s, given to all nodes: {unknown.told(near, unknown.hint_of_nav2)}",)
    return replace(node, foreign=tuple(k for k in strange if k not in ours and k not in near), warnings=warnings)


def _refuse_others(file: ParameterFile, found: list[NodeParameters]) -> None:
    leaves = {block.leaf for block in file.blocks}
    ours = {NODE} if NODE in leaves else _PATTERNS
    given = {name for block in file.blocks if block.leaf in ours for name in block.values}
    if whose := others.localizer(given, set() if found else leaves):
        raise UsageError(
            f"{file.name}: parameters of {whose}, which mcl does not read; name a file of nav2_amcl or of Beluga's "
            f"{NODE}, or write mcl's own"
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
