"""What is wrong with a log although its bytes are in order: gaps, jumps of time, stamps that are off, loose frames.

Collected message by message beside the survey, for ``mcl info``.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.io.recording.clocks import CALENDAR_NS, Clocks
from mclcli.io.recording.stamps import SECOND, place_of_stamp
from mclcli.text import clean, counted

if TYPE_CHECKING:
    import struct
    from collections.abc import Collection, Iterable, Iterator

    from mclcli.arrays import BoolArray, IntArray
    from mclcli.geometry.frames import TransformTree
    from mclcli.io.logs.base import RawMessage

GAP = 5.0
"""A pause is a gap if it lasts over a second and so many times the topic's median interval."""
TOLD = 3
"""Gaps and jumps of a topic that are told one by one."""


@final
@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened at a time [ns]: a gap or jump of ``seconds``."""

    at_ns: int
    seconds: float


@final
@dataclass(frozen=True, slots=True)
class Times:
    """What the times of one topic say.

    ``interval`` is the median of the times between messages [s], None below two. ``lag`` are median, least and greatest
    of log time − header stamp [s], None where there are no stamps. ``zero_stamps`` counts headers that are not stamped.
    ``simulated``: most stamps are of no calendar.
    """

    interval: float | None
    gaps: tuple[Event, ...]
    jumps: tuple[Event, ...]
    stamp_jumps: tuple[Event, ...]
    lag: tuple[float, float, float] | None
    zero_stamps: int
    simulated: bool


@final
@dataclass(slots=True)
class _Topic:
    """Times of one topic as they come; ``layout`` tells where the stamp of a message is, None where it has none."""

    layout: struct.Struct | None
    at: int
    logged: array[int] = field(default_factory=lambda: array("q"))
    stamped: array[int] = field(default_factory=lambda: array("q"))


@final
@dataclass(slots=True)
class Diagnosis:
    """Takes every message of a log in, and says at the end what is odd about their times."""

    topics: dict[str, _Topic] = field(default_factory=dict)
    indexed: dict[str, IntArray] = field(default_factory=dict)  # log times of all messages, where only some are seen

    def watch(self, messages: Iterable[RawMessage]) -> Iterator[RawMessage]:
        """The messages themselves, each taken in on the way."""
        for message in messages:
            self.add(message)
            yield message

    def add(self, message: RawMessage) -> None:
        """Take one message in."""
        channel, log_ns, data = message[:3]
        topic = self.topics.get(channel.topic)
        if topic is None:
            topic = self.topics[channel.topic] = _Topic(*place_of_stamp(channel, data))
        topic.logged.append(log_ns)
        if topic.layout is not None and len(data) >= topic.at + 8:
            seconds, rest = topic.layout.unpack_from(data, topic.at)
            topic.stamped.append(seconds * SECOND + rest)

    def count_all(self, name: str, times: IntArray) -> None:
        """Take the log times of all messages of a topic from an index (N,); contents are known of those added."""
        self.topics.setdefault(name, _Topic(None, 0))
        self.indexed[name] = times

    def times(self, name: str) -> Times:
        """What the times of one topic say."""
        topic = self.topics[name]
        logged, stamped = np.array(topic.logged), np.array(topic.stamped)
        seen, logged = logged, self.indexed.get(name, logged)
        steps = np.diff(logged)
        interval = float(np.median(steps)) / SECOND if steps.size else None
        long = (steps > SECOND) & (steps > GAP * SECOND * (interval or 0.0))
        lags = (seen - stamped)[stamped != 0] if stamped.size == seen.size else np.array([], np.int64)
        lag = (float(np.median(lags)), float(lags.min()), float(lags.max())) if lags.size else None
        return Times(
            interval,
            _events(logged, steps, long),
            _events(logged, steps, steps < -SECOND),
            _jumps(stamped[stamped != 0]),
            None if lag is None else (lag[0] / SECOND, lag[1] / SECOND, lag[2] / SECOND),
            int((stamped == 0).sum()),
            bool(np.median(stamped[stamped != 0]) < CALENDAR_NS) if lags.size else False,
        )

    def problems(self, clocks: Clocks) -> list[str]:
        """One line for each thing that is odd, times in seconds into the log; what all stamps share is none."""
        return [
            f"{clean(name)}: {what}"
            for name in sorted(self.topics)
            for what in _oddities(self.times(name), clocks, " of the messages read" if name in self.indexed else "")
        ]


def loose_frames(tree: TransformTree, others: Collection[str] = ()) -> list[str]:
    """A line for frames that nothing connects, none if all hang together.

    Those that hang together with the bases of ``others``, robots, are apart with good reason.
    """
    apart = {tree.ancestors(base)[-1] for base in others}
    roots = sorted({tree.ancestors(frame)[-1] for frame in tree.frames} - apart)
    if len(roots) < 2:
        return []
    return [f"frames: {len(roots)} trees that nothing connects, with roots {', '.join(map(clean, roots))}"]


def _events(times: IntArray, steps: IntArray, which: BoolArray) -> tuple[Event, ...]:
    return tuple(Event(int(times[i]), abs(int(steps[i])) / SECOND) for i in np.flatnonzero(which))


def _jumps(stamps: IntArray) -> tuple[Event, ...]:
    steps = np.diff(stamps)
    return _events(stamps, steps, steps < -SECOND)


def _oddities(times: Times, clocks: Clocks, seen: str) -> Iterator[str]:
    """What is odd about one topic; ``seen`` qualifies what is known of some messages only."""
    logged_ns, stamped_ns = clocks.first_logged_ns, clocks.first_ns
    yield from _told("gap of", "more gaps over 1 s", times.gaps, logged_ns)
    yield from _told("log time jumps back by", "more such jumps", times.jumps, logged_ns)
    if not times.jumps:
        yield from _told(f"stamps{seen} jump back by", "more such jumps", times.stamp_jumps, stamped_ns)
    if times.zero_stamps:
        yield f"{_of(times.zero_stamps, seen)} not stamped (0)"
    if times.lag is not None:
        yield from _lag(times.lag, clocks, seen, simulated=times.simulated)


def _lag(lag: tuple[float, float, float], clocks: Clocks, seen: str, *, simulated: bool) -> Iterator[str]:
    """Stamps that are off what all share; simulated time may also run slower or faster than the recorder's."""
    if clocks.offset_ns and clocks.simulated and simulated:
        return
    middle, least, greatest = (value - clocks.offset_ns / SECOND for value in lag)
    others = "those of other topics" if clocks.offset_ns else "log time"
    if abs(middle) > 1.0:
        yield f"stamps{seen} are {abs(middle):.1f} s {'before' if middle > 0 else 'after'} {others} (median)"
    elif greatest - least > 1.0:
        yield f"stamps{seen} are between {-greatest:+.1f} s and {-least:+.1f} s of {others}"


def _of(count: int, seen: str) -> str:
    if seen:
        return f"{count}{seen} {'is' if count == 1 else 'are'}"
    return f"{counted(count, 'message')} {'is' if count == 1 else 'are'}"


def _told(what: str, more: str, events: tuple[Event, ...], origin_ns: int) -> Iterator[str]:
    for event in sorted(events, key=lambda event: -event.seconds)[:TOLD]:
        yield f"{what} {event.seconds:.1f} s at {(event.at_ns - origin_ns) / SECOND:.1f} s"
    rest = len(events) - TOLD
    if rest > 0:
        yield f"{rest} {more if rest > 1 else more.replace('gaps', 'gap').replace('jumps', 'jump')}"
