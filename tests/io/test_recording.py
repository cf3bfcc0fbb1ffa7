"""A log opened for replay: files are looked through whole, pipes only at their beginning, and both yield the same."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import pytest

from mclcli import open_recording
from mclcli.errors import InputError, UsageError
from mclcli.io.logs import open_log
from mclcli.io.recording.recording import Recording
from mclcli.records import LaserScan, Odometry, StampedPose
from tests.cli.support import OFFICE, START_NS, messages, write_mcap

if TYPE_CHECKING:
    from pathlib import Path


class Pipe(io.RawIOBase):
    """Bytes that can be read once, from front to back."""

    def __init__(self, data: bytes) -> None:
        super().__init__()
        self._data = io.BytesIO(data)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        return self._data.readinto(buffer)


def piped(data: bytes, *, whole: bool = False) -> Recording:
    return Recording(open_log(["-"], stdin=io.BufferedReader(Pipe(data))), whole=whole)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return open_recording(OFFICE)


def test_a_file_is_looked_through_whole(recording: Recording) -> None:
    survey = recording.survey
    assert survey.complete
    assert survey.topics["/scan"].count == 950
    assert isinstance(survey.topics["/scan"].sample, LaserScan)
    assert survey.topics["/scan"].rate == pytest.approx(8.0, abs=0.01)
    assert {fixed.child for fixed in survey.statics(["/tf_static"])} == {"base_link", "laser", "camera_link"}
    assert recording.first_ns == START_NS
    assert not recording.tally.lossy


def test_roles(recording: Recording) -> None:
    roles = recording.roles()
    assert (roles.scan, roles.odometry, roles.vision) == (("/scan",), "/odom", ("/landmarks",))
    assert (roles.truth, roles.map) == ("/ground_truth", "")
    assert (roles.odom_frame, roles.base_frame) == ("odom", "base_footprint")


def test_events_can_be_read_again_and_come_in_order(recording: Recording) -> None:
    first, second = (list(recording.events(["/scan", "/odom"])) for _ in range(2))
    assert [topic for topic, _ in first] == [topic for topic, _ in second]
    assert {topic for topic, _ in first} == {"/scan", "/odom"}
    assert len(first) == 950 + 2970
    stamps = [record.stamp_ns for _, record in first if isinstance(record, Odometry)]
    assert stamps == sorted(stamps)


def test_records_and_raw_messages_of_a_topic(recording: Recording) -> None:
    (pose,) = recording.records("/initialpose")
    assert isinstance(pose, StampedPose)
    assert pose.covariance is not None
    assert [message.channel.topic for message in recording.raw("/initialpose")] == ["/initialpose"]
    assert recording.records("/none") == []


def test_a_pipe_is_looked_into_and_still_yields_everything(recording: Recording) -> None:
    stream = piped(OFFICE.read_bytes())
    assert not stream.survey.complete
    seconds = (stream.survey.span_ns or (0, 0))[1] - START_NS
    assert 10e9 < seconds < 11e9
    assert stream.roles().scan == ("/scan",)
    assert len(stream.records("/initialpose")) == 1
    got = [(topic, getattr(record, "stamp_ns", 0)) for topic, record in stream.events(["/scan", "/odom"])]
    expected = [(topic, getattr(record, "stamp_ns", 0)) for topic, record in recording.events(["/scan", "/odom"])]
    assert got == expected


def test_the_whole_of_a_pipe_where_that_is_asked_for(recording: Recording) -> None:
    stream = piped(OFFICE.read_bytes(), whole=True)
    assert stream.survey.complete
    assert {name: topic.count for name, topic in stream.survey.topics.items()} == {
        name: topic.count for name, topic in recording.survey.topics.items()
    }


def test_damage_is_told_once_and_strict_refuses_it(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    cut = tmp_path / "cut.mcap"
    whole = write_mcap(tmp_path / "log.mcap", messages(OFFICE)[:2000])
    cut.write_bytes(whole.read_bytes()[:80_000])
    damaged = open_recording(cut)
    assert damaged.tally.lossy
    assert 0 < len(list(damaged.events(["/scan"]))) < len(list(open_recording(whole).events(["/scan"])))
    assert len([record for record in caplog.records if record.levelname == "WARNING"]) == 1
    with pytest.raises(InputError, match="--strict"):
        open_recording(cut, strict=True)


def test_an_empty_log_and_a_missing_one(tmp_path: Path) -> None:
    empty = open_recording(write_mcap(tmp_path / "empty.mcap", []))
    assert (empty.first_ns, empty.survey.span_ns, empty.roles().scan) == (0, None, ())
    with pytest.raises(UsageError, match="no such file"):
        open_recording(tmp_path / "none.mcap")
