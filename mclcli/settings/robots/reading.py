"""What a file of parameters says to mcl, in any dialect: mcl's own, nav2_amcl's or that of Beluga's amcl."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, final

from mclcli.errors import UsageError, nearest_name
from mclcli.io.tables import launch_xml
from mclcli.io.tables.params_yaml import LIMITS, parse_params
from mclcli.io.tables.text_file import read_bytes
from mclcli.settings import profiles
from mclcli.settings.robots import names, others, unknown
from mclcli.settings.robots.blocks import NodeParameters, own_values, parameters_of_amcl
from mclcli.settings.robots.ros1_files import node_of_launch, node_of_yaml
from mclcli.settings.robots.start import differences, initial_pose, notes
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from mclcli.io.tables.params_yaml import Given
    from mclcli.settings import Profile
    from mclcli.settings.robots.names import Name
    from mclcli.settings.robots.start import InitialPose

DEFAULT_MODEL = "likelihood_field"  # as in nav2_amcl and Beluga
PROFILES: dict[str, Profile] = {"nav2_amcl": "nav2", "Beluga": "beluga", names.ROS1: "nav2"}
_TENTATIVE = ("base_frame_id", "odom_frame_id", "scan_topic", "map_topic")


@final
@dataclass(frozen=True, slots=True)
class FileParameters:
    """What a file says.

    ``dialect`` is ``mcl``, ``nav2_amcl`` or ``Beluga``. ``profile`` and ``model`` are those it asks for, None if it
    does not. ``values`` are mcl's parameters by name. ``tentative`` name those of them that count only where the
    log has such a frame or topic; ``namespace`` is where the robot's topics are. ``as_read`` are the node's
    parameters by their own names. ``remarks`` and ``warnings`` are lines for the user.
    """

    name: str
    dialect: str
    profile: Profile | None
    model: str | None
    values: dict[str, names.Value]
    tentative: frozenset[str] = frozenset()
    namespace: str = ""
    start: InitialPose | None = None
    as_read: dict[str, names.Value] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def load(
    path: str | Path, *, profile: Profile | None = None, model: str | None = None, lenient: bool = False
) -> FileParameters:
    """Read a file of parameters; ``profile`` and ``model`` are what the user wants whatever the file says.

    With ``lenient`` unknown names are passed over, as on the robot, with a warning.

    Raises
    ------
    UsageError
        Naming file, parameter and line, for all unknown names (with the nearest) or a value that does not fit; if a
        ROS file has no block for amcl, or several that differ.
    InputError
        If the file cannot be read.

    """
    data, name = read_bytes(path, LIMITS.size), str(path)
    if launch_xml.looks_like_xml(data):
        return from_node(name, node_of_launch(data, name, lenient=lenient), {}, profile=profile, model=model)
    file = parse_params(data, name)
    if file.blocks:
        node, own = parameters_of_amcl(file, lenient=lenient), own_values(file)
        return from_node(name, node, own, profile=profile, model=model, lenient=lenient)
    ros1 = node_of_yaml(file, lenient=lenient)
    if ros1 is not None:
        return from_node(name, ros1, {}, profile=profile, model=model)
    file.refuse_plain()
    return _of_mcl(name, file.own, model, lenient=lenient)


def load_settings(
    path: str | Path,
    values: Mapping[str, object] | None = None,
    *,
    profile: Profile | None = None,
    model: str | None = None,
    lenient: bool = False,
) -> profiles.Settings:
    """Settings of a file of parameters, mcl's or a robot's, with ``values`` that override those of the file.

    With ``lenient``, names that the robot's node does not have are passed over.

    Raises
    ------
    UsageError
        If there is no such file, or it has an unknown parameter or a value that is not allowed.
    InputError
        If it is not a file of parameters.

    """
    file = load(path, profile=profile, model=model, lenient=lenient)
    return settings_of(file, values or {}, profile=profile, model=model)


def settings_of(
    file: FileParameters,
    values: Mapping[str, object],
    *,
    base: Mapping[str, object] = MappingProxyType({}),
    profile: Profile | None = None,
    model: str | None = None,
) -> profiles.Settings:
    """Settings with ``values`` over those of a file over ``base``.

    Raises
    ------
    UsageError
        If values do not go together; it names the file if it is to blame.

    """
    build = partial(
        profiles.build,
        profile=profile or file.profile or "textbook",
        model=model or file.model or DEFAULT_MODEL,
    )
    given = profiles.spelled_out(values)
    try:
        return build({**base, **profiles.spelled_out(file.values), **given})
    except UsageError as error:
        build({**base, **given})  # what is wrong without the file is not the file's fault
        raise UsageError(f"{file.name}: {error}") from None


def from_node(
    name: str,
    node: NodeParameters,
    own: Mapping[str, Given],
    *,
    profile: Profile | None = None,
    model: str | None = None,
    lenient: bool = False,
) -> FileParameters:
    """Parameters of a node as mcl's; ``own`` are those of the file's block for mcl, which override them."""
    extra = _of_mcl(name, own, model, lenient=lenient)
    as_read = {
        key: _read(name, node.label(key), names.NAMES[key], given)
        for key, given in node.values.items()
        if key in names.NAMES
    }
    belugas = any(names.is_belugas(key, as_read.get(key)) for key in node.certain)
    dialect = node.dialect or ("Beluga" if belugas else "nav2_amcl")
    chosen = model or extra.model or str(as_read.get("laser_model_type", DEFAULT_MODEL))
    values, idle = _translated(as_read, dialect, chosen)
    values |= node.implied
    for key, value in values.items():
        _check(name, key, value, node.values.get(key), chosen)
    said, warned = notes(name, dialect, node, as_read, idle)
    profile_found = extra.profile or PROFILES[dialect]
    chose = f"parameters of {dialect}, node {node.name}: profile {profile or profile_found}, model {chosen}"
    return FileParameters(
        name=name,
        dialect=dialect,
        profile=profile_found,
        model=chosen,
        values={**values, **extra.values},
        tentative=frozenset(key for key in _TENTATIVE if key in values and key not in extra.values),
        namespace=node.name.rpartition("/")[0],
        start=initial_pose(name, dialect, as_read),
        as_read=as_read,
        remarks=(f"{name}: {chose}", *said, *differences(name, dialect, values)),
        warnings=(*warned, *extra.warnings),
    )


def _of_mcl(name: str, own: Mapping[str, Given], model: str | None, *, lenient: bool = False) -> FileParameters:
    """Parameters in mcl's own names, with ``profile`` and ``model`` among them."""
    known = ["profile", "model", "particles", *(key for _, key, _, _ in profiles.table())]
    strange = {key: given for key, given in own.items() if key not in known}
    if whose := others.localizer(strange):
        raise UsageError(f"{name}: parameters of {whose}, which mcl does not read; `mcl params` prints mcl's own")
    warnings = unknown.settle(name, "mcl has no parameter", strange, unknown.hint_of(known), lenient=lenient)
    values = {key: given.value for key, given in own.items() if key in known}
    words = {"profile": tuple(profiles.PROFILES), "model": tuple(profiles.MODELS)}
    chosen = {key: str(values.pop(key)) for key in words if key in values}
    for key, word in chosen.items():
        if word not in words[key]:
            raise UsageError(
                f"{name}: {key} = {clean(word, 40)}, line {own[key].line}: must be one of {', '.join(words[key])}"
                f"{nearest_name(word, list(words[key]))}"
            )
    for key, value in values.items():
        _check(name, key, value, own[key], model or chosen.get("model", DEFAULT_MODEL))
    profile = next((known for known in profiles.PROFILES if known == chosen.get("profile")), None)
    return FileParameters(name, "mcl", profile, chosen.get("model"), values, warnings=warnings)


