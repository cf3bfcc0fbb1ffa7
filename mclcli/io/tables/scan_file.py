"""One laser scan as text: the YAML that ``ros2 topic echo --once`` prints, or the same keys as JSON.

A mapping ``mcl: {base_frame, base_from_sensor: [x, y, z, roll, pitch, yaw]}`` beside the message's own keys says where
the lidar sits; other tools pass over it.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast, final

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry import se3
from mclcli.io.tables import safe_yaml
from mclcli.io.tables.text_file import decode, read_bytes, refuse_stand_ins
from mclcli.io.tables.yaml_text import to_yaml
from mclcli.quantity import FARTHEST, MOST_TURNED
from mclcli.records import LaserScan
from mclcli.text import clean

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.arrays import FloatArray
    from mclcli.io.tables.safe_yaml import Document, Value

    Transform = FloatArray

LIMITS = safe_yaml.Limits(size=1 << 21, depth=8)
_NANOSECONDS = 1_000_000_000
_NUMBERS = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
_REQUIRED = ("angle_min", "angle_increment", "range_min", "range_max")
_SPECIAL = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}  # as ROS 1 prints them


def read_scan(path: str | Path) -> tuple[LaserScan, Transform | None, str | None]:
    """Read a scan from a file; see ``parse_scan``. UsageError if there is no such file."""
    return parse_scan(read_bytes(path, LIMITS.size), str(path))


def parse_scan(data: bytes, name: str) -> tuple[LaserScan, Transform | None, str | None]:
    """Scan from UTF-8 text, YAML or JSON (told by a brace at its start); ``name`` is what messages call it.

    Of several YAML documents the first is taken, with a warning. Unknown keys are passed over. Without a header the
    stamp is 0 and ``frame_id`` empty; a leading slash is stripped from frames.

    Returns
    -------
    scan
        The scan, ranges float64 exactly as written.
    base_from_sensor
        Where the lidar sits (4, 4), or None if the text does not say.
    base_frame
        Frame of the base, or None if the text does not say.

    Raises
    ------
    InputError
        If the text is neither, a key is missing or its value wrong, naming key and line, or the array was cut short.

    """
    if len(data) > LIMITS.size:
        raise InputError(f"{name}: is longer than {LIMITS.size} bytes, the most that is read; give a single scan")
    refuse_stand_ins(data, name)
    document = _json(data, name) if data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") else _yaml(data, name)
    if not isinstance(document.value, dict):
        raise InputError(f"{name}: not a LaserScan: expected keys header, angle_min, ranges…; give one scan")
    fields = _Fields(document)
    return fields.scan(), *fields.mount()


def _yaml(data: bytes, name: str) -> Document:
    document = safe_yaml.parse(data, name, LIMITS, several=True)
    if document.more:
        import logging

        logging.getLogger("mclcli").warning("%s: holds several documents (---); the first one is used", name)
    return document


def _json(data: bytes, name: str) -> Document:
    try:
        value = json.loads(decode(data, name), object_pairs_hook=_distinct)
    except json.JSONDecodeError as error:
        raise InputError(f"{name}: not valid JSON: {error.msg}, line {error.lineno}; correct it") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: not valid JSON: {clean(str(error), 100)}; correct it") from None
    return safe_yaml.Document(value, name, {})


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        repeated = next(key for i, (key, _) in enumerate(pairs) if key in dict(pairs[:i]))
        raise ValueError(f"key '{clean(repeated, 40)}' stands there twice")
    return found


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Fields:
    """The keys of a scan, each checked where it is taken."""

    document: Document

    def scan(self) -> LaserScan:
        """The message itself."""
        for key in (*_REQUIRED, "ranges"):
            if key not in self._top:
                raise InputError(
                    f"{self.document.name}: not a LaserScan: key '{key}' is missing; give the whole message"
                )
        stamp_ns, frame_id = self._header()
        numbers = {key: self._number(self._top[key], key) for key in _NUMBERS if key in self._top}
        scan = LaserScan(stamp_ns, frame_id, ranges=self._ranges(), **numbers)
        self._check(scan)
        return scan

    def mount(self) -> tuple[Transform | None, str | None]:
        """What the mapping ``mcl`` says, if it is there."""
        extra = self._top.get("mcl")
        if extra is None:
            return None, None
        if not isinstance(extra, dict):
            raise self._wrong("expected base_frame and base_from_sensor", "mcl")
        base_frame = self._frame(extra["base_frame"], "mcl", "base_frame") if "base_frame" in extra else None
        if "base_from_sensor" not in extra:
            return None, base_frame
        path = ("mcl", "base_from_sensor")
        values = extra["base_from_sensor"]
        if not isinstance(values, list) or len(values) != 6:
            raise self._wrong("expected six numbers [x, y, z, roll, pitch, yaw]", *path)
        x, y, z, roll, pitch, yaw = (self._finite(value, *path) for value in values)
        if max(abs(x), abs(y), abs(z)) > FARTHEST or max(abs(roll), abs(pitch), abs(yaw)) > MOST_TURNED:
            raise self._wrong(f"lies more than {FARTHEST:g} m away, or turns by more than {MOST_TURNED:g} rad", *path)
        return se3.from_rpy([x, y, z], roll, pitch, yaw), base_frame

    @property
    def _top(self) -> dict[str, Value]:
        return cast("dict[str, Value]", self.document.value)

    def _header(self) -> tuple[int, str]:
        header = self._top.get("header")
        if header is None:
            return 0, ""
        if not isinstance(header, dict):
            raise self._wrong("expected stamp and frame_id", "header")
        return self._stamp(header.get("stamp")), self._frame(header.get("frame_id"), "header", "frame_id")

    def _stamp(self, stamp: Value) -> int:
        if stamp is None:
            return 0
        names = ("sec", "nanosec") if isinstance(stamp, dict) and "sec" in stamp else ("secs", "nsecs")
        parts = [stamp.get(name) if isinstance(stamp, dict) else None for name in names]
        match parts:
            case [int(sec), int(nanosec)] if 0 <= nanosec < _NANOSECONDS and abs(sec) < 2**33:
                return sec * _NANOSECONDS + nanosec
        raise self._wrong("expected whole numbers sec and nanosec", "header", "stamp")

    def _frame(self, value: Value, *path: str) -> str:
        if value is not None and not isinstance(value, str):
            raise self._wrong(f"{clean(str(value), 40)} is not text; put it in quotes", *path)
        return (value or "").lstrip("/")

    def _ranges(self) -> FloatArray:
        values = self._top["ranges"]
        if not isinstance(values, list) or "..." in values:
            raise self._wrong("the array was cut short", "ranges", remedy="print it with ros2 topic echo --full-length")
        if not values:
            raise self._wrong("holds no reading", "ranges")
        ranges = np.array([self._number(value, "ranges", i) for i, value in enumerate(values)], dtype=np.float64)
        ranges.flags.writeable = False
        return ranges

    def _number(self, value: Value, *path: str | int) -> float:
        if isinstance(value, str):
            value = _SPECIAL.get(value, value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._wrong(f"'{clean(str(value), 40)}' is not a number", *path)
        try:
            return float(value)
        except OverflowError:  # a whole number beyond float64
            raise self._wrong("the number is too large", *path) from None

    def _finite(self, value: Value, *path: str | int) -> float:
        number = self._number(value, *path)
        if not math.isfinite(number):
            raise self._wrong(f"{number} is not a finite number", *path)
        return number

    def _check(self, scan: LaserScan) -> None:
        """Refuse a geometry that says nothing; warn where angle_max contradicts the number of readings."""
        for key in _NUMBERS:
            if key not in {"angle_max", "range_max"}:
                self._finite(getattr(scan, key), key)
        if not scan.range_max > 0.0:
            raise self._wrong(f"{scan.range_max:g} m is not greater than 0", "range_max")
        if scan.ranges.size > 1 and scan.angle_increment == 0.0:
            raise self._wrong("0 would put all beams in one direction", "angle_increment")
        if "angle_max" in self._top and scan.ranges.size > 1:
            beams = (scan.angle_max - scan.angle_min) / scan.angle_increment + 1.0
            if not abs(beams - scan.ranges.size) <= 1.01:
                import logging

                text = "%s: %d readings, but angle_max stands for %.4g; the readings count"
                logging.getLogger("mclcli").warning(text, self.document.name, scan.ranges.size, beams)

    def _wrong(self, what: str, *path: str | int, remedy: str = "correct it") -> InputError:
        where = ".".join(str(step) for step in path)
        line = f", line {self.document.line(*path)}" if self.document.lines else ""
        return InputError(f"{self.document.name}: {where}: {what}{line}; {remedy}")


def format_scan(
    scan: LaserScan,
    base_from_sensor: Transform | None = None,
    base_frame: str | None = None,
    fmt: Literal["yaml", "json"] = "yaml",
) -> str:
    """Text that ``parse_scan`` reads back to the same numbers, bit by bit, ending in a newline.

    The mount (4, 4) passes through roll, pitch and yaw and comes back within rounding.
    """
    sec, nanosec = divmod(int(scan.stamp_ns), _NANOSECONDS)
    message: dict[str, Any] = {
        "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": scan.frame_id},
        **{key: float(getattr(scan, key)) for key in _NUMBERS},
        "ranges": scan.ranges.tolist(),
    }
    extra: dict[str, Any] = {} if base_frame is None else {"base_frame": base_frame}
    if base_from_sensor is not None:
        extra["base_from_sensor"] = [value + 0.0 for value in se3.to_rpy(base_from_sensor)]  # no −0.0
    if extra:
        message["mcl"] = extra
    return json.dumps(message) + "\n" if fmt == "json" else to_yaml(message)
