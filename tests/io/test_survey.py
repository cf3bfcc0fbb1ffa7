"""A first look through a log: counts, rates and spans."""

from __future__ import annotations

import pytest

from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.recording.survey import LogSurvey, TopicSurvey, survey_log
from tests.io.surveys import LASER, ODOM, log_of
from tests.support import SECOND

IMAGE = Channel("/image", "sensor_msgs/msg/Image", "cdr")


def test_rate_span_and_longest_gap() -> None:
    topic = TopicSurvey(IMAGE)
    for seconds in (10, 11, 14, 15):
        topic.count_one(seconds * SECOND)
    assert (topic.count, topic.first_ns, topic.last_ns) == (4, 10 * SECOND, 15 * SECOND)
    assert topic.rate == pytest.approx(0.6)
    assert topic.longest_gap_ns == 3 * SECOND


def test_one_message_has_no_rate() -> None:
    topic = TopicSurvey(IMAGE)
    topic.count_one(5)
    assert topic.rate is None
    assert (topic.first_ns, topic.last_ns, topic.longest_gap_ns) == (5, 5, 0)


def test_messages_out_of_order_widen_the_span() -> None:
    topic = TopicSurvey(IMAGE)
    for stamp in (50, 10, 90):
        topic.count_one(stamp)
    assert (topic.first_ns, topic.last_ns) == (10, 90)


def test_what_cannot_be_used_is_counted_without_being_decoded() -> None:
    survey = survey_log([RawMessage(IMAGE, 7, b"not an image"), RawMessage(IMAGE, 9, b"")])
    assert survey.topics["/image"].count == 2
    assert survey.topics["/image"].sample is None
    assert survey.span_ns == (7, 9)
    assert survey.of_type(IMAGE.type) == []


def test_a_message_that_cannot_be_decoded_says_why_and_the_next_one_serves() -> None:
    scan = Channel("/scan", "sensor_msgs/msg/LaserScan", "cdr")
    survey = survey_log([RawMessage(scan, 1, b"\0"), RawMessage(scan, 2, b"\0\1\0")])
    topic = survey.topics["/scan"]
    assert topic.count == 2
    assert topic.sample is None
    assert topic.problem


def test_an_empty_log_has_no_span() -> None:
    assert LogSurvey().span_ns is None


@pytest.mark.parametrize(
    ("written", "meant"),
    [("scan", "/scan"), ("/scan", "/scan"), ("/odom", "odom"), ("odom", "odom"), ("map", "map"), ("/map", "/map")],
)
def test_a_topic_is_known_with_and_without_its_slash(written: str, meant: str) -> None:
    assert log_of(("/scan", LASER), ("odom", ODOM), ("/map", LASER), ("map", LASER)).topic_named(written) == meant
    assert log_of(("/scans", LASER)).topic_named(written) == written
