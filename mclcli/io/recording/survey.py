"""A first look through a log: which topics there are, what their first message looks like, how frames connect."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry.frames import TransformTree
from mclcli.io.logs.base import Tally
from mclcli.io.messages.decoding import DECODABLE, Undecodable, decode

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.arrays import IntArray
    from mclcli.io.logs.base import Channel, RawMessage
    from mclcli.records import Transform

_TRANSFORMS = frozenset({"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"})


@final
@dataclass(slots=True)
class TopicSurvey:
    """One topic: its messages counted, the first one decoded (``sample``), or why that cannot be (``problem``).

    ``first_ns``, ``last_ns`` and ``longest_gap_ns`` are log times.
    """

    channel: Channel
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    longest_gap_ns: int = 0
    sample: object | None = None
    problem: str = ""

    @property
    def rate(self) -> float | None:
        """Messages per second, None below two messages."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) / (span_ns * 1e-9) if span_ns > 0 else None

    def count_one(self, log_time_ns: int) -> None:
        """Take one message's time in."""
        if self.count == 0:
            self.first_ns = self.last_ns = log_time_ns
        self.longest_gap_ns = max(self.longest_gap_ns, log_time_ns - self.last_ns)
        self.first_ns, self.last_ns = min(self.first_ns, log_time_ns), max(self.last_ns, log_time_ns)
        self.count += 1

    def count_all(self, times: IntArray) -> None:
        """Take the log times of all messages from an index (N,), in place of those counted so far."""
        latest = np.maximum.accumulate(times)
        self.count, self.first_ns, self.last_ns = times.size, int(times.min()), int(latest[-1])
        self.longest_gap_ns = int(np.max(times[1:] - latest[:-1], initial=0))


@final
@dataclass(slots=True)
class LogSurvey:
    """What a look through a log found: ``topics`` by name, the tree of ``frames``, ``statics`` by child.

    ``complete`` unless only the beginning of a stream was looked at. ``silent`` are topics without a message. ``tally``
    notes what was changed or left out in the messages decoded, which nobody has told yet.
    """

    topics: dict[str, TopicSurvey] = field(default_factory=dict)
    frames: TransformTree = field(default_factory=lambda: TransformTree(keep_history=False))
    statics: dict[str, Transform] = field(default_factory=dict)
    complete: bool = True
    silent: dict[str, Channel] = field(default_factory=dict)
    tally: Tally = field(default_factory=lambda: Tally(announce=False))

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last log time, None for an empty log."""
        counted = [topic for topic in self.topics.values() if topic.count]
        if not counted:
            return None
        return min(t.first_ns for t in counted), max(t.last_ns for t in counted)

    @property
    def transform_topics(self) -> tuple[str, ...]:
        """Topics that carry transforms."""
        return tuple(name for name, topic in self.topics.items() if topic.channel.type in _TRANSFORMS)

    def of_type(self, *types: str) -> list[TopicSurvey]:
        """Topics of these types that have a decodable message, by name."""
        usable = (topic for topic in self.topics.values() if topic.sample is not None and topic.channel.type in types)
        return sorted(usable, key=lambda topic: topic.channel.topic)

    def add(self, message: RawMessage) -> None:
        """Take one message in; only transforms, and one message of each other topic, are decoded."""
        channel = message.channel
        topic = self.topics.setdefault(channel.topic, TopicSurvey(channel))
        topic.count_one(message.log_time_ns)
        if channel.type in _TRANSFORMS or (topic.sample is None and channel.type in DECODABLE):
            self._decode(topic, message)

    def _decode(self, topic: TopicSurvey, message: RawMessage) -> None:
        record = decode(message, self.tally)
        if isinstance(record, Undecodable):
            topic.problem = topic.problem or record.reason
            return
        topic.sample = topic.sample or record
        for transform in record if isinstance(record, tuple) else ():
            self.frames.add(transform)
            if transform.static:
                self.statics[transform.child] = transform


def survey_log(messages: Iterable[RawMessage]) -> LogSurvey:
    """Look through these messages."""
    result = LogSurvey()
    for message in messages:
        result.add(message)
    return result
