"""A log: one file or several, as one stream of messages in log-time order, with everything counted."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, final

from mclcli.errors import InputError
from mclcli.io.logs.base import Channel, Damage, FileFacts, PassedOver, RawMessage, Span, Wish
from mclcli.io.logs.inflate import ZSTD, Budget, CorruptError, inflate_frame
from mclcli.io.logs.reorder import merge, reorder

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator
    from pathlib import Path

    from mclcli.io.logs.base import Beside, Container, Guess, Tally

NOT_WANTED = "not needed"
"""Reason under which messages of topics that nobody asked for are counted as skipped."""
PACKED = "compressed (zstd), and cannot be decompressed"
"""Reason under which compressed messages are counted that are damaged."""
LATE = "came over 1 s late; kept in file order"
"""Note under which messages are counted that the reordering could not put in their place."""
_FIRST = ZSTD[:1]  # compared first: it is the same object every time
_WARNINGS = 20  # damages told one by one


@final
@dataclass(frozen=True, slots=True)
class Log:
    """Files that make up one log. ``seekable`` logs can be read again and again, streamed ones once.

    ``names`` are for messages to the user; ``paths`` the files read, empty for a stream; ``missing`` what was already
    found wrong when the log was opened; ``arguments`` tell of which of the things that the user named each file is.
    """

    containers: tuple[Container, ...]
    paths: tuple[Path, ...]
    seekable: bool
    missing: tuple[Damage, ...] = ()
    arguments: tuple[int, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Base names of the files."""
        return tuple(container.source for container in self.containers)

    def messages(
        self,
        wanted_topics: frozenset[str] | None,
        tally: Tally,
        *,
        strict: bool = False,
        announce: bool = True,
        beside: Callable[[Beside], None] | None = None,
        guess: Guess | None = None,
        origin: Callable[[], int | None] = lambda: None,
    ) -> Iterator[RawMessage]:
        """Messages of the wanted topics (None: of all), from the start, in order of log time, ties in file order.

        ``tally`` is filled meanwhile, and each damage is warned of unless ``announce`` is off (a second reading).
        ``beside`` is given what stands beside the messages, where it comes; ``guess`` names channels of which the
        file says nothing (see ``Wish``). Messages that rosbag2 compressed one by one are unpacked. Damage is told in
        seconds after the log time that ``origin`` gives, None for the first message's.
        Raises InputError at the first damage if ``strict``, when the file cannot be read at all, and when a stream is
        read a second time.
        """
        wish = Wish(None if wanted_topics is None else _in(wanted_topics), beside is not None, guess)
        intake = _Intake(tally, strict, announce, beside, origin)
        for damage in self.missing:
            intake.damage(damage)
        read, several = tally.read, len(set(self.arguments)) > 1
        of = {id(container): number for container, number in zip(self.containers, self.arguments, strict=False)}

        def read_one(container: Container) -> Iterator[RawMessage]:
            span = Span(container.source, of[id(container)]) if several else None
            return reorder(intake.messages(container, wish, span), intake.late)

        for message in merge(self.containers, read_one, seekable=self.seekable):
            topic = message.channel.topic
            read[topic] = read.get(topic, 0) + 1
            yield message

    def part(self, arguments: Collection[int]) -> Log:
        """The log of only some of the things that the user named."""
        kept = [number for number, argument in enumerate(self.arguments) if argument in arguments]
        return replace(
            self,
            containers=tuple(self.containers[number] for number in kept),
            paths=tuple(self.paths[number] for number in kept),
            missing=(),
            arguments=tuple(self.arguments[number] for number in kept),
        )

    def digest(self) -> str:
        """SHA-256 over the contents of the files, one after the other (as ``cat FILES | sha256sum``); '' for a stream.

        Raises InputError if a file cannot be read.
        """
        if not self.seekable:
            return ""
        total = hashlib.sha256()
        for path in self.paths:
            try:
                with path.open("rb") as stream:
                    while block := stream.read(1 << 20):
                        total.update(block)
            except OSError as error:
                raise unreadable(path.name, error) from error
        return total.hexdigest()


