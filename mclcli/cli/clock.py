"""Times within a log, as people write them."""

from __future__ import annotations

import datetime as dt
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Literal, final

from mclcli.errors import UsageError
from mclcli.io.recording.clocks import CALENDAR_NS

_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d{1,9})?))?")
_SECOND = 1_000_000_000


@final
@dataclass(frozen=True, slots=True)
class LogTime:
    """A time as it was written for an ``option``.

    ``ns`` are nanoseconds since the log's first stamp, since 1970, by the ``calendar`` since 1970, or since midnight of
    the day of the first stamp.
    """

    text: str
    ns: int
    since: Literal["first", "epoch", "calendar", "midnight"]
    option: str

    def stamp_ns(self, first_ns: int) -> int:
        """Stamp [ns] in a log whose first stamp is ``first_ns``.

        Raises
        ------
        UsageError
            If it is a clock time, and the log's stamps are of no calendar.

        """
        if self.since == "first":
            return first_ns + self.ns
        if self.since != "epoch" and first_ns < CALENDAR_NS:
            raise UsageError(
                f"{self.option}: the log's stamps are of no calendar (they begin at {first_ns * 1e-9:.3f} s), so "
                f"'{self.text}' means nothing there; write seconds from the start (12.5) or @SECONDS"
            )
        return (_midnight(first_ns) if self.since == "midnight" else 0) + self.ns


def parse_time(text: str, option: str) -> LogTime:
    """Time of ``12.5``, seconds after the log's first stamp; ``@1663967375.8``, absolute seconds; ``14:32:05``, on
    the day of the first stamp (UTC); or ISO 8601 (UTC unless it states an offset).

    Raises
    ------
    UsageError
        If the text is none of these.

    """  # noqa: D205 - the four forms are the summary
    if text.startswith("@"):
        return LogTime(text, _seconds(text[1:], text, option), "epoch", option)
    if clock := _CLOCK.fullmatch(text):
        return LogTime(text, _of_day(clock, text, option), "midnight", option)
    if re.match(r"\d{4}-\d{2}-\d{2}", text):
        return LogTime(text, _iso(text, option), "calendar", option)
    return LogTime(text, _seconds(text, text, option), "first", option)


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

    Simulated clocks start at 0 or so: what lies before 1990 is not taken for a date.
    """
    seconds, rest = divmod(stamp_ns, _SECOND)
    if stamp_ns < CALENDAR_NS:
        return f"@{stamp_ns * 1e-9:.3f}"
    moment = dt.datetime(1970, 1, 1, tzinfo=dt.UTC) + dt.timedelta(seconds=seconds)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{rest // 1_000_000:03d} UTC"
