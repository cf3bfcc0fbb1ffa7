"""A first look through a log: which topics there are, what their first message looks like, how frames connect."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry.frames import TransformTree
from mclcli.io.logs.base import RawMessage, Tally
from mclcli.io.messages.decoding import DECODABLE, Undecodable, decode
from mclcli.io.messages.sightings import types_with
from mclcli.io.recording import transforms
from mclcli.io.recording.samples import EvenSample
from mclcli.io.recording.stamps import TRANSFORMS, stamp_in
from mclcli.io.recording.transforms import TransformSurvey

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from mclcli.arrays import IntArray
    from mclcli.io.logs.base import Channel
    from mclcli.records import Transform

_KEPT = {"nav_msgs/msg/Odometry": (3, 64), "sensor_msgs/msg/LaserScan": (1, 48)}
"""Of which types a sample is kept: messages that follow each other, and how many such runs."""
_SENSORS = frozenset({"sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", *types_with("rays"), *types_with("pixels")})


@final
@dataclass(slots=True)
class TopicSurvey:
    """One topic: its messages counted, the first one decoded (``sample``), or why that cannot be (``problem``).

    ``first_ns``, ``last_ns`` and ``longest_gap_ns`` are log times. ``first_stamp_ns`` is the first stamp but 0 of
    scans, odometry, sightings and moving transforms (``tells_time``), None while none came (``awaits_stamp``);
    ``offset_ns`` is its log time − itself. Of odometry and scans ``kept`` has some messages, evenly spread, as they are
    recorded; ``space`` is where its transforms belong.
    """

    channel: Channel
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    longest_gap_ns: int = 0
    sample: object | None = None
    problem: str = ""
    kept: EvenSample[RawMessage] | None = None
    space: TransformSurvey | None = None
    first_stamp_ns: int | None = None
    offset_ns: int = 0
    tells_time: bool = field(init=False)
    awaits_stamp: bool = field(init=False)
    awaits_sample: bool = field(init=False)

    def __post_init__(self) -> None:
        static = self.channel.topic.endswith("tf_static")
        self.tells_time = self.channel.type in _SENSORS or (self.carries_transforms and not static)
        self.awaits_stamp = self.tells_time
        self.awaits_sample = self.channel.type in DECODABLE
        if self.channel.type in _KEPT:
            self.kept = EvenSample(*_KEPT[self.channel.type])

    def kept_runs(self) -> list[list[object]]:
        """The messages of ``kept``, decoded, run by run; those that cannot be are left out."""
        runs = [[decode(message) for message in run] for run in (self.kept.runs if self.kept else [])]
        return [[record for record in run if not isinstance(record, Undecodable)] for run in runs]

    @property
    def carries_transforms(self) -> bool:
        """Whether its messages are transforms."""
        return self.channel.type in TRANSFORMS

    @property
    def rate(self) -> float | None:
        """Messages per second, None below two messages."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) / (span_ns * 1e-9) if span_ns > 0 else None

    def see_stamp(self, message: RawMessage) -> None:
        """Take the first stamp from one of its messages, if that is stamped."""
        self.first_stamp_ns = stamp_in(message)
        self.offset_ns = message.log_time_ns - (self.first_stamp_ns or 0)
        self.awaits_stamp = not self.first_stamp_ns

    def count_one(self, log_time_ns: int) -> None:
        """Take one message's time in."""
        if self.count == 0:
            self.first_ns = self.last_ns = log_time_ns
        since_ns = log_time_ns - self.last_ns  # no min() and max(): this is done for every message
        if since_ns > 0:
            self.last_ns = log_time_ns
            self.longest_gap_ns = max(self.longest_gap_ns, since_ns)
        elif log_time_ns < self.first_ns:
            self.first_ns = log_time_ns
        self.count += 1

    def count_all(self, times: IntArray) -> None:
        """Take the log times of all messages from an index (N,), in place of those counted so far."""
        latest = np.maximum.accumulate(times)
        self.count, self.first_ns, self.last_ns = times.size, int(times.min()), int(latest[-1])
        self.longest_gap_ns = int(np.max(times[1:] - latest[:-1], initial=0))


