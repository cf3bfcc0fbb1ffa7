"""Our MCAP writer against the library's: the same bytes at the same level, and small chunks at the fast one."""

from __future__ import annotations

import io

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from mclcli.io.traces.mcap_writer import McapWriter, for_clouds, standard

METADATA = {"a": "b", "name": "ü"}


def by_us(chunks: list[list[tuple[str, int, int, bytes]]]) -> bytes:
    """A file of these chunks of messages: topic, log time, publish time, data."""
    sink = io.BytesIO()
    writer = McapWriter(sink, standard(), profile="ros2", library="ours")
    writer.add_metadata("meta", METADATA)
    writer.attach("p.yaml", "application/yaml", b"abc")
    channels: dict[str, int] = {}
    for chunk in chunks:
        for topic, log_time, published, data in chunk:
            if topic not in channels:
                schema = (
                    writer.register_schema(f"type of {topic}", "ros2msg", topic.encode()) if topic != "/none" else 0
                )
                channels[topic] = writer.register_channel(topic, "cdr", schema, {"topic": topic})
            writer.add_message(channels[topic], log_time, published, data)
        writer.end_chunk()
    writer.finish()
    return sink.getvalue()


def by_the_library(chunks: list[list[tuple[str, int, int, bytes]]]) -> bytes:
    sink = io.BytesIO()
    writer = Writer(sink, 1 << 62, CompressionType.ZSTD)
    writer.start(profile="ros2", library="ours")
    writer.add_metadata("meta", METADATA)
    writer.add_attachment(0, 0, "p.yaml", "application/yaml", b"abc")
    channels: dict[str, int] = {}
    counts: dict[str, int] = {}
    for chunk in chunks:
        for topic, log_time, published, data in chunk:
            if topic not in channels:
                schema = (
                    writer.register_schema(f"type of {topic}", "ros2msg", topic.encode()) if topic != "/none" else 0
                )
                channels[topic] = writer.register_channel(topic, "cdr", schema, {"topic": topic})
            counts[topic] = counts.get(topic, -1) + 1
            writer.add_message(channels[topic], log_time, data, published, counts[topic])
        writer.flush()  # type: ignore[no-untyped-call]
    writer.finish()  # type: ignore[no-untyped-call]
    return sink.getvalue()


@pytest.mark.parametrize(
    "chunks",
    [
        [],
        [[("/a", 5, 4, b"")]],
        [
            [("/a", 10, 9, b"x" * 1000), ("/b", 7, 7, b"y")],
            [("/a", 3, 2, b"z"), ("/none", 20, 0, b"w"), ("/a", 21, 5, b"v")],
        ],
        [[], [("/b", 2**62, 0, bytes(300_000))], []],
    ],
)
def test_at_the_standard_level_every_byte_is_the_librarys(chunks: list[list[tuple[str, int, int, bytes]]]) -> None:
    assert by_us(chunks) == by_the_library(chunks)


@pytest.mark.parametrize("particles", [500, 2000, 20_000])
def test_a_cloud_that_repeats_another_is_made_small(particles: int) -> None:
    poses = np.random.default_rng(0).integers(0, 1 << 20, (particles, 7)).astype(np.float64)
    poses[:, 2:5] = 0.0
    weights = np.random.default_rng(1).random((particles, 1))
    plain = poses.tobytes() + np.hstack([poses, weights]).tobytes()
    packed = for_clouds().compress(plain)
    assert zstandard.decompress(packed) == plain
    assert len(packed) < 45 * particles < len(plain) / 2


def test_a_compressor_used_again_says_the_same() -> None:
    compressor, data = for_clouds(), bytes(range(256)) * 500
    assert compressor.compress(data) == compressor.compress(data) == for_clouds().compress(data)