def _check(name: str, key: str, value: object, given: Given | None, model: str) -> None:
    """Check one value alone, and say in which line it stands."""
    try:
        profiles.check(key, value, model)
    except UsageError as error:
        what, _, remedy = str(error).partition("; ")
        place = f", line {given.line}" if given is not None else ""
        raise UsageError(f"{name}: {what}{place}; {remedy}") from None


def _translated(
    as_read: Mapping[str, names.Value], dialect: str, model: str
) -> tuple[dict[str, names.Value], dict[str, str]]:
    """mcl's parameters, and what has no part, with the reason."""
    values: dict[str, names.Value] = {}
    idle: dict[str, str] = {}
    for key, value in as_read.items():
        row = names.NAMES[key]
        if reason := _idle(row, dialect, model):
            idle[key] = reason
        elif row.becomes in {names.MODEL, names.START}:
            continue
        elif value != "" or row.words:
            values[row.becomes] = row.words.get(value, value)
    if "pf_z" in values:
        values["kld_quantile"] = "z"
    if float(values.get("recovery_alpha_slow", 0.0)) > 0.0:
        values["recovery"] = "uniform"  # there the rates are the only switch
    return values, idle


def _idle(row: Name, dialect: str, model: str) -> str:
    """Why a parameter has no part, empty if it has one."""
    if dialect != names.ROS1 and (row.beluga if dialect == "Beluga" else row.nav2) is None:
        return f"unknown to {dialect}"
    if row.models and model not in row.models:
        return f"not of model {model}"
    return "no part in a replay" if row.becomes == names.NOTHING else ""


def _read(name: str, key: str, row: Name, given: Given) -> names.Value:
    """Value of a node's parameter, of the type it has there; whole numbers stand for real ones.

    Raises
    ------
    UsageError
        If it is of another type, or none of the words that exist.

    """
    value = given.value
    expected = {bool: "true or false", int: "a whole number", float: "a number (units are mcl's own dialect)"}
    read = _typed(row.kind, value)
    if read is None:
        wanted = expected.get(row.kind, "a word")
        raise UsageError(
            f"{name}: {key} = {clean(repr(value), 60)}, line {given.line}: must be {wanted}; correct the file"
        )
    if row.low is not None and isinstance(read, int | float) and read < row.low:
        raise UsageError(f"{name}: {key} = {read}, line {given.line}: must be at least {row.low:g}, on the robot too")
    if row.words and read not in row.words:
        words = [str(word) for word in row.words]
        hint = nearest_name(str(read), words) or f"; it is one of {', '.join(words)}"
        raise UsageError(f"{name}: {key} = '{clean(str(read), 60)}', line {given.line}: not known{hint}")
    return read


_BOOLEANS = {
    **dict.fromkeys(("true", "yes", "y", "on", "1"), True),
    **dict.fromkeys(("false", "no", "n", "off", "0"), False),
}


def _typed(kind: type[names.Value], value: object) -> names.Value | None:
    if kind is bool:
        return _BOOLEANS.get(str(value).lower()) if isinstance(value, bool | int | str) else None
    if kind is str:
        return value if isinstance(value, str) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if kind is float:
        return float(value)
    return value if isinstance(value, int) else None
