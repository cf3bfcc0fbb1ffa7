"""What every container of messages looks like from outside: channels, raw messages, damage, and the running count."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol, final

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

LARGE = 1 << 24
"""Messages from this size on [bytes] are views of their chunk, so that they are in memory once."""
_OVERLAP_NS = 10**9
_SENSORS = frozenset({"sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"})


@final
@dataclass(frozen=True, slots=True)
class Recorded:
    """How a file itself describes a channel, word for word, so that it can be written again.

    ``schema`` is the definition's bytes, ``form`` their encoding (``ros2msg``, ``jsonschema``…), ``name`` the type as
    it stands there; ``metadata`` the channel's own pairs (QoS, md5sum, latching).
    """

    name: str
    form: str
    schema: bytes
    metadata: tuple[tuple[str, str], ...] = ()


@final
@dataclass(frozen=True, slots=True)
class Channel:
    """One stream of messages in a log.

    ``type`` is always written as in ROS 2 (``sensor_msgs/msg/LaserScan``). ``encoding`` is ``cdr``, ``ros1`` or
    what the file says (``json``…). ``definition`` is the recorded message definition, ``digest`` the ROS 1 md5sum;
    both empty where the container has none. ``latched`` marks transient-local or latched publishers.
    """

    topic: str
    type: str
    encoding: str
    definition: str = ""
    digest: str = ""
    latched: bool = False
    recorded: Recorded | None = field(default=None, compare=False)


@final
class RawMessage(NamedTuple):
    """One message as recorded, not decoded; ``publish_ns`` and ``sequence`` where the container has them.

    A tuple: there are millions.
    """

    channel: Channel
    log_time_ns: int
    data: bytes
    publish_ns: int | None = None
    sequence: int | None = None


@final
@dataclass(frozen=True, slots=True)
class PassedOver:
    """Messages of one channel that were there, whole, and not wanted: a count in place of their contents."""

    channel: Channel
    messages: int
    first_ns: int
    last_ns: int


@final
@dataclass(frozen=True, slots=True)
class Damage:
    """Bytes of a file that could not be used, reported in place of the messages they held.

    ``lossless`` damage (bytes after the end, a damaged summary) costs a warning but no data. ``messages`` is
    how many messages are known to be lost, None if unknown, negative for those said to be lost before that were read
    after all; with ``least`` there may have been more. ``first_ns``/``last_ns`` is the span they covered, if known.
    ``in_all``: a file's last word, with which the numbers add up, whatever earlier damages could not count.
    """

    source: str
    offset: int
    what: str
    messages: int | None = None
    first_ns: int | None = None
    last_ns: int | None = None
    lossless: bool = False
    in_all: bool = False
    least: bool = False

    def describe(self, origin_ns: int | None) -> str:
        """One line for the user, times in seconds after ``origin_ns`` (the log's first message)."""
        if self.lossless or self.messages == 0:
            return f"{self.source}: {self.what}"
        span = ""
        if self.first_ns is not None and self.last_ns is not None:
            start = self.first_ns if origin_ns is None else origin_ns
            span = f" ({(self.first_ns - start) / 1e9:.1f}–{(self.last_ns - start) / 1e9:.1f} s)"
        if self.messages is None:
            return f"{self.source}: {self.what}" + (f"; messages{span} skipped" if span else "")
        count = f"{'at least ' * self.least}{self.messages} message{'s'[: self.messages != 1]}"
        return f"{self.source}: {self.what}; {count}{span} skipped"


@final
@dataclass(frozen=True, slots=True)
class FileFacts:
    """What one file is: ``kind`` of container, whether it was ``closed``, and whether it has ``checksums``.

    ``checksums`` is ``yes`` where every message is covered by one, ``no``, ``in part``, or ``unknown`` where none came.
    """

    source: str
    kind: str
    closed: bool
    checksums: str


@final
@dataclass(frozen=True, slots=True)
class Heading:
    """What an MCAP says of itself: its ``profile`` and the ``library`` that wrote it."""

    profile: str
    library: str


@final
@dataclass(frozen=True, slots=True)
class Attachment:
    """A file that stands within a log; times in ns."""

    name: str
    media_type: str
    log_time_ns: int
    create_time_ns: int
    data: bytes


@final
@dataclass(frozen=True, slots=True)
class MetadataRecord:
    """Pairs of texts that a log holds under a name."""

    name: str
    pairs: tuple[tuple[str, str], ...]


Beside = Heading | Attachment | MetadataRecord
"""What a log holds beside its messages."""
Item = Channel | RawMessage | PassedOver | Damage | FileFacts | Heading | Attachment | MetadataRecord


class Guess(Protocol):
    """Makes a channel, of its number in the file and one message, where nothing in the file describes it."""

    def __call__(self, number: int, data: bytes) -> Channel | None:
        """Channel of the message, None if nobody can tell: then it is lost."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Wish:
    """What a reader wants of a log: which channels (None: all), and whether what stands beside the messages.

    ``guess`` is asked for channels that nothing in the file describes; without one their messages are lost.
    """

    channels: Callable[[Channel], bool] | None = None
    beside: bool = False
    guess: Guess | None = None


EVERYTHING = Wish()
"""All messages, and nothing beside them."""
DEFINITIONS = Wish(lambda _: False)
"""What a pass is asked for that looks for schemas and channels only."""


class Container(Protocol):
    """A file of messages. Reading never raises for damaged content: it yields ``Damage`` and goes on."""

    @property
    def source(self) -> str:
        """Base name of the file, for messages to the user."""
        ...

    def items(self, wish: Wish = EVERYTHING) -> Iterator[Item]:
        """Everything in file order, from the start; each channel before its first message, last what the file is.

        Messages of channels that are not wished for come as ``PassedOver``: the very first at once (it may be the
        first message of the log), the others summed up when convenient.
        """
        ...


@final
@dataclass(slots=True)
class Span:
    """First and last log time of the scans and odometry of a log, and their ``topics``.

    ``argument`` counts what the user named, a folder's files being one; ``name`` is that of its first file.
    """

    name: str
    argument: int
    first_ns: int = 0
    last_ns: int = 0
    topics: set[str] = field(default_factory=set)

    def watch(self, items: Iterator[Item]) -> Iterator[Item]:
        """The items themselves, each taken in on the way."""
        for item in items:
            if isinstance(item, RawMessage) and item.channel.type in _SENSORS:
                self.take(item.channel.topic, item.log_time_ns)
            yield item

    def take(self, topic: str, time_ns: int) -> None:
        """Take one message in."""
        if not self.topics:
            self.first_ns = self.last_ns = time_ns
        self.first_ns, self.last_ns = min(self.first_ns, time_ns), max(self.last_ns, time_ns)
        self.topics.add(topic)

    def together(self, other: Span) -> set[str]:
        """Topics that both recorded at the same time: not one drive, whatever their names."""
        shared_ns = min(self.last_ns, other.last_ns) - max(self.first_ns, other.first_ns)
        return self.topics & other.topics if shared_ns > _OVERLAP_NS else set()


@final
@dataclass(slots=True)
class Tally:
    """What became of every message of a log; filled while the log is read (the one mutable thing here).

    ``read`` counts messages handed out, by topic; ``skipped`` those that were not used, by topic and reason; ``notes``
    what was changed or left out in messages that were used. ``first_ns``/``last_ns`` span all messages seen so far,
    wanted or not; ``spans`` those of each of several files. Unless ``announce`` is off, the first of each kind on a
    topic is warned of.
    """

    read: dict[str, int] = field(default_factory=dict)
    skipped: dict[str, dict[str, int]] = field(default_factory=dict)
    notes: dict[str, dict[str, int]] = field(default_factory=dict)
    damages: list[Damage] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    files: list[FileFacts] = field(default_factory=list)
    first_ns: int | None = None
    last_ns: int | None = None
    undecodable: int = 0
    spans: list[Span] = field(default_factory=list)
    announce: bool = True

    @property
    def lossy(self) -> bool:
        """Whether messages were damaged, missing or undecodable (exit code 3)."""
        return self.undecodable > 0 or any(not damage.lossless for damage in self.damages)

    def lost(self) -> tuple[int, bool]:
        """Messages said to be lost, and whether an unknown number was lost as well.

        A file's last word settles what its damages before could not count.
        """
        settled = {damage.source for damage in self.damages if damage.in_all}
        losses = [damage for damage in self.damages if not damage.lossless]
        unknown = any((damage.messages is None or damage.least) and damage.source not in settled for damage in losses)
        return sum(damage.messages or 0 for damage in self.damages), unknown

    def saw(self, first_ns: int, last_ns: int) -> None:
        """Widen the span of the log."""
        if self.first_ns is None or first_ns < self.first_ns:
            self.first_ns = first_ns
        if self.last_ns is None or last_ns > self.last_ns:
            self.last_ns = last_ns

    def skip(self, topic: str, reason: str, messages: int = 1) -> int:
        """Count messages that were not handed out; returns how many have this reason now."""
        return _add(self.skipped, topic, reason, messages)

    def reject(self, topic: str, reason: str) -> int:
        """Turn one message that was read into a skipped one, because it cannot be decoded."""
        self.read[topic] = self.read.get(topic, 1) - 1
        self.undecodable += 1
        return self.skip(topic, reason)

    def note(self, topic: str, reason: str, count: int = 1) -> int:
        """Count something changed or left out in messages that were used; returns the new count."""
        return _add(self.notes, topic, reason, count)


def _add(table: dict[str, dict[str, int]], topic: str, reason: str, count: int) -> int:
    row = table.setdefault(topic, {})
    row[reason] = row.get(reason, 0) + count
    return row[reason]
