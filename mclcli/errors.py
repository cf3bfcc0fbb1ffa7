"""Everything mcl raises on purpose, and the exit codes of the command line.

A message says what is wrong, where, and what to do, in one line: ``FILE: what, where; what to do``.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from collections.abc import Sequence


class ExitCode(IntEnum):
    """How a command ends; beyond these, 128 + the number of a signal that ended it."""

    COMPLETE = 0
    FAILED = 1  # files give no usable result, or reading or writing failed
    USAGE = 2  # command line or parameter value
    DAMAGED = 3  # finished, but data that was needed was damaged, missing or undecodable
    MISSED = 4  # a limit that was asked for is not kept
    AMBIGUOUS = 5  # more than one answer is likely
    INTERNAL = 70  # a bug in mcl


class MclError(Exception):
    """An expected failure, told to the user in one line."""

    exit_code: ClassVar[ExitCode] = ExitCode.FAILED


class InputError(MclError):
    """Files exist but give no usable result, or reading or writing them failed."""


class UsageError(MclError):
    """The command line or a parameter's value is wrong."""

    exit_code: ClassVar[ExitCode] = ExitCode.USAGE


class AmbiguousRobotError(UsageError):
    """A log has several robots of these ``names``, and nothing says which one is meant."""

    def __init__(self, names: Sequence[str]) -> None:
        told = ", ".join(names)
        super().__init__(f"the log has {len(names)} robots, {told}; say which one is meant with --robot NAME")
        self.names = tuple(names)


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
