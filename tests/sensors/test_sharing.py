"""Blocks of work shared by threads."""

from __future__ import annotations

import pytest

from mclcli.sensors.endpoints import for_each


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 3, 40])
def test_every_block_is_done_once(threads: int, count: int) -> None:
    done: list[int] = []
    for_each(done.append, range(0, 10 * count, 10), threads)
    assert sorted(done) == list(range(0, 10 * count, 10))


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_in_any_block_reaches_the_caller(threads: int) -> None:
    def fail(start: int) -> None:
        if start == 7:
            raise IndexError("in block 7")

    with pytest.raises(IndexError, match="in block 7"):
        for_each(fail, range(20), threads)
