"""Updates of a run, read back from its steps (a row per update) or its weight trace (a row per particle)."""

from __future__ import annotations

import gzip
import itertools
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError, UsageError
from mclcli.io.tables.csv_table import read_table
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TextIO

    from mclcli.arrays import BoolArray, FloatArray, IntArray

_STEPS = {"stamp": "s", "n": "", "ess": "", "x": "m", "y": "m", "yaw": "rad"}
_MORE = {"segment": "", "reliability": "", "lost": ""}
_TRACE = ("step", "stamp", "x", "y", "yaw", "weight")
_ROWS = 200_000  # read at once: bounds the memory that a long trace takes


@final
@dataclass(frozen=True, slots=True, eq=False)
class Updates:
    """N updates: ``stamps_ns`` (N,) int64, estimated ``poses`` (N, 3), ``particles`` (N,) and their ``ess`` (N,).

    ``reliability`` (N,), ``lost`` (N,) and ``segments`` (N,) are None of a weight trace, which does not hold them.
    """

    stamps_ns: IntArray
    poses: FloatArray
    particles: FloatArray
    ess: FloatArray
    reliability: FloatArray | None = None
    lost: BoolArray | None = None
    segments: IntArray | None = None


def read_updates(source: str | Path) -> Updates:
    """Updates of a CSV of ``--steps``, or of a weight trace, ``.csv``, ``.csv.gz`` or ``.mcap``.

    Raises
    ------
    UsageError
        If there is no such file.
    InputError
        If it is neither, or holds no update, naming the line where there is one.

    """
    if str(source).endswith(".mcap"):
        from mclcli.io.traces.steps_mcap import read_steps

        return Updates(*read_steps(Path(source)))
    try:
        with _opened(source) as file:
            lines = (line for line in file if not line.startswith("#"))
            names = next(lines, "").rstrip("\r\n").split(",")
            if "particle" in names:
                updates = _of_trace(lines, names, str(source))
            elif {"n", "ess"} <= set(names):
                updates = _of_steps(source)
            else:
                found = clean(", ".join(names), 100).strip() or "nothing"
                raise InputError(
                    f"{source}: neither a weight trace nor steps of `mcl run`: its header has {found}; "
                    "name a file of -o F.csv or of --steps F.csv"
                )
    except FileNotFoundError:
        raise UsageError(f"{source}: no such file; name a file of -o F.csv or of --steps F.csv") from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError(f"{source}: damaged gzip: {error}; write it again") from None
    except UnicodeDecodeError:
        raise InputError(f"{source}: not text: name a file of -o F.csv or of --steps F.csv") from None
    if not updates.stamps_ns.size:
        raise InputError(f"{source}: holds no update")
    return updates


def _opened(source: str | Path) -> TextIO:
    if str(source).endswith(".gz"):
        return gzip.open(source, "rt", encoding="utf-8")
    return Path(source).open(encoding="utf-8")


def _of_steps(source: str | Path) -> Updates:
    table = read_table(source, {**_STEPS, **_MORE}, optional=_MORE).numbers
    lost, segments = table.get("lost"), table.get("segment")
    return Updates(
        _nanoseconds(table["stamp"]),
        np.stack([table["x"], table["y"], table["yaw"]], axis=-1),
        table["n"],
        table["ess"],
        table.get("reliability"),
        None if lost is None else lost > 0.0,
        None if segments is None else segments.astype(np.int64),
    )


def _of_trace(lines: Iterator[str], names: list[str], source: str) -> Updates:
    """Weighted sums by step, block by block: a step may go on in the next one."""
    missing = [name for name in _TRACE if name not in names]
    if missing:
        raise InputError(f"{source}: no column '{missing[0]}' in the header; name a weight trace of `mcl run`")
    columns = [names.index(name) for name in _TRACE]
    sums: dict[int, FloatArray] = {}
    while block := list(itertools.islice(lines, _ROWS)):
        try:
            rows = np.loadtxt(block, delimiter=",", usecols=columns, ndmin=2)
        except ValueError as error:
            raise InputError(f"{source}: a row is not one of a weight trace: {clean(str(error), 100)}") from None
        _add(sums, rows)
    steps = np.array([sums[step] for step in sorted(sums)]).reshape(-1, 7)
    stamps, particles, squares, x, y, sine, cosine = steps.T
    poses = np.stack([x, y, np.arctan2(sine, cosine)], axis=-1)
    return Updates(_nanoseconds(stamps), poses, particles, 1.0 / np.maximum(squares, 1e-300))


def _add(sums: dict[int, FloatArray], rows: FloatArray) -> None:
    """Add rows (R, 6) of ``_TRACE`` to the sums of their steps: stamp, N, Σw², Σwx, Σwy, Σw sin, Σw cos."""
    numbers, at = np.unique(rows[:, 0].astype(np.int64), return_inverse=True)
    weight = rows[:, 5]
    parts = (
        weight**2,
        weight * rows[:, 2],
        weight * rows[:, 3],
        weight * np.sin(rows[:, 4]),
        weight * np.cos(rows[:, 4]),
    )
    totals = [np.bincount(at, part, numbers.size) for part in (np.ones(len(rows)), *parts)]
    first = np.unique(at, return_index=True)[1]
    for number, stamp, *values in zip(numbers.tolist(), rows[first, 1], *totals, strict=True):
        known = sums.get(number)
        added = np.array([stamp, *values])
        sums[number] = added if known is None else np.concatenate([known[:1], known[1:] + added[1:]])


def _nanoseconds(seconds: FloatArray) -> IntArray:
    return np.round(seconds * 1e9).astype(np.int64)
