"""What could be saved of a log, as an MCAP that any reader takes: indexed, checksummed, in order of log time."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.errors import InputError
from mclcli.io.traces.chunked_mcap import ROSBAG2, ChunkedMcap, Stream
from mclcli.io.traces.mcap_writer import standard

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Self

    from mclcli.io.logs.base import Channel, RawMessage
    from mclcli.io.traces.sinks import BinarySink

CHUNK_BYTES = 1 << 20
UNWRITABLE = "log time outside 1970…2262"
"""Reason under which messages are counted that MCAP cannot date."""
_CHANNELS = 65535
_FORMS = {"cdr": "ros2msg", "ros1": "ros1msg"}
_PROFILES = {frozenset({"cdr"}): "ros2", frozenset({"ros1"}): "ros1"}


@final
@dataclass(slots=True)
class RecoveredMcap:
    """Writes messages as they were recorded: same bytes, same types, same times; ``written`` counts them by topic.

    Make one with ``begin``. ``close`` after any exception leaves a complete file (see ``ChunkedMcap``).
    """

    file: ChunkedMcap[Channel]
    streams: dict[Channel, Stream]
    written: Counter[str] = field(default_factory=Counter)

    @classmethod
    def begin(cls, sink: BinarySink, channels: Iterable[Channel]) -> Self:
        """Start a file; the ``channels`` known so far decide its profile, ``ros1``, ``ros2`` or none."""
        streams = {channel: _stream(channel) for channel in channels}
        profile = _PROFILES.get(frozenset(channel.encoding for channel in streams), "")
        records = {"rosbag2": {"serialized_metadata": ROSBAG2}} if any(map(_has_numbers, streams.values())) else {}
        return cls(
            ChunkedMcap(sink, streams, standard(), profile=profile, records=records, chunk_bytes=CHUNK_BYTES), streams
        )

    def write(self, message: RawMessage) -> bool:
        """Append one message; False if its time cannot be written."""
        channel, stamp_ns, data, publish_ns = message[:4]
        if stamp_ns < 0:
            return False
        if channel not in self.streams:
            if len(self.streams) == _CHANNELS:
                raise InputError(
                    f"more than {_CHANNELS} channels, the most an MCAP may have; recover its files one by one"
                )
            self.streams[channel] = _stream(channel)
        self.file.add(stamp_ns, [(channel, data)], publish_ns if publish_ns and publish_ns > 0 else None)
        self.written[channel.topic] += 1
        return True

    def close(self) -> None:
        """Finish the file. Later calls do nothing."""
        self.file.close()


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


def _has_numbers(stream: Stream) -> bool:
    """Whether QoS settings stand there as numbers, as rosbag2 wrote them before Iron."""
    return any(key == "offered_qos_profiles" and _NUMBER.search(text) for key, text in stream.metadata)


_NUMBER = re.compile(r"history: \d")
