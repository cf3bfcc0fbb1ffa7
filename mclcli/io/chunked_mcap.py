"""An MCAP file, profile ros2, that survives being interrupted: small chunks of whole steps, written by a thread."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, cast, final

from mcap.writer import CompressionType, Writer

from mclcli.errors import InputError
from mclcli.io.writers import stamp_text
from mclcli.version import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.io.writers import BinarySink

CHUNK_BYTES = 64 * 1024
"""A chunk ends after the step in which it passes this size: a killed run loses at most one."""

# rosbag2's YAML: keep last, reliable, volatile (2) or transient local (1), automatic liveliness, no deadlines.
_QOS = """\
- history: 1
  depth: {depth}
  reliability: 1
  durability: {durability}
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"""

# Below version 9, rosbag2 reads the numbers above; without this record newer ones expect names, older ones numbers.
# Source: rosbag2_storage_mcap/src/mcap_storage.cpp (read_metadata), rosbag2_storage/src/rosbag2_storage/qos.cpp.
_ROSBAG2 = """\
version: 5
storage_identifier: mcap
duration:
  nanoseconds: 0
starting_time:
  nanoseconds_since_epoch: 0
message_count: 0
topics_with_message_count: []
compression_format: ""
compression_mode: ""
relative_file_paths: []
files: []
"""


@final
@dataclass(frozen=True, slots=True)
class Topic:
    """A channel to be: message type (``tf2_msgs/msg/TFMessage``), full ``ros2msg`` definition, and if it is latched."""

    type: str
    definition: str
    latched: bool = False


@final
class ChunkedMcap:
    """Appends messages of known topics; every batch stays within one chunk, zstd-compressed and checksummed.

    Chunks are made and written by one thread of the file's own: meanwhile the caller goes on, and a
    KeyboardInterrupt, which reaches the main thread only, cannot tear a chunk. Hence ``close`` after any exception
    leaves a complete file of whole batches. An error in writing is raised by a later call, ``close`` at the latest.
    """

    __slots__ = ("_channels", "_counts", "_done", "_pending", "_schemas", "_size", "_topics", "_worker", "_writer")

    def __init__(
        self, stream: BinarySink, *, topics: Mapping[str, Topic], metadata: Mapping[str, str], parameters_yaml: str
    ) -> None:
        # Only flush() may end a chunk: with this size the library never does by itself.
        self._writer: Any = Writer(cast("BinaryIO", _Counted(stream)), 1 << 62, CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=f"mclcli {__version__}")
        self._writer.add_metadata("mcl", {key: _utf8(value) for key, value in metadata.items()})
        self._writer.add_metadata("rosbag2", {"serialized_metadata": _ROSBAG2})
        self._writer.add_attachment(0, 0, "parameters.yaml", "application/yaml", _utf8(parameters_yaml).encode())
        self._topics = topics
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._pending: list[tuple[int, str, bytes]] = []
        self._size = 0
        self._worker: ThreadPoolExecutor | None = ThreadPoolExecutor(1, "mcl-trace")
        self._done: Future[None] | None = None

    def add(self, log_time_ns: int, batch: list[tuple[str, bytes]]) -> None:
        """Append messages (topic, CDR) that share a chunk; InputError for a time before 1970."""
        if log_time_ns < 0:
            raise InputError(f"MCAP trace: stamp {stamp_text(log_time_ns)} is before 1970; write CSV instead")
        self._pending += [(log_time_ns, topic, data) for topic, data in batch]
        self._size += sum(len(data) for _, data in batch)
        if self._size > CHUNK_BYTES:
            self._hand_over()

    def close(self) -> None:
        """Write what is pending, the indexes and the summary. Later calls do nothing."""
        worker = self._worker
        if worker is None:
            return
        try:
            self._hand_over()
            self._wait()
            worker.submit(self._writer.finish).result()
        finally:
            self._worker = None
            worker.shutdown()

    def _hand_over(self) -> None:
        """Give the pending messages to the thread, once it has written those before."""
        self._wait()
        if self._worker is None:
            raise ValueError("the MCAP file is closed")
        chunk, self._pending, self._size = self._pending, [], 0
        self._done = self._worker.submit(self._write, chunk)

    def _wait(self) -> None:
        if self._done is not None:
            self._done.result()

    def _write(self, chunk: list[tuple[int, str, bytes]]) -> None:
        for log_time_ns, name, data in chunk:
            channel = self._channels.get(name) or self._register(name)
            self._counts[name] = sequence = self._counts.get(name, -1) + 1
            self._writer.add_message(channel, log_time_ns, data, log_time_ns, sequence)
        self._writer.flush()

    def _register(self, name: str) -> int:
        topic = self._topics[name]
        if topic.type not in self._schemas:
            schema = self._writer.register_schema(topic.type, "ros2msg", topic.definition.encode())
            self._schemas[topic.type] = schema
        qos = _QOS.format(depth=1 if topic.latched else 10, durability=1 if topic.latched else 2)
        described = {"offered_qos_profiles": qos}
        channel: int = self._writer.register_channel(name, "cdr", self._schemas[topic.type], described)
        self._channels[name] = channel
        return channel


@final
class _Counted:
    """A stream that knows how far it has been written; pipes do not."""

    __slots__ = ("_count", "_stream", "flush")

    def __init__(self, stream: BinarySink) -> None:
        self._stream, self._count, self.flush = stream, 0, stream.flush

    def write(self, data: bytes) -> int:
        self._stream.write(data)
        self._count += len(data)
        return len(data)

    def tell(self) -> int:
        return self._count


def _utf8(text: str) -> str:
    """Text that can be encoded: names of files may hold bytes that are not UTF-8."""
    return text.encode("utf-8", "backslashreplace").decode()