@final
@dataclass(slots=True)
class _Intake:
    """Sorts what a container yields: messages on, everything else into the tally."""

    tally: Tally
    strict: bool
    announce: bool
    beside: Callable[[Beside], None] | None
    origin: Callable[[], int | None]
    told_late: bool = False
    channels: set[Channel] = field(default_factory=set)

    def messages(self, container: Container, wish: Wish, span: Span | None) -> Iterator[RawMessage]:
        """Messages of one container; their ``span`` goes into the tally."""
        tally, budget = self.tally, Budget()
        items = container.items(wish)
        if span is not None:
            tally.spans.append(span)
            items = span.watch(items)
        try:
            for item in items:
                if isinstance(item, RawMessage):
                    tally.saw(item.log_time_ns, item.log_time_ns)
                    if item.data[:1] == _FIRST:
                        yield from self.unpack(item, budget)
                    else:
                        yield item
                else:
                    self.other(item)
        except OSError as error:
            raise unreadable(container.source, error) from error

    def other(self, item: Channel | PassedOver | Damage | FileFacts | Beside) -> None:
        """Take in what is no message."""
        if isinstance(item, PassedOver):
            self.tally.saw(item.first_ns, item.last_ns)
            self.tally.skip(item.channel.topic, NOT_WANTED, item.messages)
        elif isinstance(item, Damage):
            self.damage(item)
        elif isinstance(item, FileFacts):
            self.tally.files.append(item)
        elif not isinstance(item, Channel):
            if self.beside is not None:
                self.beside(item)
        elif item not in self.channels:
            self.channels.add(item)
            self.tally.channels.append(item)

    def unpack(self, message: RawMessage, budget: Budget) -> Iterator[RawMessage]:
        """Undo rosbag2's compression of a single message, or count it."""
        plain = unpack(message, budget)
        if plain is not None:
            yield plain
            return
        topic = message.channel.topic
        self.tally.undecodable += 1
        if self.tally.skip(topic, PACKED) == 1 and self.announce:
            logging.getLogger("mclcli").warning("%s: messages are skipped: %s", topic, PACKED)

    def damage(self, damage: Damage) -> None:
        """Count, and warn or stop."""
        origin = self.origin()
        if origin is None:
            origin = min((ns for ns in (self.tally.first_ns, damage.first_ns) if ns is not None), default=None)
        text = damage.describe(origin)
        if self.strict:
            raise InputError(f"{text}; leave --strict out to use the rest")
        self.tally.damages.append(damage)
        if not self.announce:
            return
        if len(self.tally.damages) <= _WARNINGS:
            logging.getLogger("mclcli").warning("%s", text)
        elif len(self.tally.damages) == _WARNINGS + 1:
            logging.getLogger("mclcli").warning("%s: more damage follows; it is counted, not told", damage.source)

    def late(self, message: RawMessage) -> None:
        """Note a message that came too late to be put in order."""
        self.tally.note(message.channel.topic, LATE)
        if self.announce and not self.told_late:
            self.told_late = True
            text = "messages on %s are more than 1 s late; they are used where they stand in the file"
            logging.getLogger("mclcli").warning(text, message.channel.topic)


def unpack(message: RawMessage, budget: Budget) -> RawMessage | None:
    """A message without rosbag2's compression of single messages, None if that is damaged; any other as it is.

    No CDR message begins like a zstd frame.
    """
    if message.data[:4] != ZSTD or message.channel.encoding != "cdr":
        return message
    try:
        return message._replace(data=inflate_frame(message.data, budget))
    except CorruptError:
        return None


def unreadable(name: str, error: OSError) -> InputError:
    """Error for a file that the system does not let us read."""
    return InputError(f"{name}: cannot be read ({error.strerror or error}); check the file and its permissions")


def _in(topics: frozenset[str]) -> Callable[[Channel], bool]:
    return lambda channel: channel.topic in topics
