"""Times within a log, as people write them."""

from __future__ import annotations

import datetime as dt
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Literal, final

from mclcli.errors import UsageError

_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d{1,9})?))?")
_SECOND = 1_000_000_000


@final
@dataclass(frozen=True, slots=True)
class LogTime:
    """A time as it was written: ``ns`` nanoseconds after the log's first message, 1970, or the first message's day."""

    text: str
    ns: int
    since: Literal["first", "epoch", "midnight"]

    def stamp_ns(self, first_ns: int) -> int:
        """Stamp [ns] in a log whose first message is of ``first_ns``."""
        match self.since:
            case "first":
                return first_ns + self.ns
            case "midnight":
                return _midnight(first_ns) + self.ns
            case "epoch":
                return self.ns


def parse_time(text: str, option: str) -> LogTime:
    """Time of ``12.5``, seconds after the log's first message; ``@1663967375.8``, absolute seconds; ``14:32:05``, on
    the day of the first message (UTC); or ISO 8601 (UTC unless it states an offset).

    Raises
    ------
    UsageError
        If the text is none of these.

    """  # noqa: D205 - the four forms are the summary
    if text.startswith("@"):
        return LogTime(text, _seconds(text[1:], text, option), "epoch")
    if clock := _CLOCK.fullmatch(text):
        return LogTime(text, _of_day(clock, text, option), "midnight")
    if re.match(r"\d{4}-\d{2}-\d{2}", text):
        return LogTime(text, _iso(text, option), "epoch")
    return LogTime(text, _seconds(text, text, option), "first")


def parse_seconds(text: str, option: str) -> int:
    """Duration [ns] from a number of seconds, digit by digit, without rounding through a float."""
    return _seconds(text, text, option)


def _seconds(number: str, text: str, option: str) -> int:
    try:
        value = Decimal(number.strip().removesuffix("s")) * _SECOND
        in_range = abs(value) < 2**62  # asked before int(), which spells every digit of 1e999999 out
        nanoseconds = int(value.to_integral_value()) if in_range else 0
    except (ArithmeticError, ValueError):  # decimal's own errors are ArithmeticErrors
        raise UsageError(
            f"{option}: '{text}' is not a time; write seconds from the start (12.5), @SECONDS, 14:32:05 or ISO 8601"
        ) from None
    if not in_range:
        raise UsageError(f"{option}: '{text}' is out of range")
    return nanoseconds


def _midnight(stamp_ns: int) -> int:
    day = 86_400 * _SECOND
    return stamp_ns // day * day


def _of_day(clock: re.Match[str], text: str, option: str) -> int:
    hours, minutes, seconds = int(clock[1]), int(clock[2]), Decimal(clock[3] or 0)
    if hours > 23 or minutes > 59 or seconds >= 60:
        raise UsageError(f"{option}: '{text}' is not a time of day")
    return (hours * 3600 + minutes * 60) * _SECOND + int(seconds * _SECOND)


def _iso(text: str, option: str) -> int:
    try:
        moment = dt.datetime.fromisoformat(text)
    except ValueError:
        raise UsageError(f"{option}: '{text}' is not an ISO 8601 time such as 2022-09-23T21:09:35") from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=dt.UTC)
    since = moment - dt.datetime(1970, 1, 1, tzinfo=dt.UTC)
    return (since.days * 86_400 + since.seconds) * _SECOND + since.microseconds * 1000


def clock_text(stamp_ns: int) -> str:
    """Stamp as clock time in UTC, ``2022-09-23 21:09:35.123 UTC``; of a clock that did not know the year, ``@SECONDS``.

    Simulated clocks start at 0 or so: what lies before 2001 is not taken for a date.
    """
    seconds, rest = divmod(stamp_ns, _SECOND)
    if seconds < 1_000_000_000:
        return f"@{stamp_ns * 1e-9:.3f}"
    moment = dt.datetime(1970, 1, 1, tzinfo=dt.UTC) + dt.timedelta(seconds=seconds)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{rest // 1_000_000:03d} UTC"
