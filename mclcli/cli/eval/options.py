"""Options of ``mcl eval`` as values: rules, limits, names with wildcards."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mclcli.errors import UsageError
from mclcli.quantity import parse_list, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Callable

    import click

    from mclcli.evaluate.evaluation import Protocol
    from mclcli.evaluate.events import Rule
    from mclcli.evaluate.limits import Limits

    Callback = Callable[[click.Context, click.Parameter, str | None], float | None]


def quantity(unit: str) -> Callback:
    """Callback of an option that takes a number ≥ 0 in a unit (``m``, ``rad``, ``s`` or none)."""

    def parse(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
        del ctx
        if text is None:
            return None
        value = parse_quantity(text, unit, param.opts[0])
        if value < 0.0:
            raise UsageError(f"{param.opts[0]}: {text} is negative; a bound is at least 0")
        return value

    return parse


def parse_share(text: str, option: str) -> float:
    """Share from 0 to 1 of ``0.95`` or ``95%``."""
    percent = text.strip().endswith("%")
    value = parse_quantity(text.strip().removesuffix("%"), "", option) * (0.01 if percent else 1.0)
    if not 0.0 <= value <= 1.0:
        raise UsageError(f"{option}: {text} is not a share; write 0.95 or 95%")
    return value


def share(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
    """Callback of an option that takes a share."""
    del ctx
    return None if text is None else parse_share(text, param.opts[0])


def share_within(ctx: click.Context, param: click.Parameter, text: str | None) -> tuple[float, float] | None:
    """Callback of ``SHARE,M``."""
    del ctx
    if text is None:
        return None
    first, comma, second = text.partition(",")
    if not comma:
        raise UsageError(f"{param.opts[0]}: '{text}' needs a share and a distance, such as 95%,10cm")
    return parse_share(first, param.opts[0]), parse_quantity(second, "m", param.opts[0])


def rule(text: str | None, default: Rule, option: str) -> Rule:
    """Rule of ``M,ANGLE,SECONDS``; what is not given is as by default."""
    from dataclasses import replace

    if text is None:
        return default
    values = parse_list(text, ("m", "rad", "s"), option)
    if min(values) < 0.0:
        raise UsageError(f"{option}: '{text}' has a negative value; bounds are at least 0")
    translation, yaw, seconds = (*values, *(default.translation, default.yaw, default.seconds)[len(values) :])
    return replace(default, translation=translation, yaw=yaw, seconds=seconds)


def protocol_of(arguments: dict[str, Any]) -> Protocol:
    """How the evaluation is made, as asked for."""
    from mclcli.evaluate.association import Matching
    from mclcli.evaluate.evaluation import Protocol
    from mclcli.evaluate.events import CONVERGED, LOST

    gap, difference = (round(arguments[name] * 1e9) for name in ("max_gap", "max_diff"))
    return Protocol(
        matching=Matching(arguments["associate"], max_gap_ns=gap, max_diff_ns=difference),
        align=arguments["align"],
        converged=rule(arguments["converged"], CONVERGED, "--converged"),
        lost=rule(arguments["lost"], LOST, "--lost"),
    )


def limits_of(arguments: dict[str, Any]) -> Limits:
    """The limits asked for."""
    from dataclasses import fields

    from mclcli.evaluate.limits import Limits

    return Limits(**{field.name: arguments[field.name] for field in fields(Limits)})


def expand(names: tuple[str, ...]) -> list[str]:
    """Tracks by name: wildcards that the shell left alone are expanded, in order of name.

    Raises
    ------
    UsageError
        If no file matches, or standard input is named twice.

    """
    import glob

    found: list[str] = []
    for name in names:
        plain = name == "-" or not glob.has_magic(name) or Path(name).exists()
        matches = [name] if plain else sorted(glob.glob(name, recursive=True))  # noqa: PTH207 - absolute patterns too
        if not matches:
            raise UsageError(f"{name}: no file matches; check the pattern")
        found += matches
    if found.count("-") > 1:
        raise UsageError("-: standard input can be read once only; name it once")
    return found
