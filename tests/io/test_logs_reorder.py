from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import zstandard

from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.logs.inflate import Budget, CorruptError, inflate, inflate_start
from mclcli.io.logs.reorder import HELD_LIMIT, OVERHEAD, reorder

if TYPE_CHECKING:
    from collections.abc import Iterator

CHANNEL = Channel("/t", "t", "cdr")


def messages(*stamps: int) -> list[RawMessage]:
    return [RawMessage(CHANNEL, stamp, bytes([number])) for number, stamp in enumerate(stamps)]


def test_reordering_sorts_within_its_horizon_and_keeps_ties_in_order() -> None:
    late: list[RawMessage] = []
    ordered = list(reorder(messages(5, 3, 5, 9, 4, 12, 11), late.append, horizon_ns=6))
    assert [(m.log_time_ns, m.data[0]) for m in ordered] == [(3, 1), (4, 4), (5, 0), (5, 2), (9, 3), (11, 6), (12, 5)]
    assert late == []


def test_messages_beyond_the_horizon_stay_where_they_are_and_are_told() -> None:
    late: list[RawMessage] = []
    ordered = list(reorder(messages(0, 10, 20, 3, 30), late.append, horizon_ns=5))
    assert [m.log_time_ns for m in ordered] == [0, 10, 3, 20, 30]
    assert [m.log_time_ns for m in late] == [3]


def test_tiny_messages_are_not_held_without_end() -> None:
    """Half a million within one second: what each takes beside its data counts as well."""
    most, taken = 0, 0

    def come() -> Iterator[RawMessage]:
        nonlocal taken
        for taken in range(500_000):
            yield RawMessage(CHANNEL, taken, b"")

    for given, message in enumerate(reorder(come(), lambda _: pytest.fail("late"))):
        assert message.log_time_ns == given
        most = max(most, taken - given)
    assert 100_000 < most <= HELD_LIMIT // OVERHEAD + 1


def test_bombs_stop_at_their_declared_size() -> None:
    bomb = zstandard.compress(bytes(1 << 26))
    with pytest.raises(CorruptError, match="declares 1000 bytes and holds more"):
        inflate(bomb, "zstd", 1000, Budget())
    with pytest.raises(CorruptError, match="more than 256 MiB"):
        inflate(bomb, "zstd", 1 << 29, Budget())
    with pytest.raises(CorruptError, match="1000 times"):
        inflate(bomb, "zstd", 1 << 26, Budget(taken=1000, given=1 << 30))
    assert len(inflate_start(bomb, "zstd", 1000, Budget())) == 1000
