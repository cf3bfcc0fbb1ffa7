"""What all converters of messages share: the message under way, and small helpers."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, final

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.io.logs.base import RawMessage, Tally

    _A = TypeVar("_A", bound=NDArray[Any])

Parsed: TypeAlias = Any
"""An object of a rosbags message class: attributes named as the fields, without static types."""
STAMP_ZERO = "header stamp is 0: log time used"


@final
@dataclass(frozen=True, slots=True)
class Undecodable:
    """A message that cannot be used, and why; the reason is the same text for the same trouble."""

    reason: str


@final
@dataclass(frozen=True, slots=True)
class Context:
    """A message under way: the raw one, and where to note what is changed in it."""

    raw: RawMessage
    tally: Tally | None

    def stamp(self, header: Parsed) -> int:
        """Header's stamp [ns], or log time where it is 0."""
        stamp_ns = int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)
        if stamp_ns == 0:
            self.note(STAMP_ZERO)
            return self.raw.log_time_ns
        return stamp_ns

    def note(self, what: str) -> None:
        """Count a change, and warn of the first of its kind on this topic."""
        topic = self.raw.channel.topic
        if self.tally is not None and self.tally.note(topic, what) == 1 and self.tally.announce:
            logging.getLogger("mclcli").warning("%s: %s", topic, what)


def frame_name(name: str) -> str:
    """Frame id without the leading slash of old."""
    return name.lstrip("/")


def read_only(array: _A) -> _A:
    """The array itself, closed for writing."""
    array.flags.writeable = False
    return array
