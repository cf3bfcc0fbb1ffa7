"""Messages into log-time order, with a bounded buffer."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from mclcli.io.logs.base import RawMessage

HORIZON_NS = 1_000_000_000
"""How much log time is held back."""
HELD_LIMIT = 1 << 26
"""How many bytes are held back at most, with what each message takes beside its data."""
OVERHEAD = 400
"""Bytes that a message takes in memory beside its data, about."""


def reorder(
    messages: Iterable[RawMessage], late: Callable[[RawMessage], None], horizon_ns: int = HORIZON_NS
) -> Iterator[RawMessage]:
    """Messages in order of log time, ties in file order.

    A message is held until one ``horizon_ns`` younger has come (or until 64 MiB are held, which is 160,000 tiny ones).
    One that comes later than that is passed on where it stands, after ``late`` was told of it.
    """
    held: list[tuple[int, int, RawMessage]] = []
    newest = passed = -(1 << 63)
    held_bytes = 0
    for order, message in enumerate(messages):
        stamp = message.log_time_ns
        if stamp < passed:
            late(message)
            yield message
            continue
        heapq.heappush(held, (stamp, order, message))
        held_bytes += len(message.data) + OVERHEAD
        newest = max(newest, stamp)
        while held and (held[0][0] <= newest - horizon_ns or held_bytes > HELD_LIMIT):
            passed, _, first = heapq.heappop(held)
            held_bytes -= len(first.data) + OVERHEAD
            yield first
    while held:
        yield heapq.heappop(held)[2]
