"""Types of topics whose file has no schema for them, and types by the names that DDS gives them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import zstandard
from mcap.writer import Writer

from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from mclcli.io.logs.mcap_records import ros2_name

if TYPE_CHECKING:
    from pathlib import Path

METADATA = """rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  relative_file_paths:
    - {file}
  topics_with_message_count:
    - topic_metadata:
        name: /scan
        type: sensor_msgs/msg/LaserScan
        serialization_format: cdr
        offered_qos_profiles: "- history: 3\\n  depth: 0"
      message_count: 1
    - message_count: 1
      topic_metadata:
        name: "/named"
        offered_qos_profiles: []
        serialization_format: cdr
        type: 'x_msgs/msg/Other'
    - message_count: 1
      topic_metadata:
        name: /odom
        offered_qos_profiles: []
        serialization_format: cdr
        type: nav_msgs/msg/Odometry
"""


def types_in(*paths: Path) -> dict[str, str]:
    messages = open_log(paths).messages(None, Tally())
    return {message.channel.topic: message.channel.type for message in messages}


def bag(folder: Path, listed: str = "bag_0.mcap", *, windows: bool = False) -> Path:
    """Folder with an MCAP of four topics, of which one has a schema, and a metadata.yaml that lists a file."""
    folder.mkdir()
    with (folder / "bag_0.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        for number, (topic, schema_id) in enumerate((("/scan", 0), ("/named", schema), ("/odom", 0), ("/unlisted", 0))):
            writer.add_message(writer.register_channel(topic, "cdr", schema_id), number, b"\0\1\0\0", number)
        writer.finish()  # type: ignore[no-untyped-call]
    (folder / "metadata.yaml").write_text(METADATA.format(file=listed), newline="\r\n" if windows else None)
    return folder / "bag_0.mcap"


EXPECTED = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/named": "std_msgs/msg/String",
    "/odom": "nav_msgs/msg/Odometry",
    "/unlisted": "",
}


@pytest.mark.parametrize("windows", [False, True])
def test_a_topic_without_a_schema_has_the_type_that_metadata_gives_it(tmp_path: Path, *, windows: bool) -> None:
    file = bag(tmp_path / "bag", windows=windows)
    assert types_in(file.parent) == types_in(file) == EXPECTED


def test_so_has_one_in_a_compressed_file(tmp_path: Path) -> None:
    file = bag(tmp_path / "bag", "bag_0.mcap.zstd")
    packed = file.with_name("bag_0.mcap.zstd")
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    assert types_in(packed.parent) == types_in(packed) == EXPECTED


def test_a_metadata_file_that_does_not_list_the_file_says_nothing_of_it(tmp_path: Path) -> None:
    file = bag(tmp_path / "bag", "another.mcap")
    assert types_in(file) == EXPECTED | {"/scan": "", "/odom": ""}


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("sensor_msgs/LaserScan", "sensor_msgs/msg/LaserScan"),
        ("sensor_msgs::msg::LaserScan", "sensor_msgs/msg/LaserScan"),
        ("sensor_msgs::msg::dds_::LaserScan_", "sensor_msgs/msg/LaserScan"),
        ("foxglove.LaserScan", "foxglove.LaserScan"),
        ("a/b/c/D", "a/b/c/D"),
        ("", ""),
    ],
)
def test_names_of_types(name: str, known: str) -> None:
    assert ros2_name(name) == known
