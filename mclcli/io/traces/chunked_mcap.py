"""An MCAP file that survives being interrupted: small chunks of whole steps, written by a thread."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar, final

from mclcli.errors import InputError
from mclcli.io.traces.mcap_writer import McapWriter
from mclcli.io.traces.sinks import stamp_text
from mclcli.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mclcli.io.logs.base import Attachment
    from mclcli.io.traces.mcap_writer import Compressor
    from mclcli.io.traces.sinks import BinarySink

Key = TypeVar("Key")

LIBRARY = f"mclcli {__version__}"
"""What stands in a file as the library that wrote it."""
CHUNK_BYTES = 64 * 1024
"""A chunk ends after the step in which it passes this size: a killed run loses at most one."""

# rosbag2's YAML: keep last, reliable, volatile (2) or transient local (1), automatic liveliness, no deadlines.
NUMBERED_QOS = """\
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

# A metadata record for files with such numbers: below version 9, rosbag2 reads them; without this record newer ones
# expect names, older ones numbers.
# Source: rosbag2_storage_mcap/src/mcap_storage.cpp (read_metadata), rosbag2_storage/src/rosbag2_storage/qos.cpp.
ROSBAG2 = """\
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
class Stream:
    """A channel to be, described as the file will: topic, encoding of its messages, schema (none if ``type`` is '')."""

    topic: str
    type: str
    form: str
    schema: bytes
    encoding: str
    metadata: tuple[tuple[str, str], ...] = ()


def ros2_stream(topic: str, kind: str, definition: str, *, latched: bool = False) -> Stream:
    """Channel of ROS 2 messages of a type (``tf2_msgs/msg/TFMessage``) with its full ``ros2msg`` definition."""
    qos = NUMBERED_QOS.format(depth=1 if latched else 10, durability=1 if latched else 2)
    return Stream(topic, kind, "ros2msg", definition.encode(), "cdr", (("offered_qos_profiles", qos),))


@final
class ChunkedMcap(Generic[Key]):
    """Appends messages of known streams; every batch stays within one chunk, zstd-compressed and checksummed.

    A chunk ends once its messages pass ``chunk_bytes``, each counted with ``message_bytes`` beside its data.
    ``streams`` may grow meanwhile. ``records`` are metadata by name, ``attached`` names a text to attach.
    Chunks are made and written by one thread of the file's own: meanwhile the caller goes on, and a
    KeyboardInterrupt, which reaches the main thread only, cannot tear a chunk. Hence ``close`` after any exception
    leaves a complete file of whole batches. An error in writing is raised by a later call, ``close`` at the latest.
    """

    __slots__ = (
        "_channels",
        "_chunk_bytes",
        "_done",
        "_message_bytes",
        "_pending",
        "_schemas",
        "_size",
        "_streams",
        "_worker",
        "_writer",
    )

    def __init__(
        self,
        sink: BinarySink,
        streams: Mapping[Key, Stream],
        compressor: Compressor,
        *,
        profile: str = "ros2",
        records: Mapping[str, Mapping[str, str]],
        attached: tuple[str, str] | None = None,
        chunk_bytes: int = CHUNK_BYTES,
        message_bytes: int = 0,
        library: str = LIBRARY,
    ) -> None:
        self._writer = McapWriter(sink, compressor, profile=profile, library=library)
        for name, pairs in records.items():
            self._writer.add_metadata(name, {key: _utf8(value) for key, value in pairs.items()})
        if attached:
            name, text = attached
            self._writer.attach(name, "application/yaml", _utf8(text).encode())
        self._streams = streams
        self._chunk_bytes = chunk_bytes
        self._message_bytes = message_bytes
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[Key, int] = {}
        self._pending: list[tuple[int, int, Key, bytes, int | None]] = []
        self._size = 0
        self._worker: ThreadPoolExecutor | None = ThreadPoolExecutor(1, "mcl-mcap")
        self._done: Future[None] | None = None

    def add(
        self,
        log_time_ns: int,
        batch: Sequence[tuple[Key, bytes]],
        publish_ns: int | None = None,
        sequence: int | None = None,
    ) -> None:
        """Append messages (stream, bytes) that share a chunk; InputError for a time before 1970."""
        if log_time_ns < 0:
            raise InputError(f"MCAP: stamp {stamp_text(log_time_ns)} is before 1970; write CSV instead")
        published = log_time_ns if publish_ns is None else publish_ns
        self._pending += [(log_time_ns, published, key, data, sequence) for key, data in batch]
        self._size += sum(len(data) + self._message_bytes for _, data in batch)
        if self._size > self._chunk_bytes:
            self._hand_over()

    def attach(self, attachment: Attachment) -> None:
        """Write a file within the file."""
        kept, times = attachment, {"log_ns": attachment.log_time_ns, "created_ns": attachment.create_time_ns}
        self._submit(lambda: self._writer.attach(kept.name, kept.media_type, kept.data, **times))

    def add_metadata(self, name: str, pairs: Mapping[str, str]) -> None:
        """Write pairs of texts under a name."""
        self._submit(lambda: self._writer.add_metadata(name, pairs))

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
        chunk, self._pending, self._size = self._pending, [], 0
        self._submit(lambda: self._write(chunk))

    def _submit(self, task: Callable[[], None]) -> None:
        """Let the thread do something, once it has done what came before."""
        self._wait()
        if self._worker is None:
            raise ValueError("the MCAP file is closed")
        self._done = self._worker.submit(task)

    def _wait(self) -> None:
        if self._done is not None:
            self._done.result()

    def _write(self, chunk: list[tuple[int, int, Key, bytes, int | None]]) -> None:
        for log_time_ns, publish_ns, key, data, sequence in chunk:
            channel = self._channels.get(key) or self._register(key)
            self._writer.add_message(channel, log_time_ns, publish_ns, data, sequence)
        self._writer.end_chunk()

    def _register(self, key: Key) -> int:
        stream = self._streams[key]
        schema = (stream.type, stream.form, stream.schema)
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(*schema) if stream.type else 0
        metadata = dict(stream.metadata)
        channel = self._writer.register_channel(stream.topic, stream.encoding, self._schemas[schema], metadata)
        self._channels[key] = channel
        return channel


def _utf8(text: str) -> str:
    """Text that can be encoded: names of files may hold bytes that are not UTF-8."""
    return text.encode("utf-8", "backslashreplace").decode()
