"""Poses of text files as benchmarks publish them, set right: stamps twice, rows out of order, long quaternions.

Each is told with its count, or refused where that is asked for.
"""

from __future__ import annotations

import logging
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

from mclcli.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable


class Row(NamedTuple):
    """One pose of a file: what stands on its line, x, y [m], yaw [rad], and the length of its quaternion."""

    line: int
    stamp_ns: int
    pose: tuple[float, float, float]
    covariance: tuple[float, ...] = ()
    updated: bool = True
    segment: str = ""
    norm: float = 1.0


def in_order_of_time(rows: list[Row], name: str, *, strict: bool = False) -> list[Row]:
    """Rows in order of time within each segment; of equal stamps the first row of the file.

    ``name`` is what messages call the file. The segments themselves stay as they follow one another.

    Raises
    ------
    InputError
        With ``strict``, if a stamp does not increase within its segment or a quaternion is not of length 1.

    """
    long = [row for row in rows if not abs(row.norm - 1.0) <= _TOLERANCE]
    late, again, kept = _sorted_out(rows)
    for odd, what, done, cure in (
        (long, "have a quaternion of another length than 1", "normalised", "normalise it"),
        (late, "are not in order of time", "sorted", "sort the rows"),
        (again, "have the stamp of an earlier one", "the first of each is used", "keep one row of each stamp"),
    ):
        if odd and strict:
            raise InputError(f"{name}: rows {what}, first on line {odd[0].line} ({len(odd)} in all); {cure}")
        if odd:
            text = "%s: rows that %s: %d, first on line %d; %s"
            logging.getLogger("mclcli").warning(text, name, what, len(odd), odd[0].line, done)
    return kept


_TOLERANCE = 1e-2


def _sorted_out(rows: Iterable[Row]) -> tuple[list[Row], list[Row], list[Row]]:
    """Rows that are late, rows whose stamp was there, and all others in order; segment by segment."""
    late: list[Row] = []
    again: list[Row] = []
    kept: list[Row] = []
    for _, group in groupby(rows, attrgetter("segment")):
        part = list(group)
        newest = part[0].stamp_ns
        for row in part:
            if row.stamp_ns < newest:
                late.append(row)
            newest = max(newest, row.stamp_ns)
        last: int | None = None
        for row in sorted(part, key=attrgetter("stamp_ns")):  # stable: of equal stamps the first stays first
            (again if row.stamp_ns == last else kept).append(row)
            last = row.stamp_ns
    return late, again, kept
