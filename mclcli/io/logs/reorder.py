"""Messages into log-time order: those of one file with a bounded buffer, and several files as one stream."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

from mclcli.io.logs.base import RawMessage

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from mclcli.io.logs.base import Container

HORIZON_NS = 1_000_000_000
"""How much log time is held back."""
HELD_LIMIT = 1 << 26
"""How many bytes are held back at most, with what each message takes beside its data."""
OVERHEAD = 400
"""Bytes that a message takes in memory beside its data, about."""
_AT_ONCE = 16  # up to so many files are simply read side by side


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


def merge(
    containers: Sequence[Container], read: Callable[[Container], Iterator[RawMessage]], *, seekable: bool
) -> Iterator[RawMessage]:
    """Messages of all containers, each of them ``read`` in order of time; ties in the order of the files.

    A recording split into thousands of files has few of them open at a time: each is opened only when its time has
    come. Where files can be read once only, all are open from the start.
    """
    if len(containers) == 1:
        return read(containers[0])
    if len(containers) <= _AT_ONCE or not seekable:
        return heapq.merge(*map(read, containers), key=lambda message: message.log_time_ns)
    return _one_after_the_other(containers, read)


def _one_after_the_other(
    containers: Sequence[Container], read: Callable[[Container], Iterator[RawMessage]]
) -> Iterator[RawMessage]:
    closed = sorted((_begins(container), order) for order, container in enumerate(containers))[::-1]
    heads: list[tuple[int, int, RawMessage, Iterator[RawMessage]]] = []
    while heads or closed:
        if closed and (not heads or closed[-1][0] <= heads[0][0]):
            order = closed.pop()[1]
            messages = read(containers[order])
        else:
            _, order, message, messages = heapq.heappop(heads)
            yield message
        following = next(messages, None)
        if following is not None:
            heapq.heappush(heads, (following.log_time_ns, order, following, messages))


def _begins(container: Container) -> int:
    """Log time before which a file holds no message [ns]: its first, less what may come late."""
    items = container.items()
    first = next((item.log_time_ns for item in items if isinstance(item, RawMessage)), -(1 << 63))
    return first - HORIZON_NS
