"""Trajectories as text: the TUM format, and the track CSV read back.

TUM: ``t x y z qx qy qz qw`` a line, ``#`` comments, as evo and the TUM RGB-D benchmark's tools read it.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import se2
from mclcli.errors import InputError, UsageError
from mclcli.io.writers import NANOSECONDS, require_finite, stamp_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mclcli.io.writers import TextSink
    from mclcli.records import TrackPoint

_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d{1,3})?", re.ASCII | re.IGNORECASE)
_MAX_NS = 2**63 - 1
_CSV_COLUMNS = ("stamp", "x", "y", "yaw")


@final
@dataclass(frozen=True, slots=True, eq=False)
class TimedPoses:
    """Poses over time: ``stamps_ns`` (N,) int64, strictly increasing; ``poses`` (N, 3) float64, yaw in (−π, π]."""

    stamps_ns: NDArray[np.int64]
    poses: NDArray[np.float64]


@final
class TumWriter:
    """Writes the track in the TUM format, every number with 9 decimals; z, qx and qy are 0."""

    __slots__ = ("_stream",)

    def __init__(self, stream: TextSink) -> None:
        self._stream = stream

    def write(self, point: TrackPoint) -> None:
        """Append one line; a ValueError if the pose is not finite."""
        require_finite("pose", point.estimate.pose)
        x, y, yaw = point.estimate.pose.tolist()
        qz, qw = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        flat = "0.000000000"
        self._stream.write(f"{stamp_text(point.stamp_ns)} {x:.9f} {y:.9f} {flat} {flat} {flat} {qz:.9f} {qw:.9f}\n")

    def close(self) -> None:
        """Nothing is left to write."""


def read_tum(path: str | Path) -> TimedPoses:
    """Read a TUM file, or a CSV with columns stamp, x, y, yaw (told by its header).

    Stamps are taken from their decimal text without passing through a float. Position z, roll and pitch are dropped.

    Raises
    ------
    UsageError
        If there is no such file.
    InputError
        If a line is not a pose or a stamp does not increase, naming the line; if there is no pose at all.

    """
    parse: Callable[[str], tuple[int, float, float, float]] | None = None
    stamps: list[int] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in _lines(path):
        try:
            if parse is None:
                parse = _csv_parser(line) if "," in line else _parse_tum
                if parse is not _parse_tum:
                    continue  # it was the header
            stamp, x, y, yaw = parse(line)
            if stamps and stamp <= stamps[-1]:
                raise ValueError(f"stamp {stamp_text(stamp)} does not increase")  # noqa: TRY301
        except ValueError as error:
            raise InputError(f"{path}: {error}, line {number}; {_EXPECTED}") from None
        stamps.append(stamp)
        poses.append((x, y, yaw))
    if not stamps:
        raise InputError(f"{path}: holds no pose; {_EXPECTED}")
    return _timed_poses(stamps, poses)


_EXPECTED = "expected lines 't x y z qx qy qz qw' (TUM) or a CSV with stamp, x, y, yaw, in order of time"


def _lines(path: str | Path) -> list[tuple[int, str]]:
    """Lines that are neither empty nor comments, with their numbers from 1."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig", "replace")
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file; check the name") from None
    except OSError as error:
        raise InputError(f"{path}: cannot read: {error.strerror or error}; check the file") from error
    numbered = enumerate((line.strip() for line in text.split("\n")), start=1)
    return [(number, line) for number, line in numbered if line and not line.startswith("#")]


def _timed_poses(stamps: list[int], poses: list[tuple[float, float, float]]) -> TimedPoses:
    result = TimedPoses(np.array(stamps, dtype=np.int64), np.array(poses, dtype=np.float64))
    result.stamps_ns.flags.writeable = False
    result.poses.flags.writeable = False
    return result


def _parse_tum(line: str) -> tuple[int, float, float, float]:
    fields = line.split()
    if len(fields) != 8:
        raise ValueError(f"{len(fields)} fields instead of 8")
    x, y, _, *quaternion = (_number(field) for field in fields[1:])
    norm = math.sqrt(sum(q * q for q in quaternion))
    if not abs(norm - 1.0) <= 1e-2:
        raise ValueError(f"quaternion of length {norm:.3g} instead of 1")
    qx, qy, qz, qw = quaternion
    return _stamp(fields[0]), x, y, math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)


def _csv_parser(header: str) -> Callable[[str], tuple[int, float, float, float]]:
    names = [name.strip() for name in header.split(",")]
    missing = [name for name in _CSV_COLUMNS if name not in names]
    if missing:
        raise ValueError(f"no column {', '.join(missing)} in the header")
    columns = [names.index(name) for name in _CSV_COLUMNS]

    def parse(line: str) -> tuple[int, float, float, float]:
        fields = line.split(",")
        if len(fields) != len(names):
            raise ValueError(f"{len(fields)} fields instead of {len(names)}")
        stamp, x, y, yaw = (fields[column] for column in columns)
        return _stamp(stamp), _number(x), _number(y), float(se2.wrap(_number(yaw)))

    return parse


def _number(text: str) -> float:
    value = float(text) if _DECIMAL.fullmatch(text.strip()) else math.nan
    if not math.isfinite(value):
        raise ValueError(f"{_quoted(text)} is not a finite number")
    return value


def _stamp(text: str) -> int:
    """Nanoseconds of a decimal number of seconds, exactly; digits past the ninth are rounded."""
    if not _DECIMAL.fullmatch(text.strip()):
        raise ValueError(f"{_quoted(text)} is not a stamp in seconds")
    stamp = int((Decimal(text.strip()) * NANOSECONDS).to_integral_value())
    if abs(stamp) > _MAX_NS:
        raise ValueError(f"stamp {_quoted(text)} is out of range")
    return stamp


def _quoted(text: str) -> str:
    return ascii(text[:40])
