"""Several files as one stream in log-time order, a file opened only when its time has come."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

from mclcli.io.logs.base import RawMessage
from mclcli.io.logs.reorder import HORIZON_NS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from mclcli.io.logs.base import Container

AT_ONCE = 16
"""Up to so many files are simply read side by side."""


def merge(
    containers: Sequence[Container], read: Callable[[Container], Iterator[RawMessage]], *, seekable: bool
) -> Iterator[RawMessage]:
    """Messages of all containers, each of them ``read`` in order of time; ties in the order of the files.

    A recording split into thousands of files has few of them open at a time. Where files can be read once only, all
    are open from the start.
    """
    if len(containers) == 1:
        return read(containers[0])
    if len(containers) <= AT_ONCE or not seekable:
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