@final
@dataclass(slots=True)
class LogSurvey:
    """What a look through a log found: ``topics`` by name, and the ``transforms`` by the namespace of their topics.

    ``complete`` unless only the beginning of a stream was looked at. ``silent`` are topics without a message. ``tally``
    notes what was changed or left out in the messages decoded, which nobody has told yet.
    """

    topics: dict[str, TopicSurvey] = field(default_factory=dict)
    transforms: dict[str, TransformSurvey] = field(default_factory=dict)
    complete: bool = True
    silent: dict[str, Channel] = field(default_factory=dict)
    tally: Tally = field(default_factory=lambda: Tally(announce=False))

    @property
    def frames(self) -> TransformTree:
        """The tree of all frames, whatever topic they came on; see ``Roles.frames`` for those of one robot."""
        trees = [self.transforms[name].tree for name in sorted(self.transforms)]
        return trees[0] if len(trees) == 1 else TransformTree.union(trees)

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
        return tuple(topic for space in self.transforms.values() for topic in space.topics)

    def within(self, topics: Collection[str]) -> LogSurvey:
        """The same survey with the transforms alone of the namespaces of some topics of transforms."""
        kept = {name: space for name, space in self.transforms.items() if not set(space.topics).isdisjoint(topics)}
        return replace(self, transforms=kept)

    def topic_named(self, name: str) -> str:
        """The topic that a name means, written with or without a leading slash; the name itself if there is none."""
        if name in self.topics:
            return name
        return next((topic for topic in self.topics if topic.lstrip("/") == name.lstrip("/")), name)

    def of_type(self, *types: str) -> list[TopicSurvey]:
        """Topics of these types that have a decodable message, by name."""
        usable = (topic for topic in self.topics.values() if topic.sample is not None and topic.channel.type in types)
        return sorted(usable, key=lambda topic: topic.channel.topic)

    def swing(self, tree: TransformTree, a: str, b: str) -> tuple[float, float] | None:
        """How far [m, rad] a frame ``b`` goes in ``a`` from where it is at first; None if nothing between them moves.

        Several moving edges add up. It is known from a sample.
        """
        moving = [frame for frame in set(tree.ancestors(a)) ^ set(tree.ancestors(b)) if tree.moves(frame)]
        if not moving or not tree.connected(a, b):
            return None
        edges = [(tree.parent(frame) or "", frame) for frame in moving]
        travels = [space.travel(edge) for edge in edges for space in self.transforms.values() if edge in space.sampled]
        return sum(metres for metres, _ in travels), sum(radians for _, radians in travels)

    def statics(self, topics: Collection[str]) -> tuple[Transform, ...]:
        """Fixed transforms, the latest of each child, of the namespaces of some topics of transforms."""
        spaces = [space for space in self.transforms.values() if not set(space.topics).isdisjoint(topics)]
        return tuple({child: fixed for space in spaces for child, fixed in space.statics.items()}.values())

    def of_transforms(self, topic: str) -> TransformSurvey:
        """Where the transforms of a topic belong."""
        return self.transforms.setdefault(transforms.namespace_of(topic), TransformSurvey())

    def add(self, message: RawMessage) -> None:
        """Take one message in; only transforms, and one message of each other topic, are decoded."""
        topic = self.topics.get(message.channel.topic)
        if topic is None:
            topic = self.topics[message.channel.topic] = TopicSurvey(message.channel)
        topic.count_one(message.log_time_ns)
        if topic.awaits_sample:
            self._decode(topic, message)
        if topic.awaits_stamp and topic.sample is not None:
            topic.see_stamp(message)
        kept = topic.kept
        if kept is not None and kept.wants():
            kept.keep(message)

    def _decode(self, topic: TopicSurvey, message: RawMessage) -> None:
        record = decode(message, self.tally)
        if isinstance(record, Undecodable):
            topic.problem = topic.problem or record.reason
            return
        topic.sample = topic.sample or record
        topic.awaits_sample = topic.carries_transforms
        if isinstance(record, tuple):
            if topic.space is None:
                topic.space = self.of_transforms(topic.channel.topic)
            topic.space.add(topic.channel.topic, record)


def survey_log(messages: Iterable[RawMessage], result: LogSurvey | None = None) -> LogSurvey:
    """Look through these messages; ``result`` is the survey that takes them in, a new one by default."""
    result = LogSurvey() if result is None else result
    for message in messages:
        result.add(message)
    return result
