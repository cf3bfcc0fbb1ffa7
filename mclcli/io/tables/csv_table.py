"""CSV with a header row: columns by name, numbers with their units, every complaint with its line."""

from __future__ import annotations

import csv
import io
import math
from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError, UsageError
from mclcli.geometry import se2
from mclcli.io.tables.text_file import decode, read_bytes, read_stdin, refuse_stand_ins
from mclcli.quantity import parse_quantity
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from mclcli.arrays import FloatArray, IntArray

MAX_BYTES = 1 << 28


@final
@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of a CSV.

    ``numbers``: float64 (N,) by column, in SI units. ``columns`` and ``texts`` are the remaining columns: their names,
    and N rows of their fields as written. ``lines`` holds the line each row stands on, (N,).
    """

    numbers: dict[str, FloatArray]
    columns: tuple[str, ...]
    texts: list[tuple[str, ...]]
    lines: IntArray


def read_poses(source: str | Path) -> tuple[FloatArray, tuple[str, ...], list[tuple[str, ...]]]:
    """Poses of a CSV with columns x, y, yaw; ``-`` is standard input.

    Returns
    -------
    poses
        (N, 3) float64 in file order, x, y [m], yaw [rad] wrapped to (−π, π].
    columns, texts
        Names of the other columns, and N rows of their fields as written.

    Raises
    ------
    UsageError
        If there is no such file.
    InputError
        If it is not such a table, naming the line.

    """
    table = read_table(source, {"x": "m", "y": "m", "yaw": "rad"})
    poses = np.stack([table.numbers["x"], table.numbers["y"], se2.wrap(table.numbers["yaw"])], axis=-1)
    return poses, table.columns, table.texts


def read_table(source: str | Path, units: Mapping[str, str], optional: Iterable[str] = ()) -> Table:
    """Read a CSV file, or standard input for ``-``; see ``parse_table``. UsageError if there is no such file."""
    if str(source) == "-":
        return parse_table(read_stdin(MAX_BYTES), "standard input", units, optional)
    return parse_table(read_bytes(source, MAX_BYTES), str(source), units, optional)


def parse_table(data: bytes, name: str, units: Mapping[str, str], optional: Iterable[str] = ()) -> Table:
    """Rows of CSV text in UTF-8; ``name`` is what messages call it.

    Parameters
    ----------
    data, name
        The text, with or without a byte order mark. Empty lines, and lines starting with ``#`` before the header,
        are passed over.
    units
        The columns that hold numbers, each with the unit of plain ones: ``rad``, ``m``, ``s`` or empty.
    optional
        Those of them that may be missing from the header; they are then missing from ``numbers``.

    Raises
    ------
    InputError
        If the header lacks a column or has one twice, or a row has other than its number of fields or a field that
        is not a finite number, naming the line.

    """
    refuse_stand_ins(data, name)
    rows = _rows(decode(data, name), name)
    _, header = next(rows, (0, []))
    names = [column.strip() for column in header]
    _check_header(names, units, optional, name)
    wanted = {column: names.index(column) for column in units if column in names}
    others = [i for i, column in enumerate(names) if column not in units]
    numbers, texts, lines = {column: array("d") for column in wanted}, [], array("q")
    for line, fields in rows:
        if len(fields) != len(names):
            raise InputError(f"{name}: {len(fields)} fields where the header has {len(names)}, line {line}; correct it")
        for column, i in wanted.items():
            numbers[column].append(_number(fields[i], units[column], column, name, line))
        texts.append(tuple(fields[i] for i in others))
        lines.append(line)
    return Table(
        {column: np.array(values, dtype=np.float64) for column, values in numbers.items()},
        tuple(names[i] for i in others),
        texts,
        np.array(lines, dtype=np.int64),
    )


def _rows(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the line each begins on; comments may stand before the first one."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    first, line = True, 1
    try:
        for fields in reader:
            comment = first and fields and fields[0].startswith("#")
            if fields and not comment:
                first = False
                yield line, fields
            line = reader.line_num + 1
    except csv.Error as error:
        raise InputError(f"{name}: not CSV: {error}, line {line}; correct it") from None


def _check_header(names: list[str], units: Mapping[str, str], optional: Iterable[str], name: str) -> None:
    missing = [column for column in units if column not in names and column not in set(optional)]
    if missing:
        found = clean(", ".join(names), 100) or "nothing"
        raise InputError(f"{name}: no column '{missing[0]}' in the header, which has {found}; add a header row")
    for column in names:
        if names.count(column) > 1:
            raise InputError(f"{name}: column '{clean(column, 40)}' is in the header twice; rename one")


def _number(text: str, unit: str, column: str, name: str, line: int) -> float:
    try:
        value = float(text)
        if math.isfinite(value) and "_" not in text:
            return value
    except ValueError:
        pass
    try:
        return parse_quantity(clean(text, 40), unit, column)
    except UsageError as error:
        raise InputError(f"{name}: {error}, line {line}; correct it") from None
