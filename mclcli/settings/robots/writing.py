"""Settings as a parameter file for nav2: what nav2_amcl has goes to its block, the rest to one that only mcl reads."""

from __future__ import annotations

import re
from statistics import NormalDist
from typing import TYPE_CHECKING

from mclcli.io.tables.params_yaml import Given
from mclcli.io.tables.yaml_text import scalar
from mclcli.motion import MOTION_PLUGINS
from mclcli.settings import profiles
from mclcli.settings.robots import names
from mclcli.settings.robots.blocks import NODE, OWN, NodeParameters
from mclcli.settings.robots.reading import from_node

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.settings.profiles import Settings
    from mclcli.settings.robots.names import Name, Value
    from mclcli.settings.robots.reading import FileParameters

_HEAD = f"# For nav2_amcl; no node reads the block '{OWN}': it holds what only mcl has."
# YAML 1.1, which nav2's launch files read with, knows a number with an exponent by its point alone.
_NO_POINT = re.compile(r"(-?\d+)(e.*)?")


def to_nav2(settings: Settings, file: FileParameters | None = None) -> str:
    """YAML that nav2 accepts and that reads back, with ``--params``, to the same settings.

    What nav2_amcl was given in the ``file`` that the settings come from, and has no part in a replay, stays.
    """
    kept = {} if file is None else {key: value for key, value in file.as_read.items() if _is_navs(key)}
    amcl = {**kept, **_expressed(settings)}
    namespace = "" if file is None else file.namespace.strip("/")
    lines = [_HEAD, *_block([*namespace.split("/"), NODE] if namespace else [NODE], amcl)]
    if own := _own(settings, amcl):
        lines += _block([OWN], own)
    return "\n".join(lines) + "\n"


def _is_navs(name: str) -> bool:
    return names.NAMES[name].nav2 is not None


def _expressed(settings: Settings) -> dict[str, Value]:
    """Every parameter of nav2_amcl, for this lidar model, that the settings have a value for which it can take."""
    values = settings.values()
    known = settings.model in names.NAMES["laser_model_type"].words
    expressed: dict[str, Value] = {"laser_model_type": settings.model} if known else {}
    for row in names.TABLE:
        if row.nav2 is not None and row.becomes in values and (not row.models or settings.model in row.models):
            value = _in_navs_words(row, values)
            if value is not None:
                expressed[row.name] = value
    return expressed


def _in_navs_words(row: Name, values: Mapping[str, Value]) -> Value | None:
    value = values[row.becomes]
    if row.name == "robot_model_type":
        return MOTION_PLUGINS.get(str(value))
    if row.name == "pf_z" and values["kld_quantile"] == "probability":
        quantile = NormalDist().inv_cdf(float(value))
        return quantile if quantile > 0.0 else None
    if row.name.startswith("recovery_alpha") and values["recovery"] == "off":
        return 0.0  # nav2_amcl has no other switch
    if row.kind is str:
        return value or None
    return None if row.low is not None and float(value) < row.low else value


def _own(settings: Settings, amcl: Mapping[str, Value]) -> dict[str, Value]:
    """What has to go with the block for nav2_amcl so that the settings come back: found by reading that block."""
    node = NodeParameters(f"/{NODE}", {name: Given(value, 0) for name, value in amcl.items()}, frozenset(amcl))
    back = from_node("", node, {}, model=settings.model)
    own: dict[str, Value] = {} if back.profile == settings.profile else {"profile": settings.profile}
    if "laser_model_type" not in amcl:
        own["model"] = settings.model  # nav2_amcl does not have it
    read = profiles.build(back.values, profile=settings.profile, model=settings.model).values()
    return own | {name: value for name, value in settings.values().items() if read[name] != value}


def _block(path: list[str], values: Mapping[str, Value]) -> list[str]:
    lines = [f"{'  ' * depth}{key}:" for depth, key in enumerate([*path, "ros__parameters"])]
    indent = "  " * (len(path) + 1)
    return lines + [f"{indent}{name}: {_navs_scalar(value)}" for name, value in values.items()]


def _navs_scalar(value: Value) -> str:
    """A value that libyaml, PyYAML and rcl all take for its type."""
    if isinstance(value, str):
        return scalar(value) if scalar(value).startswith('"') else f'"{value}"'
    text = scalar(value)
    whole = _NO_POINT.fullmatch(text) if isinstance(value, float) else None
    return f"{whole[1]}.0{whole[2] or ''}" if whole else text
