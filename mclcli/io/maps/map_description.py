"""What a map's YAML says, checked value by value: a wrong one is named with its line, never repaired."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast, final

from mclcli.errors import UsageError, nearest_name
from mclcli.io.tables import safe_yaml
from mclcli.quantity import FARTHEST, MOST_TURNED
from mclcli.text import clean
from mclcli.world.occupancy import MAX_RESOLUTION, MIN_RESOLUTION

if TYPE_CHECKING:
    from mclcli.io.tables.safe_yaml import Document, Value

Mode = Literal["trinary", "scale", "raw"]
MODES: tuple[Mode, ...] = ("trinary", "scale", "raw")
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_TRUTHS = {0: False, 1: True, "no": False, "off": False, "yes": True, "on": True}


@final
@dataclass(frozen=True, slots=True)
class MapDescription:
    """What the YAML says. ``origin``: x [m], y [m], yaw [rad]; thresholds in [0, 1]; ``resolution`` [m]."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: Mode = "trinary"


def describe(document: Document) -> MapDescription:
    """Check a map's YAML; UsageError naming key and line for whatever is missing or wrong."""
    if not isinstance(document.value, dict):
        raise UsageError(
            f"{document.name}: not a map: expected keys image, resolution, origin…; name a map_server YAML"
        )
    for key in _KEYS:
        _require(key, document, document.value)
    low, high = _number("free_thresh", document, 0.0, 1.0), _number("occupied_thresh", document, 0.0, 1.0)
    if low > high:
        raise wrong("free_thresh", document, f"{low:g} is above occupied_thresh {high:g}; it must be below")
    if low == high:
        import logging

        logging.getLogger("mclcli").warning(
            "%s: free_thresh equals occupied_thresh (%g), line %d; no gray value is unknown",
            document.name,
            low,
            document.line("free_thresh"),
        )
    return MapDescription(
        image=_image_name(document),
        resolution=_resolution(document),
        origin=_origin(document),
        negate=_truth(document),
        occupied_thresh=high,
        free_thresh=low,
        mode=_mode(document),
    )


def _require(key: str, document: Document, pairs: dict[str, Value]) -> None:
    if key not in pairs:
        unknown = [clean(name, 40) for name in pairs if name not in {*_KEYS, "mode"}]
        hint = f" (unknown here: {', '.join(unknown[:5])})" if unknown else ""
        raise UsageError(f"{document.name}: key '{key}' is missing; add it{hint}")


def wrong(key: str, document: Document, what: str, remedy: str = "correct it") -> UsageError:
    """Error about the value of a key: ``FILE: KEY: WHAT, line N; REMEDY``."""
    return UsageError(f"{document.name}: {key}: {what}, line {document.line(key)}; {remedy}")


def _value(key: str, document: Document) -> Value:
    """Value of a key; a quoted number counts as a number, as in yaml-cpp."""
    value = cast("dict[str, Value]", document.value).get(key)
    return safe_yaml.resolve(value) if isinstance(value, str) else value


def _as_number(value: Value, key: str, document: Document) -> float:
    value = safe_yaml.resolve(value) if isinstance(value, str) else value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise wrong(key, document, f"{clean(str(value), 40)} is not a finite number")
    return float(value)


def _number(key: str, document: Document, low: float, high: float) -> float:
    number = _as_number(_value(key, document), key, document)
    if not low <= number <= high:
        raise wrong(key, document, f"{number:g} is not between {low:g} and {high:g}")
    return number


def _resolution(document: Document) -> float:
    resolution = _as_number(_value("resolution", document), "resolution", document)
    if not MIN_RESOLUTION < resolution <= MAX_RESOLUTION:
        wanted = f"more than {MIN_RESOLUTION:g}" if resolution <= MIN_RESOLUTION else f"at most {MAX_RESOLUTION:g}"
        raise wrong("resolution", document, f"{resolution:g} m per cell is not {wanted}")
    return resolution


def _origin(document: Document) -> tuple[float, float, float]:
    values = _value("origin", document)
    if not isinstance(values, list) or len(values) != 3:
        raise wrong("origin", document, "expected three numbers [x, y, yaw]")
    x, y, yaw = (_as_number(value, "origin", document) for value in values)
    if max(abs(x), abs(y)) > FARTHEST:
        raise wrong("origin", document, f"({x:g}, {y:g}) is more than {FARTHEST:g} m away")
    if abs(yaw) > MOST_TURNED:
        raise wrong("origin", document, f"yaw {yaw:g} is more than {MOST_TURNED:g} rad")
    return x, y, yaw


def _truth(document: Document) -> bool:
    value = _value("negate", document)
    known = value.lower() if isinstance(value, str) else value
    if not isinstance(known, str | int) or known not in _TRUTHS:
        raise wrong("negate", document, f"{clean(str(value), 40)} is not 0, 1, false or true")
    return _TRUTHS[known]


def _mode(document: Document) -> Mode:
    value = cast("dict[str, Value]", document.value).get("mode", "trinary")
    for mode in MODES:
        if isinstance(value, str) and value.lower() == mode:
            return mode
    hint = nearest_name(str(value).lower(), list(MODES))
    raise wrong("mode", document, f"'{clean(str(value), 40)}' is not trinary, scale or raw{hint}")


def _image_name(document: Document) -> str:
    value = cast("dict[str, Value]", document.value)["image"]
    if value is None or isinstance(value, bool | list | dict) or value == "":
        raise wrong("image", document, "expected the name of an image file")
    return str(value)
