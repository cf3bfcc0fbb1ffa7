"""What could be saved of a log, as an MCAP that any reader takes: indexed, checksummed, in order of log time."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.errors import InputError
from mclcli.io.logs.base import Attachment
from mclcli.io.traces.chunked_mcap import LIBRARY, ROSBAG2, ChunkedMcap, Stream
from mclcli.io.traces.mcap_writer import standard

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from typing import Self

    from mclcli.io.logs.base import Channel, Heading, MetadataRecord, RawMessage, Recorded
    from mclcli.io.traces.sinks import BinarySink

CHUNK_BYTES = 1 << 20
MESSAGE_BYTES = 200
"""Bytes that each message counts for in a chunk beside its data: a million tiny ones are many chunks."""
UNWRITABLE = "log time outside 1970…2262"
"""Reason under which messages are counted that MCAP cannot date."""
_CHANNELS = 65535
_FORMS = {"cdr": "ros2msg", "ros1": "ros1msg"}
_PROFILES = {frozenset({"cdr"}): "ros2", frozenset({"ros1"}): "ros1"}
_COMPRESSION = re.compile(r"^(\s*compression_(?:mode|format)):.*$", re.MULTILINE)


@final
@dataclass(slots=True)
class RecoveredMcap:
    """Writes messages as they were recorded: same bytes, same types, same times; ``written`` counts them by topic.

    Make one with ``begin``. ``close`` after any exception leaves a complete file (see ``ChunkedMcap``).
    """

    file: ChunkedMcap[int]
    streams: dict[int, Stream]
    keys: dict[tuple[Channel, Recorded | None], int] = field(default_factory=dict)
    written: Counter[str] = field(default_factory=Counter)
    beside: Counter[str] = field(default_factory=Counter)
    _by_id: dict[int, tuple[Channel, int]] = field(default_factory=dict)  # a channel's hash takes long

    @classmethod
    def begin(cls, sink: BinarySink, channels: Iterable[Channel], headings: Collection[Heading] = ()) -> Self:
        """Start a file; what the log's files say of themselves gives its profile, or else the ``channels`` do."""
        known, streams = list(channels), dict[int, Stream]()
        profiles = {heading.profile for heading in headings}
        profile = _PROFILES.get(frozenset(channel.encoding for channel in known), "")
        libraries = sorted({heading.library for heading in headings if heading.library})
        file = ChunkedMcap(
            sink,
            streams,
            standard(),
            profile=profiles.pop() if len(profiles) == 1 else profile,
            records={"rosbag2": {"serialized_metadata": ROSBAG2}} if any(map(_has_numbers, known)) else {},
            chunk_bytes=CHUNK_BYTES,
            message_bytes=MESSAGE_BYTES,
            library="; ".join([*libraries, LIBRARY]),
        )
        return cls(file, streams)

    def write(self, message: RawMessage) -> bool:
        """Append one message; False if its time cannot be written."""
        channel, stamp_ns, data, publish_ns, sequence = message
        if stamp_ns < 0:
            return False
        known = self._by_id.get(id(channel))
        key = self._register(channel) if known is None else known[1]
        self.file.add(stamp_ns, [(key, data)], publish_ns if publish_ns and publish_ns > 0 else None, sequence)
        self.written[channel.topic] += 1
        return True

    def carry(self, item: Attachment | MetadataRecord) -> None:
        """Write what stood beside the messages, as it was; but messages are not compressed one by one any more."""
        if isinstance(item, Attachment):
            self.file.attach(item)
            self.beside["attachment"] += 1
            return
        pairs = dict(item.pairs)
        if item.name == "rosbag2":
            pairs = {name: _COMPRESSION.sub(r'\1: ""', text) for name, text in pairs.items()}
        self.file.add_metadata(item.name, pairs)
        self.beside["metadata record"] += 1

    def close(self) -> None:
        """Finish the file. Later calls do nothing."""
        self.file.close()

    def _register(self, channel: Channel) -> int:
        key = self.keys.setdefault((channel, channel.recorded), len(self.keys))
        if key == _CHANNELS:
            raise InputError(f"more than {_CHANNELS} channels, the most an MCAP may have; recover its files one by one")
        if key not in self.streams:
            self.streams[key] = _stream(channel)
        if len(self._by_id) == _CHANNELS:
            self._by_id.clear()
        self._by_id[id(channel)] = channel, key
        return key


def _stream(channel: Channel) -> Stream:
    """How a channel is described: as its file did, completed from the definitions we know where it said nothing."""
    recorded = channel.recorded
    if recorded is None or (not recorded.schema and channel.encoding in _FORMS):
        from mclcli.io.messages.definitions import definition_of

        text = definition_of(channel)
        form, metadata = _FORMS.get(channel.encoding, "") if text else "", recorded.metadata if recorded else ()
        name = recorded.name if recorded else channel.type
        return Stream(channel.topic, name, form, text.encode(), channel.encoding, metadata)
    name, form, schema, metadata = recorded.name, recorded.form, recorded.schema, recorded.metadata
    return Stream(channel.topic, name, form, schema, channel.encoding, metadata)


def _has_numbers(channel: Channel) -> bool:
    """Whether QoS settings stand there as numbers, as rosbag2 wrote them before Iron."""
    pairs = channel.recorded.metadata if channel.recorded else ()
    return any(key == "offered_qos_profiles" and _NUMBER.search(text) for key, text in pairs)


_NUMBER = re.compile(r"history: \d")
