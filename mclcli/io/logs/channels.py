"""The channels of one file while it is being read: who is wanted, and how many messages of the others went by."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import Channel, PassedOver, Wish

if TYPE_CHECKING:
    from collections.abc import Mapping


@final
@dataclass(slots=True)
class WatchedChannel:
    """One channel, whether it is wanted, and its messages passed over since the last report.

    ``low`` and ``high`` are the least and the greatest sequence number of its messages, wanted or not.
    """

    channel: Channel
    wanted: bool
    messages: int = 0
    first_ns: int = 0
    last_ns: int = 0
    low: int = 1 << 32
    high: int = -1

    def pass_over(self, stamp_ns: int) -> None:
        """Count one unwanted message."""
        if not self.messages:
            self.first_ns = self.last_ns = stamp_ns
        elif stamp_ns > self.last_ns:
            self.last_ns = stamp_ns
        elif stamp_ns < self.first_ns:
            self.first_ns = stamp_ns
        self.messages += 1


@final
@dataclass(slots=True)
class WatchedChannels:
    """All channels of a file by their number in it; ``nameless`` counts messages whose channel nothing describes.

    ``later``: what is not described may be so later, in a stream that is read once. ``guessed`` counts nameless
    messages that are handed out all the same, ``renumbered`` says that a number came twice. ``types`` are those of
    topics, as the log's metadata.yaml has them, for channels whose file does not say.
    """

    wish: Wish
    later: bool = False
    types: Mapping[str, str] = field(default_factory=dict)
    by_number: dict[int, WatchedChannel] = field(default_factory=dict)
    retired: list[WatchedChannel] = field(default_factory=list)
    nameless: int = 0
    guessed: int = 0
    renumbered: bool = False
    reported: bool = False

    def add(self, number: int, channel: Channel) -> Channel | None:
        """Take up a channel, with the type that it is known to have; None if it is already there, unchanged."""
        if not channel.type and channel.topic in self.types:
            kind = self.types[channel.topic]
            recorded = channel.recorded and replace(channel.recorded, name=kind)
            channel = replace(channel, type=kind, recorded=recorded)
        known = self.by_number.get(number)
        if known is not None and known.channel == channel:
            return None
        if known is not None:
            self.retired.append(known)
            self.renumbered = True
        wanted = self.wish.channels
        self.by_number[number] = WatchedChannel(channel, wanted is None or wanted(channel))
        return channel

    def missing_numbers(self, messages: int) -> int:
        """Messages that the sequence numbers count beyond the ``messages`` found; 0 where the numbers count nothing.

        They may count each channel's messages, or those of the file. Numbers of which more than half is missing, or
        that belong to fewer than ten messages, are taken to mean something else.
        """
        spans = [(watched.low, watched.high) for watched in self.by_number.values() if watched.high >= 0]
        if self.renumbered or not spans or messages < _FEW:
            return 0
        by_channel = sum(high - low + 1 for low, high in spans) - (messages - self.nameless - self.guessed)
        by_file = max(high for _, high in spans) - min(low for low, _ in spans) + 1 - messages
        return min((more for more in (by_channel, by_file) if 0 <= more <= messages), default=0)

    def report(self) -> list[PassedOver]:
        """Messages passed over since the last report, by channel."""
        self.reported = True
        passed = []
        for watched in (*self.retired, *self.by_number.values()):
            if watched.messages:
                passed.append(PassedOver(watched.channel, watched.messages, watched.first_ns, watched.last_ns))
                watched.messages = 0
        self.retired.clear()
        return passed


_FEW = 10
