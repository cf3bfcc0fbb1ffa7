"""Numbers with units, as people write them: ``90deg``, ``5cm``, ``1.5``."""

from __future__ import annotations

import logging
import math
import sys

from mclcli.errors import UsageError

_UNITS: dict[str, dict[str, float]] = {
    "rad": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
}
FARTHEST = 1e9
"""What no coordinate, range or radius is beyond [m]: from there on float64 tells no tenth of a micrometre apart, no
robot goes there, and squares, sums and divisions by the smallest cells stay far from overflow."""
MOST_TURNED = 1e6
"""What no angle is beyond [rad]: up to here cosines keep their digits (``geometry.trigonometry``)."""
_TURN = 2.0 * math.pi + 1e-3
_LARGEST = {"m": FARTHEST, "rad": MOST_TURNED}


def parse_quantity(text: str, unit: str, what: str) -> float:
    """Value of a number in SI units; a plain number already is in ``unit`` (``rad``, ``m``, ``s`` or none).

    An angle without a unit that is more than a turn is taken as it stands, with a warning.

    Raises
    ------
    UsageError
        ``WHAT: 'TEXT' is not …`` if it is no finite number, carries a unit of another kind, or is a length beyond
        ``FARTHEST`` or an angle beyond ``MOST_TURNED``.

    """
    units = _UNITS.get(unit, {})
    stripped = text.strip()
    suffix = max((u for u in units if stripped.endswith(u)), key=len, default="")
    number = stripped.removesuffix(suffix) if suffix else stripped
    try:
        value = float(number.replace("_", "x"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        kind = f"a number in {unit}, or with a unit ({', '.join(units)})" if units else "a number"
        raise UsageError(f"{what}: '{text}' is not {kind}")
    value = math.radians(value) if suffix in {"deg", "°"} else value * units.get(suffix, 1.0)
    if unit == "rad" and not suffix and looks_like_degrees(value):
        logging.getLogger("mclcli").warning(
            "%s: %s rad looks like degrees; for degrees write %sdeg", what, stripped, stripped
        )
    if abs(value) > (limit := _LARGEST.get(unit, sys.float_info.max)):
        raise UsageError(f"{what}: '{text}' is beyond {limit:g} {unit}")
    return value


def looks_like_degrees(yaw: float) -> bool:
    """Whether an angle in radians is more than a turn: nobody writes that, except in degrees."""
    return abs(yaw) > _TURN


def parse_list(text: str, units: tuple[str, ...], what: str) -> tuple[float, ...]:
    """Values of a comma-separated list, a unit for each place; there may be fewer values than units.

    Raises
    ------
    UsageError
        If a value is not a number, or there are too many.

    """
    parts = text.split(",")
    if len(parts) > len(units):
        raise UsageError(f"{what}: '{text}' has {len(parts)} values; at most {len(units)} are expected")
    return tuple(parse_quantity(part, unit, what) for part, unit in zip(parts, units, strict=False))
