"""Everything mcl raises on purpose, and the exit code each ends the command line with.

    MclError
    ├── InputError       1   files exist but give no usable result, or I/O failed
    ├── UsageError       2   command line or parameter value
    ├── ThresholdMissed  4   a threshold that was asked for
    └── AmbiguousResult  5   more than one answer

A message says what is wrong, where, and what to do, in one line: ``FILE: what, where; what to do``.
Exit code 3 (finished, but needed data was damaged) is a result, not an error: see ``mclcli.io.logs.base``.
"""

from __future__ import annotations

from typing import ClassVar


class MclError(Exception):
    """An expected failure, told to the user in one line."""

    exit_code: ClassVar[int] = 1


class InputError(MclError):
    """Files exist but give no usable result, or reading or writing them failed."""


class UsageError(MclError):
    """The command line or a parameter's value is wrong."""

    exit_code: ClassVar[int] = 2


class ThresholdMissed(MclError):  # noqa: N818 - names the outcome
    """A threshold that the caller asked for was missed."""

    exit_code: ClassVar[int] = 4


class AmbiguousResult(MclError):  # noqa: N818 - names the outcome
    """The data admit more than one answer."""

    exit_code: ClassVar[int] = 5


def nearest_name(name: str, known: list[str]) -> str:
    """Hint ``; did you mean 'x'?`` naming the known name most like ``name``, or an empty string.

    Parameters
    ----------
    name
        What the user wrote.
    known
        The names that exist.

    """
    import difflib

    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else ""
