"""The four ways to write a time."""

from __future__ import annotations

import datetime as dt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.cli.clock import clock_text, parse_seconds, parse_time
from mclcli.errors import UsageError

FIRST = 1_663_967_375_800_000_001  # 2022-09-23T21:09:35.800000001Z


def utc(*fields: int) -> int:
    return int(dt.datetime(*fields, tzinfo=dt.UTC).timestamp()) * 10**9  # type: ignore[arg-type,misc]


@pytest.mark.parametrize(
    ("text", "stamp"),
    [
        ("0", FIRST),
        ("12.5", FIRST + 12_500_000_000),
        ("12.5s", FIRST + 12_500_000_000),
        ("0.000000001", FIRST + 1),
        ("-1", FIRST - 10**9),
        ("@1663967375.800000001", FIRST),
        ("@0.1", 100_000_000),
        ("21:10", utc(2022, 9, 23, 21, 10)),
        ("21:09:36", utc(2022, 9, 23, 21, 9, 36)),
        ("14:32:05.25", utc(2022, 9, 23, 14, 32, 5) + 250_000_000),
        ("0:00", utc(2022, 9, 23)),
        ("2022-09-24", utc(2022, 9, 24)),
        ("2022-09-23T21:09:35", utc(2022, 9, 23, 21, 9, 35)),
        ("2022-09-23T21:09:35Z", utc(2022, 9, 23, 21, 9, 35)),
        ("2022-09-23T23:09:35.25+02:00", utc(2022, 9, 23, 21, 9, 35) + 250_000_000),
    ],
)
def test_forms(text: str, stamp: int) -> None:
    assert parse_time(text, "--at").stamp_ns(FIRST) == stamp


@pytest.mark.parametrize("text", ["14:32:05", "2022-09-23", "2022-09-23T21:09:35Z"])
def test_clock_times_mean_nothing_to_stamps_of_no_calendar(text: str) -> None:
    with pytest.raises(UsageError, match="--start: the log's stamps are of no calendar"):
        parse_time(text, "--start").stamp_ns(745_250_000_000)
    assert parse_time(text, "--start").stamp_ns(976_052_890_244_111_061) > 976_000_000 * 10**9


@given(st.integers(0, 2**61))
def test_absolute_seconds_lose_no_digit(stamp: int) -> None:
    assert parse_time(f"@{stamp // 10**9}.{stamp % 10**9:09d}", "--at").stamp_ns(FIRST) == stamp


@pytest.mark.parametrize(
    "text",
    [
        *("", "@", "@x", "soon", "--5", "nan", "inf", "-inf"),
        *("24:00", "12:60", "12:30:60", "12:3", "2022-13-01", "2022-09-23T25:00"),
        *("1e10", "-1e10", "1e30", "@1e30", "1e9999999", "1e99999999999999999999", "1e999990"),
    ],
)
def test_anything_else_is_an_error_that_names_option_and_text(text: str) -> None:
    with pytest.raises(UsageError, match="--at: ") as caught:
        parse_time(text, "--at")
    assert f"'{text}'" in str(caught.value)


def test_durations() -> None:
    assert parse_seconds("0.1", "--duration") == 100_000_000
    with pytest.raises(UsageError, match="--duration"):
        parse_seconds("1 day", "--duration")


@pytest.mark.parametrize(
    ("stamp_ns", "text"),
    [
        (1_663_967_375_123_999_999, "2022-09-23 21:09:35.123 UTC"),
        (1_715_697_000_000_000_000, "2024-05-14 14:30:00.000 UTC"),
        (976_052_890_244_111_061, "2000-12-05 21:48:10.244 UTC"),
        (1_068_250_000_000, "@1068.250"),
        (0, "@0.000"),
        (2**63 - 1, "2262-04-11 23:47:16.854 UTC"),
        (-500_000_000, "@-0.500"),
    ],
)
def test_clock_text(stamp_ns: int, text: str) -> None:
    assert clock_text(stamp_ns) == text
