"""Where a robot's file lets the filter start, and what there is to say about the rest of it."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import UsageError
from mclcli.quantity import looks_like_degrees
from mclcli.settings.robots import names
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mclcli.arrays import FloatArray
    from mclcli.settings.robots.blocks import NodeParameters

    Values = Mapping[str, names.Value]

_SAME = 1e-3  # relative: 0.1745 stands for 10°


@final
@dataclass(frozen=True, slots=True, eq=False)
class InitialPose:
    """Pose (3,) x, y [m], yaw [rad] in map, and its covariance (3, 3)."""

    pose: FloatArray
    covariance: FloatArray


def initial_pose(name: str, dialect: str, as_read: Values) -> InitialPose | None:
    """The start that a file asks for with ``set_initial_pose``, None if it does not.

    nav2_amcl has no covariance for it: all particles start at one point.

    Raises
    ------
    UsageError
        If the covariance is none.

    """
    if not as_read.get("set_initial_pose", False):
        return None

    def value(key: str) -> float:
        row = names.NAMES[f"initial_pose.{key}"]
        default = row.beluga if dialect == "Beluga" else row.nav2
        if dialect == names.ROS1:
            return float(as_read.get(row.name, 0.0))  # its defaults are there
        return float(as_read.get(row.name, default)) if default is not None else 0.0

    xx, yy, tt = value("covariance_x"), value("covariance_y"), value("covariance_yaw")
    xy, xt, yt = value("covariance_xy"), value("covariance_xyaw"), value("covariance_yyaw")
    pose = np.array([value("x"), value("y"), value("yaw")])
    covariance = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    if not (np.isfinite(pose).all() and np.isfinite(covariance).all()):
        raise UsageError(f"{name}: the initial pose or its covariance is not a number; correct the file")
    if np.linalg.eigvalsh(covariance).min() < -1e-9:
        raise UsageError(
            f"{name}: initial_pose.covariance_…: not a covariance (it has a negative eigenvalue); correct the file"
        )
    return InitialPose(pose, covariance)


def notes(
    name: str, dialect: str, node: NodeParameters, as_read: Values, idle: Mapping[str, str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Remarks and warnings about what a file says, whole lines each."""
    reasons: defaultdict[str, list[str]] = defaultdict(list)
    for key, reason in idle.items():
        if node.values[key].line:  # else a default
            reasons[reason].append(node.label(key))
    reasons["no part in a replay"] += [key for key in node.values if names.is_of_any_node(key)]
    reasons["no part in a replay"] += node.idle
    reasons["not amcl's"] += [clean(key, 60) for key in node.foreign]
    said = "; ".join(f"{', '.join(keys)} ({reason})" for reason, keys in reasons.items() if keys)
    warned = [f"{name}: {line}" for line in _warnings(dialect, node, as_read)]
    return ((f"{name}: not used: {said}",) if said else ()), (*node.warnings, *warned)


def differences(name: str, dialect: str, values: Values) -> tuple[str, ...]:
    """What there is to say of a dialect that a profile follows only in part."""
    if dialect != names.ROS1:
        return ()
    motion = (
        "; its noise takes a variance for a standard deviation, as diff and omni do there"
        if values["noise_expression"] == "deviation"
        else ""
    )
    return (f"{name}: ROS 1's amcl on profile nav2, with ROS 1's defaults where the file is silent{motion}",)


def _warnings(dialect: str, node: NodeParameters, as_read: Values) -> Iterator[str]:
    for key, value in as_read.items():
        given, row, label = node.values[key], names.NAMES[key], node.label(key)
        if given.twice:
            yield f"{label} stands there twice; the last one counts, line {given.line}, as on the robot"
        if row.only and not _is_default(value, row.beluga):
            yield f"{label} = {value}, line {given.line}, is not followed: {row.note.partition(';')[0]}"
        if key == "initial_pose.yaw" and isinstance(value, float | int) and looks_like_degrees(value):
            yield (
                f"{label} = {value:g} rad, line {given.line}, looks like degrees; for {value:g} deg write "
                f"{math.radians(value):.6g}"
            )
        if key == "pf_z" and given.line and isinstance(value, float) and 0.0 < value < 1.0:
            yield (
                f"{label} = {value:g}, line {given.line}, is a normal quantile to {dialect}, so a probability of "
                f"{NormalDist().cdf(value):.3f}; {value:.0%} would be {NormalDist().inv_cdf(value):.3f}"
            )


def _is_default(value: names.Value, default: names.Value | None) -> bool:
    if isinstance(value, float) and isinstance(default, float):
        return math.isclose(value, default, rel_tol=_SAME)
    return value == default
