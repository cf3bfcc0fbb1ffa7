"""Schemas, channels and connections that stand only behind the messages they describe: in the summary or the index."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import pytest
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as BagWriter

from mclcli.io.logs.bag1_file import Bag1File
from mclcli.io.logs.mcap_file import McapFile
from mclcli.io.logs.source import ByteSource
from tests.io.logs import look, mcap_bytes, numbers, ros1_bag

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.io.logs import Seen

COUNT = 120
STAMPS = [10**9 + number * 10**7 for number in range(COUNT)]
NONE, ZSTD, LZ4 = CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4
BAGS = BagWriter.CompressionFormat
KINDS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": ZSTD},
    "lz4": {"compression": LZ4},
    "none": {"compression": NONE},
    "unchunked": {"chunked": False},
    "unchecked": {"compression": LZ4, "enable_crcs": False, "data_crc": False},
    "without statistics": {"use_statistics": False},
}


def bag(folder: Path, compression: Any) -> bytes:
    return ros1_bag(folder / "x.bag", COUNT, compression)


def make(kind: str, folder: Path) -> bytes:
    if kind.endswith(".bag"):
        return bag(folder, {"bz2.bag": BAGS.BZ2, "lz4.bag": BAGS.LZ4}.get(kind))
    return mcap_bytes(STAMPS, **KINDS[kind])


def read(data: bytes, *, pipe: bool = False) -> Seen:
    def start() -> ByteSource:
        return ByteSource(io.BytesIO(data), None if pipe else len(data))

    return look(Bag1File("x.bag", start) if data[:7] == b"#ROSBAG" else McapFile("x.mcap", start))


def head_zeroed(data: bytes) -> bytes:
    """The first part zeroed behind the magic, with all that it defines."""
    start = 13 if data[:1] == b"#" else 8
    return data[:start] + bytes(_head(data) - start) + data[_head(data) :]


def head_dropped(data: bytes) -> bytes:
    """The first part cut out behind the magic, so that everything that follows has moved."""
    start = 13 if data[:1] == b"#" else 8
    return data[:start] + data[_head(data) :]


def head_random(data: bytes) -> bytes:
    """The first part overwritten with what means nothing."""
    start = 13 if data[:1] == b"#" else 8
    return data[:start] + bytes((7 * k * k + 13 * k) % 251 for k in range(_head(data) - start)) + data[_head(data) :]


def _head(data: bytes) -> int:
    return 4096 + 2000 if data[:1] == b"#" else 1500


@pytest.mark.parametrize("pipe", [False, True])
@pytest.mark.parametrize("change", [head_zeroed, head_dropped, head_random])
@pytest.mark.parametrize("kind", [*KINDS, "none.bag", "bz2.bag", "lz4.bag"])
def test_all_whole_messages_come_out_where_the_head_is_lost(
    kind: str, change: Callable[[bytes], bytes], tmp_path: Path, *, pipe: bool
) -> None:
    seen = read(change(make(kind, tmp_path)), pipe=pipe)
    found = numbers(seen)
    assert found == sorted(found), "in file order"
    assert found[-1] == COUNT - 1
    assert len(found) >= COUNT - 25
    assert any(not damage.lossless for damage in seen.damages)
    assert not any("every message" in damage.what for damage in seen.damages)


@pytest.mark.parametrize("kind", ["zstd", "lz4", "bz2.bag", "lz4.bag"])
@pytest.mark.parametrize("pipe", [False, True])
def test_what_is_lost_with_the_first_chunk_is_counted(kind: str, tmp_path: Path, *, pipe: bool) -> None:
    data = bytearray(make(kind, tmp_path))
    at = data.index({"zstd": b"\x28\xb5\x2f\xfd", "bz2.bag": b"BZh91AY"}.get(kind, b"\x04\x22\x4d\x18"))
    data[at + 100 : at + 400] = bytes(300)
    seen = read(bytes(data), pipe=pipe)
    found = numbers(seen)
    assert found == list(range(COUNT - len(found), COUNT))
    assert sum(damage.messages or 0 for damage in seen.damages if not damage.lossless) == COUNT - len(found)
