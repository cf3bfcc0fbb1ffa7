"""Texts of options as values: callbacks that click calls with what the user wrote."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

from mclcli.errors import UsageError
from mclcli.quantity import parse_list, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.cli.clock import LogTime
    from mclcli.sensors import Temperature

Pose = tuple[float, float, float]

POSE_UNITS = ("m", "m", "rad")
_SENSOR = re.compile(r"((lidar|vision)(_\d+)?)?")
MOUNT_UNITS = ("m", "m", "m", "rad", "rad", "rad")


def parse_pose(ctx: click.Context, param: click.Parameter, value: str | None) -> Pose | None:
    """X,Y,YAW of an option, yaw in radians or with a unit."""
    del ctx
    if value is None:
        return None
    pose = parse_list(value, POSE_UNITS, param.opts[0])
    if len(pose) != 3:
        raise click.BadParameter(f"'{value}' needs three values, X,Y,YAW", param=param)
    x, y, yaw = pose
    return x, y, yaw


def parse_poses(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> list[Pose]:
    """X,Y,YAW of a repeated option."""
    return [pose for value in values if (pose := parse_pose(ctx, param, value)) is not None]


def parse_mounts(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, FloatArray]:
    """[FRAME=]X,Y,YAW or [FRAME=]X,Y,Z,ROLL,PITCH,YAW as transforms (4, 4) by frame; '' stands for any frame."""
    from mclcli.geometry import se3

    del ctx
    mounts: dict[str, FloatArray] = {}
    for value in values:
        frame, _, numbers = value.rpartition("=")
        if numbers.count(",") == 2:
            x, y, yaw = parse_list(numbers, POSE_UNITS, "--mount")
            mounts[frame.lstrip("/")] = se3.from_rpy([x, y, 0.0], 0.0, 0.0, yaw)
        elif numbers.count(",") == 5:
            x, y, z, roll, pitch, yaw = parse_list(numbers, MOUNT_UNITS, "--mount")
            mounts[frame.lstrip("/")] = se3.from_rpy([x, y, z], roll, pitch, yaw)
        else:
            raise click.BadParameter(f"'{value}' is neither X,Y,YAW nor X,Y,Z,ROLL,PITCH,YAW", param=param)
    return mounts


def named(*endings: str) -> Callable[[click.Context, click.Parameter, str | None], str | None]:
    """Callback for an output that is written in one form whatever its name: another ending is a slip."""

    def parse(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        del ctx
        special = value is None or value == "-" or value.startswith(("/dev/", "/proc/"))
        if not special and not str(value).lower().endswith(endings):
            raise UsageError(f"{param.opts[0]} {value}: the name must end in {' or '.join(endings)}, or be -")
        return value

    return parse


parse_picture = named(".png")
"""Callback for a picture, which is written as PNG."""


def parse_settings(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """KEY=VALUE pairs of --set; the last one of a key counts."""
    del ctx
    pairs = [value.partition("=") for value in values]
    for key, equals, _ in pairs:
        if not equals:
            raise click.BadParameter(f"'{key}' is not KEY=VALUE", param=param)
    return {key.strip(): text.strip() for key, _, text in pairs}


def parse_temperature(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, Temperature]:
    """[SENSOR=]ALPHA|auto|ess by sensor; '' stands for all."""
    del ctx
    temperature: dict[str, Temperature] = {}
    for value in values:
        sensor, _, text = value.rpartition("=")
        if not _SENSOR.fullmatch(sensor):
            raise click.BadParameter(
                f"'{sensor}' is no sensor; name lidar or vision, or one of several, lidar_2", param=param
            )
        temperature[sensor] = _temperature(text, param)
    return temperature


def _temperature(text: str, param: click.Parameter) -> Temperature:
    if text == "auto":
        return "auto"
    if text == "ess":
        return "ess"
    alpha = parse_quantity(text, "", "--temperature")
    if not 0.0 < alpha <= 1.0:
        raise click.BadParameter(f"{text} is not in (0, 1]; 1 leaves the likelihood as it is", param=param)
    return alpha


def parse_at(ctx: click.Context, param: click.Parameter, value: str | None) -> LogTime | None:
    """TIME of an option, in any of its four forms."""
    from mclcli.cli.clock import parse_time

    del ctx
    return None if value is None else parse_time(value, param.opts[0])


def parse_length(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Nanoseconds of an option in seconds, not negative."""
    from mclcli.cli.clock import parse_seconds

    del ctx
    if value is None:
        return None
    length = parse_seconds(value, param.opts[0])
    if length < 0:
        raise UsageError(f"{param.opts[0]}: {value} is less than 0")
    return length
