"""The channels of one file while it is being read: who is wanted, and how many messages of the others went by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import Channel, PassedOver

if TYPE_CHECKING:
    from collections.abc import Callable


@final
@dataclass(slots=True)
class WatchedChannel:
    """One channel, whether it is wanted, and its messages passed over since the last report."""

    channel: Channel
    wanted: bool
    messages: int = 0
    first_ns: int = 0
    last_ns: int = 0

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
    """All channels of a file by their number in it; ``nameless`` counts messages whose channel nothing describes."""

    wanted: Callable[[Channel], bool] | None
    by_number: dict[int, WatchedChannel] = field(default_factory=dict)
    retired: list[WatchedChannel] = field(default_factory=list)
    nameless: int = 0
    reported: bool = False

    def add(self, number: int, channel: Channel) -> bool:
        """Take up a channel; False if it is already there, unchanged."""
        known = self.by_number.get(number)
        if known is not None and known.channel == channel:
            return False
        if known is not None:
            self.retired.append(known)
        self.by_number[number] = WatchedChannel(channel, self.wanted is None or self.wanted(channel))
        return True

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
