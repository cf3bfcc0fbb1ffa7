"""Trajectories as text: the TUM format, and the track CSV read back.

TUM: ``t x y z qx qy qz qw`` a line, ``#`` comments, as evo and the TUM RGB-D benchmark's tools read it.
"""

from __future__ import annotations

import logging
import math
import re
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError, UsageError
from mclcli.geometry import se2
from mclcli.geometry.trajectory import in_order
from mclcli.io.tables.pose_rows import Row, in_order_of_time
from mclcli.io.tables.text_file import read_stdin, refuse_stand_ins
from mclcli.io.traces.formats import Format, Writer
from mclcli.io.traces.sinks import COVARIANCE_COLUMNS, NANOSECONDS, require_finite, stamp_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.geometry.trajectory import Trajectory
    from mclcli.io.traces.formats import About
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.sinks import TextSink
    from mclcli.records import TrackPoint

_MAX_BYTES = 1 << 28  # of standard input
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d{1,3})?", re.ASCII | re.IGNORECASE)
_MAX_NS = 2**63 - 1
_SHORTEST, _LONGEST = 1e-3, 1e3  # lengths of quaternions that can be normalised
_CSV_COLUMNS = ("stamp", "x", "y", "yaw")
_COVARIANCE = COVARIANCE_COLUMNS.split(",")
_SYMMETRIC = [0, 1, 2, 1, 3, 4, 2, 4, 5]  # the upper triangle, row by row, to all nine


@final
class TumWriter:
    """Writes the track in the TUM format, every number with 9 decimals; z, qx and qy are 0.

    A ``caveat`` stands in a comment before the first pose.
    """

    __slots__ = ("_stream",)

    def __init__(self, stream: TextSink, caveat: str = "") -> None:
        self._stream = stream
        if caveat:
            stream.write(f"# {_CAVEAT}{caveat}\n")

    def write(self, point: TrackPoint) -> None:
        """Append one line; a ValueError if the pose is not finite."""
        require_finite("pose", point.estimate.pose)
        x, y, yaw = point.estimate.pose.tolist()
        qz, qw = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        flat = "0.000000000"
        self._stream.write(f"{stamp_text(point.stamp_ns)} {x:.9f} {y:.9f} {flat} {flat} {flat} {qz:.9f} {qw:.9f}\n")

    def close(self) -> None:
        """Nothing is left to write."""


def read_tum(source: str | Path, *, strict: bool = False) -> Trajectory:
    """Read a TUM file, or a CSV with columns stamp, x, y, yaw (told by its header); ``-`` is standard input.

    Stamps are taken from their decimal text without passing through a float. Position z, roll and pitch are dropped.
    Covariances (``cov_xx``…) and ``updated`` of a CSV come along where it has these columns; where its ``segment``
    changes the clock may have jumped back, and the later segment overrules what it covers.

    What a caveat in the first line says is repeated as a warning.
    Rows out of order are sorted, of equal stamps the first is kept, quaternions are normalised: each with a warning
    that counts them, or refused if ``strict``.

    Raises
    ------
    UsageError
        If there is no such file.
    InputError
        If a line is not a pose, or with ``strict`` not as it should be, naming the line; if there is no pose at all.

    """
    name = "standard input" if str(source) == "-" else str(source)
    parse: Callable[[int, str], Row] | None = None
    rows: list[Row] = []
    lines = _lines(source)
    if lines and (what := _other_format(lines[0][1], name)):
        raise InputError(f"{name}: {what}")
    for number, line in lines:
        try:
            if parse is None:
                parse = _csv_parser(line) if "," in line else _parse_tum
                if parse is not _parse_tum:
                    continue  # it was the header
            rows.append(parse(number, line))
        except ValueError as error:
            raise InputError(f"{name}: {error}, line {number}; {_EXPECTED}") from None
    if not rows:
        raise InputError(f"{name}: holds no pose; {_EXPECTED}")
    return _trajectory(in_order_of_time(rows, name, strict=strict))


_CAVEAT = "caveat: "
_EXPECTED = "expected lines 't x y z qx qy qz qw' (TUM) or a CSV with stamp, x, y, yaw"


def _lines(source: str | Path) -> list[tuple[int, str]]:
    """Lines that are neither empty nor comments, with their numbers from 1."""
    if str(source) == "-":
        data = read_stdin(_MAX_BYTES)
    else:
        try:
            data = Path(source).read_bytes()
        except FileNotFoundError:
            raise UsageError(f"{source}: no such file; check the name") from None
        except (OSError, ValueError) as error:  # ValueError: a NUL in the name
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{source}: cannot read: {reason}; name a file, or of a log LOG:TOPIC") from error
    name = "standard input" if str(source) == "-" else str(source)
    if data:
        refuse_stand_ins(data, name)
    if b"\0" in data:
        raise InputError(f"{name}: is not text; of a log name a topic as well, LOG:TOPIC")
    numbered = enumerate((line.strip() for line in data.decode("utf-8-sig", "replace").split("\n")), start=1)
    lines = [(number, line) for number, line in numbered if line]
    if lines and lines[0][1].startswith(f"# {_CAVEAT}"):
        logging.getLogger(__name__).warning("%s: %s", name, lines[0][1].removeprefix(f"# {_CAVEAT}"))
    return [(number, line) for number, line in lines if not line.startswith("#")]


