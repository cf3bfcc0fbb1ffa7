"""Messages whose channel is described later in the file, held until it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, final

from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.logs.reorder import OVERHEAD

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.io.logs.base import Item
    from mclcli.io.logs.channels import WatchedChannels

HELD_LIMIT = 1 << 26
"""Bytes that are held at most; beyond that, messages that nothing has described so far are lost."""


@final
class Nameless(NamedTuple):
    """A message of a channel, told by its ``number``, that nothing has described so far."""

    number: int
    log_time_ns: int
    data: bytes
    publish_ns: int | None
    sequence: int | None


def hold(items: Iterable[Item | Nameless], channels: WatchedChannels) -> Iterator[Item]:
    """The same items in the same order, each message with its channel.

    Everything from the first nameless message on is held until all channels are described, or the items end, or 64 MiB
    are held. From then on nothing is.
    """
    held: list[Item | Nameless] = []
    size, missing = 0, set[int]()
    for item in items:
        nameless = type(item) is Nameless
        if not held and not nameless:
            yield item  # type: ignore[misc]
            continue
        held.append(item)
        if isinstance(item, Nameless):
            missing.add(item.number)
        elif isinstance(item, Channel):
            missing -= channels.by_number.keys()
        size += OVERHEAD + (len(item.data) if isinstance(item, RawMessage | Nameless) else 0)
        if not missing or size > HELD_LIMIT:
            yield from _named(held, channels)
            channels.later = not missing
            held, size, missing = [], 0, set()
    yield from _named(held, channels)


def _named(held: Iterable[Item | Nameless], channels: WatchedChannels) -> Iterator[Item]:
    for item in held:
        if isinstance(item, Nameless):
            yield from name(item, channels)
        else:
            yield item


def name(message: Nameless, channels: WatchedChannels) -> Iterator[Item]:
    """The message with its channel, if that is known or can be guessed by now; what else becomes of it is counted."""
    number, stamp_ns, data, publish_ns, sequence = message
    watched = channels.by_number.get(number)
    if watched is None:
        guess = channels.wish.guess
        channel = guess(number, data) if guess else None
        channels.nameless += channel is None
        channels.guessed += channel is not None
        if channel is not None:
            yield channel
            yield RawMessage(channel, stamp_ns, data, publish_ns, sequence)
    elif watched.wanted:
        yield RawMessage(watched.channel, stamp_ns, data, publish_ns, sequence)
    else:
        watched.pass_over(stamp_ns)
        if not channels.reported:
            yield from channels.report()
