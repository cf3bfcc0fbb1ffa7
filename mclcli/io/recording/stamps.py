"""Where the stamp stands in a message's bytes: read without decoding the rest."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mclcli.io.logs.base import Channel, RawMessage

SECOND = 1_000_000_000
TRANSFORMS = frozenset({"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"})
_MAP = "nav_msgs/msg/OccupancyGrid"


def place_of_stamp(channel: Channel, data: bytes) -> tuple[struct.Struct | None, int]:
    """Form and place of the first stamp in the messages of a channel, from its type and one message.

    The form is None where there is none, or it says nothing: static transforms and maps hold at all times, and may be
    stamped long before.
    """
    from mclcli.io.messages.definitions import begins_with_header

    array_first = channel.type in TRANSFORMS
    if channel.topic.endswith("tf_static") or channel.type == _MAP:
        return None, 0
    if not array_first and not begins_with_header(channel):
        return None, 0
    if channel.encoding == "ros1":  # a count of transforms, then seq, then the stamp
        return struct.Struct("<II"), 8 if array_first else 4
    if data[:2] not in {b"\0\0", b"\0\1"}:  # no plain CDR: what stands at that place is no stamp
        return None, 0
    order = "<" if data[1:2] == b"\1" else ">"
    return struct.Struct(f"{order}iI"), 8 if array_first else 4


def stamp_in(message: RawMessage) -> int | None:
    """The first stamp of a message [ns], 0 where it is not stamped; None where its type has none that counts."""
    layout, at = place_of_stamp(message.channel, message.data)
    if layout is None or len(message.data) < at + 8:
        return None
    seconds, rest = layout.unpack_from(message.data, at)
    return int(seconds * SECOND + rest)
