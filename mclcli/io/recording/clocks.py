"""The two clocks of a log: stamps, which the sensors wrote, and log times, which the recorder wrote.

A recorder beside a simulation writes its own time: the two differ by decades. What counts is when something was seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.io.recording.stamps import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.io.recording.survey import LogSurvey, TopicSurvey

CALENDAR_NS = 631_152_000 * SECOND
"""Stamps before this (1990) are of no calendar: simulated time begins at 0 or so, and so do clocks never set."""
_ONE_NS = SECOND
_ALIKE_NS = 60 * SECOND


@final
@dataclass(frozen=True, slots=True)
class Clocks:
    """How the clocks of a log stand to each other.

    ``first_ns`` is the first stamp of scans, odometry and sightings, from which "seconds into the log" are counted;
    ``offset_ns`` is log time − stamp, 0 where they are within 1 s of each other.
    """

    first_ns: int
    offset_ns: int = 0

    @property
    def first_logged_ns(self) -> int:
        """Log time of ``first_ns``: where log times are all that is known, seconds are counted from here."""
        return self.first_ns + self.offset_ns

    @property
    def simulated(self) -> bool:
        """Whether stamps are of no calendar, so that no clock time can be told."""
        return self.first_ns < CALENDAR_NS

    def describe(self) -> str:
        """One line on how they differ, empty where they do not."""
        if not self.offset_ns:
            return ""
        counted = "seconds into the log count from the first stamp"
        if self.simulated and self.first_logged_ns >= CALENDAR_NS:
            begin = f"they begin at {self.first_ns / SECOND:.3f} s, log times are the recorder's"
            return f"stamps are simulation time: {begin}; {counted}"
        side = "before" if self.offset_ns > 0 else "after"
        return f"stamps are {abs(self.offset_ns) / SECOND:.1f} s {side} log time; {counted}"


def clocks_of(survey: LogSurvey) -> Clocks:
    """Clocks of a log that was looked through.

    Topics of scans, odometry, sightings and moving transforms vote: one whose clock was never set does not count.
    """
    stamped = [topic for topic in survey.topics.values() if topic.first_stamp_ns]
    offset_ns = _common([topic.offset_ns for topic in stamped])
    firsts = [
        topic.first_stamp_ns or topic.first_ns - offset_ns
        for topic in survey.topics.values()
        if topic.tells_time and not topic.carries_transforms and _is_of(topic, offset_ns)
    ]
    begin_ns = (survey.span_ns or (0, 0))[0]
    return Clocks(min(firsts, default=begin_ns - offset_ns), offset_ns)


def _is_of(topic: TopicSurvey, offset_ns: int) -> bool:
    """Whether a topic's stamps are of the clock with this offset; one without stamps gets log times."""
    return topic.sample is not None and (
        not topic.first_stamp_ns or abs(topic.offset_ns - offset_ns) <= _ALIKE_NS + _ONE_NS
    )


def _common(offsets: Sequence[int]) -> int:
    """The offset that most topics share, the smaller one of two; 0 up to 1 s."""

    def support(offset: int) -> tuple[int, int]:
        return sum(abs(other - offset) <= _ALIKE_NS for other in offsets), -abs(offset)

    common = max(offsets, key=support, default=0)
    return common if abs(common) > _ONE_NS else 0
