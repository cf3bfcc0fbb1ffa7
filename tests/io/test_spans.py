"""Which of several logs follow one another."""

from __future__ import annotations

import pytest

from mclcli.io.logs.base import Span
from mclcli.io.logs.spans import strands

SECOND = 10**9
DAY = 86_400
BOTH = ("/scan", "/odom")


def span(argument: int, first: float, last: float, *topics: str) -> Span:
    found = Span(f"{argument}.mcap", argument)
    for topic in topics:
        found.take(topic, round(first * SECOND))
        found.take(topic, round(last * SECOND))
    return found


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([], []),
        ([(0, 0, 10, *BOTH)], [[0]]),
        ([(0, 0, 10, *BOTH), (1, 10.1, 20, *BOTH)], [[0, 1]]),
        ([(0, 10.1, 20, *BOTH), (1, 0, 10, *BOTH)], [[1, 0]]),
        ([(0, 0, 10, *BOTH), (1, 9.5, 20, *BOTH)], [[0, 1]]),
        ([(0, 0, 10, "/scan"), (1, 0, 10, "/odom")], [[0, 1]]),
        ([(0, 0, 10, *BOTH), (1, 1800, 1900, *BOTH)], [[0, 1]]),
        ([(0, 0, 10, *BOTH), (1, 2 * DAY, 2 * DAY + 9, *BOTH)], [[0], [1]]),
        ([(0, 2 * DAY, 2 * DAY + 9, *BOTH), (1, 0, 10, *BOTH)], [[1], [0]]),
        ([(0, 0, 10, *BOTH), (0, 2 * DAY, 2 * DAY + 9, *BOTH)], [[0, 0]]),  # files of one folder
        ([(0, 0, 10, *BOTH), (1, 3, 20, *BOTH)], [[0], [1]]),
        ([(0, 0, 10, *BOTH), (1, 0, 10, *BOTH)], [[0], [1]]),
        ([(0, 0, 9, *BOTH), (1, 10, 19, *BOTH), (2, 0, 9, *BOTH), (3, 10, 19, *BOTH)], [[0, 1], [2, 3]]),
        ([(0, 0, 10, *BOTH), (1, 0, 10), (2, 11, 20, *BOTH)], [[0, 2]]),
    ],
)
def test_strands(spans: list[tuple[int, float, float, str]], expected: list[list[int]]) -> None:
    found = strands(span(*one) for one in spans)
    assert [[s.argument for s in strand.spans] for strand in found] == expected
    assert [bool(strand.why) for strand in found] == [number > 0 for number in range(len(found))]


def test_why_logs_do_not_follow() -> None:
    apart = strands([span(0, 0, 10, *BOTH), span(1, 3 * DAY, 3 * DAY + 9, *BOTH)])
    assert apart[1].why == "1.mcap begins 3 days after the end of 0.mcap"
    hours = strands([span(0, 0, 10, *BOTH), span(1, 7210, 7220, *BOTH)])
    assert hours[1].why == "1.mcap begins 2.0 hours after the end of 0.mcap"
    both = strands([span(0, 0, 10, *BOTH), span(1, 5, 15, "/odom")])
    assert both[1].why == "0.mcap and 1.mcap hold /odom at the same time"
