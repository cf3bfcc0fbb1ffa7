"""What a message may be of which nothing is known but its bytes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

from mclcli.io.logs.base import Channel, RawMessage, Recorded
from mclcli.io.messages.decoding import DECODABLE, Undecodable, decode

_ENCODINGS = ("cdr", "ros1")
_TYPES = sorted(DECODABLE, key=lambda kind: (kind.startswith("tf/"), kind))  # of two of the same layout, today's


@final
@dataclass(slots=True)
class Guesses:
    """Channels of a log that nothing in it describes, by their number: each is of the type its first message parses as.

    A message must parse to its last byte as one of the types in ``DECODABLE``, with rotations that are some.
    """

    channels: dict[int, Channel] = field(default_factory=dict)

    def __call__(self, number: int, data: bytes) -> Channel | None:
        """Channel ``/unknown/N`` for a message, None if it parses as nothing, or not as those before it."""
        known = self.channels.get(number)
        candidates = [known] if known is not None else _candidates(number)
        found = next((channel for channel in candidates if _parses(channel, data)), None)
        if found is not None:
            self.channels[number] = found
        return found


def _candidates(number: int) -> list[Channel]:
    return [_channel(number, kind, encoding) for encoding in _ENCODINGS for kind in _TYPES]


def _channel(number: int, kind: str, encoding: str) -> Channel:
    name = kind.replace("/msg/", "/") if encoding == "ros1" else kind
    return Channel(f"/unknown/{number}", kind, encoding, recorded=Recorded(name, "", b""))


def _parses(channel: Channel, data: bytes) -> bool:
    record = decode(RawMessage(channel, 0, data))
    return not isinstance(record, Undecodable) and record != ()
