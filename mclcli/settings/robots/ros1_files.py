"""Files with parameters of ROS 1's amcl: flat or nested YAML as rosparam takes it, and roslaunch files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.errors import UsageError, nearest_name
from mclcli.settings import profiles
from mclcli.settings.robots import launch, names, others, ros1, unknown
from mclcli.settings.robots.blocks import NODE, NodeParameters
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.io.tables.params_yaml import Given, ParameterFile
    from mclcli.settings.robots.names import Value

_GENERIC = ("use_sim_time",)


def node_of_yaml(file: ParameterFile, *, lenient: bool = False) -> NodeParameters | None:
    """Parameters of ROS 1's amcl in a YAML file without blocks, None if it holds none.

    Raises
    ------
    UsageError
        If there are several amcl; unless ``lenient``, if there are unknown parameters.

    """
    own = {name for _, name, _, _ in profiles.table()}
    given = {"/": file.own} | {block.node: block.values for block in file.plain}
    of_ros1 = {node for node, values in given.items() if ros1.is_ros1(values, own)}
    found = {n: v for n, v in given.items() if of_ros1 and v and (n in of_ros1 or n.endswith(f"/{NODE}"))}
    if whose := others.localizer({name for values in found.values() for name in values}):
        raise UsageError(f"{file.name}: parameters of {whose}, which mcl does not read; name a file of ROS 1's {NODE}")
    return _only(file.name, found, lenient=lenient)


def node_of_launch(data: bytes, name: str, *, lenient: bool = False) -> NodeParameters:
    """Parameters of the amcl that a roslaunch file starts.

    Raises
    ------
    UsageError
        If the file starts none, or several that differ; unless ``lenient``, if there are unknown parameters or values
        that only roslaunch can find.
    InputError
        If it is no XML, or has what no launch file needs (a document type, entities).

    """
    launched = launch.parameters_of_amcl(data, name)
    vital = [text for key, text in launched.problems if not ros1.is_found_elsewhere(key)]
    said = ", ".join(text for _, text in launched.problems)
    if vital and not lenient:
        raise UsageError(
            f"{name}: only roslaunch can find {', '.join(vital)}; write it out, or read the rest: --lenient"
        )
    nodes = launched.nodes
    if any(key in ros1.POSE for key, _ in launched.problems):  # half a pose is none
        nodes = {node: {k: v for k, v in values.items() if k not in ros1.POSE} for node, values in nodes.items()}
    node = _only(name, nodes, lenient=lenient)
    if node is None:
        raise UsageError(f"{name}: whether it starts amcl, only roslaunch can find: {said}; write it out")
    return node.warned(f"{name}: not read, only roslaunch can find {said}") if said else node


def _only(file: str, found: Mapping[str, dict[str, Given]], *, lenient: bool) -> NodeParameters | None:
    if not found:
        return None
    plain = [{key: given.value for key, given in values.items()} for values in found.values()]
    if any(one != plain[0] for one in plain[1:]):
        raise UsageError(
            f"{file}: {NODE} stands there for several robots, differently: {', '.join(clean(n, 60) for n in found)}; "
            "write the one robot's parameters to a file of their own"
        )
    node, values = next(iter(found.items()))
    return _as_nodes(file, f"/{NODE}" if node == "/" else node, values, lenient=lenient)


def _as_nodes(file: str, node: str, values: dict[str, Given], *, lenient: bool) -> NodeParameters:
    """Parameters by nav2's names, as the rest of the package takes them."""
    strange = {k: v for k, v in values.items() if k not in ros1.KNOWN and k not in _GENERIC}
    warnings = unknown.settle(file, "ROS 1's amcl does not have", strange, unknown.hint_of_ros1, lenient=lenient)
    found, labels = ros1.in_navs_names(values)
    implied: dict[str, Value] = {}
    if (motion := found["robot_model_type"]).value not in ros1.MOTIONS:
        word, words = clean(str(motion.value), 60), list(ros1.MOTIONS)
        hint = nearest_name(word, words) or f"; it is one of {', '.join(words)}"
        raise UsageError(f"{file}: odom_model_type = '{word}', line {motion.line}: not known{hint}")
    model, implied["noise_expression"] = ros1.MOTIONS[motion.value]
    found["robot_model_type"] = ros1.instead(motion, model)
    idle = tuple(k for k in values if k in _GENERIC or (k in ros1.ROWS and not ros1.ROWS[k].nav2))
    return NodeParameters(
        node,
        found,
        frozenset(found),
        idle=idle,
        labels=labels,
        warnings=warnings,
        dialect=names.ROS1,
        implied=implied,
    )
