"""What is wrong with one file, while it is being read: the damages of all containers are worded here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import Damage
from mclcli.io.logs.inflate import RECORD_LIMIT

if TYPE_CHECKING:
    from collections.abc import Iterator

CUT = "file ends in the middle of a record; it was not closed"
UNCLOSED = "file was not closed; every message in it was read, what should have followed is unknown"
RESUMES = 1000
"""Times that reading is taken up again after broken framing."""


@final
@dataclass(slots=True)
class Report:
    """Makes the damages of the file ``source``. ``hurt``: messages were lost, so that totals need not agree.

    ``counted`` messages were said to be lost, beside those of ``uncounted`` damages that cannot tell how many.
    """

    source: str
    hurt: bool = False
    counted: int = 0
    uncounted: int = 0
    bad_chunk: Damage | None = None  # a dropped chunk, waiting for its indexes to tell what was in it

    def lost(
        self, at: int, what: str, messages: int | None = None, first: int | None = None, last: int | None = None
    ) -> Damage:
        """Damage at byte ``at`` that cost messages, or may have; ``first`` and ``last`` are log times [ns]."""
        self.hurt = True
        self._count(messages)
        return Damage(self.source, at, what, messages, first, last)

    def _count(self, messages: int | None) -> None:
        self.counted += messages or 0
        self.uncounted += messages is None

    def harmless(self, at: int, what: str) -> Damage:
        """Damage that cost no message."""
        return Damage(self.source, at, what, lossless=True)

    def too_large(self, at: int, size: int) -> Damage:
        """A record that is passed over because it would fill the memory."""
        return self.lost(at, f"record at byte {at} has {size >> 20} MiB, more than {RECORD_LIMIT >> 20}; it is skipped")

    def flush(self) -> Iterator[Damage]:
        """Hand out the chunk that was waiting, if one was."""
        if self.bad_chunk is not None:
            if self.bad_chunk.messages is not None:  # it was lost without a number
                self.uncounted -= 1
                self._count(self.bad_chunk.messages)
            yield self.bad_chunk
        self.bad_chunk = None

    def totals(self, at: int, found: int, declared: int | None, nameless: int) -> Iterator[Damage]:
        """Compare messages found with those the file states; ``nameless`` of them have a channel nobody describes."""
        whole, more = not self.hurt, (declared or 0) - found - self.counted
        if nameless:
            yield self.lost(at, "messages of channels that nothing describes", nameless)
        if declared is not None and declared != found and whole and not nameless:
            what = f"file counts {declared} messages, but {found} were found"
            yield self.lost(at, what, declared - found if declared > found else None)
        elif more > 0 and not whole and not self.uncounted:
            yield self.lost(
                at, f"file counts {declared} messages, {more} more than were found or said to be lost", more
            )
