"""Landmarks and bearings as users write them: CSV or YAML."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.errors import InputError, UsageError
from mclcli.io.tables import csv_table, safe_yaml
from mclcli.io.tables.text_file import read_bytes
from mclcli.quantity import FARTHEST, parse_quantity
from mclcli.records import LandmarkSightings
from mclcli.text import clean
from mclcli.world.landmarks import Landmarks

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.io.tables.safe_yaml import Document, Value

_LIMITS = safe_yaml.Limits(size=1 << 20, depth=4)
_COLUMNS = {"x": "m", "y": "m", "z": "m"}


def read_landmarks(path: str | Path) -> Landmarks:
    """Landmarks of a CSV with columns id, x, y[, z] or of a YAML list of mappings with these keys [m, in map].

    The YAML list may also stand under a key ``landmarks``. An id is text or a whole number; z is 0 where absent; other
    columns and keys are passed over. CSV is told from YAML by its first line: a header with commas.

    Raises
    ------
    UsageError
        If there is no such file.
    InputError
        If it is not such a list, a number is not finite or beyond 1e9 m, an id is empty or repeats, naming the line; if
        it is empty.

    """
    data, name = read_bytes(path, csv_table.MAX_BYTES), str(path)
    rows = _from_csv(data, name) if _is_csv(data) else _from_yaml(safe_yaml.parse(data, name, _LIMITS), name)
    known: dict[str, int] = {}
    for identity, position, line in rows:
        if not max(map(abs, position)) <= FARTHEST:
            raise InputError(
                f"{name}: landmark '{clean(identity, 40)}' is farther than {FARTHEST:g} m from the map's origin, "
                f"line {line}; correct it"
            )
        if identity in known:
            raise InputError(
                f"{name}: landmark '{clean(identity, 40)}' stands there twice, lines {known[identity]} and {line}; "
                "remove one"
            )
        known[identity] = line
    if not rows:
        raise InputError(f"{name}: holds no landmark; expected id, x, y[, z]")
    return Landmarks(tuple(known), np.array([position for _, position, _ in rows], dtype=np.float64))


def read_bearings(path: str | Path) -> LandmarkSightings:
    """Bearings of a CSV with columns id, bearing [rad, or with a unit as in ``35deg``], counter-clockwise from ahead.

    ``-`` is standard input. The rays are horizontal, in the frame the bearings were measured in; the stamp is 0 and
    ``frame_id`` empty. An id may repeat.

    Raises
    ------
    UsageError
        If there is no such file.
    InputError
        If it is not such a table, naming the line, or holds no bearing.

    """
    table = csv_table.read_table(path, {"bearing": "rad"})
    ids = _ids(table, str(path))
    if not ids:
        raise InputError(f"{path}: holds no bearing; expected id, bearing")
    angles = table.numbers["bearing"]
    rays = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
    rays.flags.writeable = False
    return LandmarkSightings(0, "", ids, rays)


Row = tuple[str, tuple[float, float, float], int]


def _is_csv(data: bytes) -> bool:
    """Whether the first line that says anything is a CSV header."""
    lines = (line.strip() for line in data.removeprefix(b"\xef\xbb\xbf").splitlines())
    first = next((line for line in lines if line and not line.startswith(b"#")), b"")
    return b"," in first and not first.startswith((b"-", b"[", b"{")) and b":" not in first


def _from_csv(data: bytes, name: str) -> list[Row]:
    table = csv_table.parse_table(data, name, _COLUMNS, optional=["z"])
    x, y = table.numbers["x"].tolist(), table.numbers["y"].tolist()
    z = table.numbers["z"].tolist() if "z" in table.numbers else [0.0] * len(x)
    return list(zip(_ids(table, name), zip(x, y, z, strict=True), table.lines.tolist(), strict=True))


def _ids(table: csv_table.Table, name: str) -> tuple[str, ...]:
    if "id" not in table.columns:
        raise InputError(f"{name}: no column 'id' in the header; add it")
    column = table.columns.index("id")
    ids = tuple(fields[column].strip() for fields in table.texts)
    if "" in ids:
        raise InputError(f"{name}: the id is empty, line {table.lines[ids.index('')]}; fill it in")
    return ids


def _from_yaml(document: Document, name: str) -> list[Row]:
    value, prefix = document.value, tuple[str, ...]()
    if isinstance(value, dict) and isinstance(value.get("landmarks"), list):
        value, prefix = value["landmarks"], ("landmarks",)
    if not isinstance(value, list):
        raise InputError(f"{name}: not a list of landmarks; expected a list of {{id, x, y}}, or CSV with id,x,y")
    return [_row(item, name, document.line(*prefix, i)) for i, item in enumerate(value)]


def _row(item: Value, name: str, line: int) -> Row:
    if not isinstance(item, dict):
        raise InputError(f"{name}: not a mapping with id, x, y, line {line}; correct it")
    for key in ("id", "x", "y"):
        if key not in item:
            raise InputError(f"{name}: a landmark without '{key}', line {line}; add it")
    identity = item["id"]
    if isinstance(identity, bool) or not isinstance(identity, str | int) or not str(identity).strip():
        raise InputError(f"{name}: id '{clean(str(identity), 40)}' is neither text nor a whole number, line {line}")
    x, y, z = (_length(item.get(key, 0.0), key, name, line) for key in _COLUMNS)
    return str(identity).strip(), (x, y, z), line


def _length(value: Value, key: str, name: str, line: int) -> float:
    if isinstance(value, str):
        try:
            return parse_quantity(clean(value, 40), _COLUMNS[key], key)
        except UsageError as error:
            raise InputError(f"{name}: {error}, line {line}; correct it") from None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name}: {key}: {clean(str(value), 40)} is not a finite number, line {line}; correct it")
    if abs(value) > FARTHEST:
        raise InputError(f"{name}: {key}: {value:g} is more than {FARTHEST:g} m away, line {line}; correct it")
    return float(value)
