"""A log of one kind of message: after the first bytes, x and y [m] of a pose on a line each, a second apart."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import EVERYTHING, Channel, FileFacts, Item, RawMessage, Wish

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.io.logs.source import Origin

MAGIC = b"TOYLOG\n"
_POSES = Channel("/poses", "geometry_msgs/msg/PoseStamped", "cdr")


@final
@dataclass(frozen=True, slots=True)
class ToyFile:
    """The log, from a file or a pipe."""

    source: str
    start: Origin

    def items(self, wish: Wish = EVERYTHING) -> Iterator[Item]:
        """Its channel, its messages and what it is (see ``Container``)."""
        with self.start() as stream:
            lines = stream.read(1 << 20).removeprefix(MAGIC).decode().splitlines()
        yield _POSES
        for number, line in enumerate(lines if wish.channels is None or wish.channels(_POSES) else (), 1):
            x, y = map(float, line.split())
            pose = struct.pack("<iII4s7d", number, 0, 4, b"map\0", x, y, 0, 0, 0, 0, 1)
            yield RawMessage(_POSES, number * 10**9, b"\0\1\0\0" + pose)
        yield FileFacts(self.source, "toy log", closed=True, checksums="no")