def _trajectory(rows: list[Row]) -> Trajectory:
    covariances = None
    if rows[0].covariance:
        upper = np.array([row.covariance for row in rows], dtype=np.float64)
        covariances = upper[:, _SYMMETRIC].reshape(-1, 3, 3)
    result = in_order(
        np.array([row.stamp_ns for row in rows], dtype=np.int64),
        np.array([row.pose for row in rows], dtype=np.float64),
        covariances,
        np.array([row.updated for row in rows], dtype=np.bool_),
    )
    for array in (result.stamps_ns, result.poses, result.covariances, result.updated):
        if array is not None:
            array.flags.writeable = False
    return result


def _parse_tum(number: int, line: str) -> Row:
    fields = line.split()
    if len(fields) != 8:
        raise ValueError(f"{len(fields)} fields instead of 8")
    x, y, _, *quaternion = (_number(field) for field in fields[1:])
    norm = math.sqrt(sum(q * q for q in quaternion))
    if not _SHORTEST <= norm <= _LONGEST:
        raise ValueError(f"quaternion of length {norm:.3g} instead of 1")
    qx, qy, qz, qw = quaternion
    yaw = math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    return Row(number, _stamp(fields[0]), (x, y, yaw), norm=norm)


def _other_format(line: str, name: str) -> str:
    """What a file is by its first row, and how to convert it; empty if it may be one of ours."""
    blanks, commas = line.split(), [field.strip() for field in line.split(",")]
    if len(blanks) in {12, 13} and all(map(_is_number, blanks)):  # KITTI-360 puts the number of the frame before
        return (
            f"is a KITTI file ({len(blanks)} numbers a row: a 3 × 4 matrix, no stamp); convert it, with its "
            "times.txt, by evo's kitti_poses_and_timestamps_to_trajectory.py"
        )
    if len(commas) < 3 or not all(map(_is_number, commas)):
        return ""
    if len(commas) >= 8 and commas[0].isdigit() and int(commas[0][:20]) > _MAX_NS // NANOSECONDS:
        return (
            "is a EuRoC file (stamps in ns, quaternions with w first); convert it by "
            f"evo_traj euroc {name} --save_as_tum"
        )
    return f"has numbers between commas and no header; {_EXPECTED}"


def _csv_parser(header: str) -> Callable[[int, str], Row]:
    names = [name.strip() for name in header.split(",")]
    missing = [name for name in _CSV_COLUMNS if name not in names]
    if missing:
        raise ValueError(f"no column {', '.join(missing)} in the header")
    columns = [names.index(name) for name in _CSV_COLUMNS]
    spread = [names.index(name) for name in _COVARIANCE if name in names]
    spread = spread if len(spread) == len(_COVARIANCE) else []
    updated, segment = (names.index(name) if name in names else None for name in ("updated", "segment"))

    def parse(number: int, line: str) -> Row:
        fields = line.split(",")
        if len(fields) != len(names):
            raise ValueError(f"{len(fields)} fields instead of {len(names)}")
        stamp, x, y, yaw = (fields[column] for column in columns)
        pose = (_number(x), _number(y), float(se2.wrap(_number(yaw))))
        covariance = tuple(_number(fields[column]) for column in spread)
        measured = updated is None or fields[updated].strip() != "0"
        return Row(number, _stamp(stamp), pose, covariance, measured, "" if segment is None else fields[segment])

    return parse


def _is_number(text: str) -> bool:
    return _DECIMAL.fullmatch(text) is not None


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in text or not text.isascii():
        raise ValueError(f"{_quoted(text)} is not a finite number")
    return value


def _stamp(text: str) -> int:
    """Nanoseconds of a decimal number of seconds, exactly; digits past the ninth are rounded."""
    whole, _, rest = text.partition(".")
    if whole and len(rest) <= 9 and text.isascii() and f"{whole}{rest}".isdigit():
        stamp = int(whole[:20]) * NANOSECONDS + int(rest.ljust(9, "0"))  # as nearly every file has it
    elif _DECIMAL.fullmatch(text.strip()):
        stamp = int((Decimal(text.strip()) * NANOSECONDS).to_integral_value())
    else:
        raise ValueError(f"{_quoted(text)} is not a stamp in seconds")
    if abs(stamp) > _MAX_NS:
        raise ValueError(f"stamp {_quoted(text)} is out of range; seconds are expected, not nanoseconds")
    return stamp


def _quoted(text: str) -> str:
    return ascii(text[:40])


def _track(output: Output, about: About) -> Writer:
    track = TumWriter(output, about.caveat)
    return Writer(track.write, track.close)


TRACK = Format(_track)
