"""What is wrong with one file, while it is being read: the damages of all containers are worded here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import Damage
from mclcli.io.logs.inflate import RECORD_LIMIT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.io.logs.channels import WatchedChannels

DATA_ALTERED = "data section fails its checksum; something outside its chunks was altered"
CUT = "file ends in the middle of a record; it was not closed"
UNCLOSED = "file was not closed; every message in it was read, what should have followed is unknown"
UNCLOSED_HURT = "file was not closed; what should have followed is unknown"
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
    apart: bool = False  # something may be wrong that no count of messages can settle
    bad_chunk: Damage | None = None  # a dropped chunk, waiting for its indexes to tell what was in it

    def lost(
        self, at: int, what: str, messages: int | None = None, first: int | None = None, last: int | None = None
    ) -> Damage:
        """Damage at byte ``at`` that cost messages, or may have; ``first`` and ``last`` are log times [ns]."""
        self.hurt = True
        self._count(messages)
        return Damage(self.source, at, what, messages, first, last)

    def beyond(self, at: int, what: str) -> Damage:
        """Damage to what the file's own counts of messages do not cover."""
        self.apart = True
        return self.lost(at, what)

    def _count(self, messages: int | None) -> None:
        self.counted += messages or 0
        self.uncounted += messages is None

    def harmless(self, at: int, what: str) -> Damage:
        """Damage that cost no message."""
        return Damage(self.source, at, what, lossless=True)

    def too_large(self, at: int, size: int) -> Damage:
        """A record that is passed over because it would fill the memory."""
        return self.lost(at, f"record at byte {at} has {size >> 20} MiB, more than {RECORD_LIMIT >> 20}; it is skipped")

    def count_index(self, messages: int, first_ns: int, before: tuple[int, int] | None) -> None:
        """Count the ``messages`` of a chunk that was dropped by an index that follows it.

        An index whose ``first_ns`` lies between the times of the chunk ``before``, which was read, is of that one.
        """
        lost = self.bad_chunk
        if lost is None or not messages:
            return
        if lost.first_ns is None and before is not None and before[0] <= first_ns <= before[1]:
            return
        self.bad_chunk = replace(lost, messages=(lost.messages or 0) + messages)

    def flush(self, *, broken: bool = False) -> Iterator[Damage]:
        """Hand out the chunk that was waiting, if one was; where framing is ``broken`` not all its indexes were met."""
        if self.bad_chunk is not None:
            known, least = self.bad_chunk.messages, self.bad_chunk.least or broken
            self.bad_chunk = replace(self.bad_chunk, least=least and known is not None)
            if known is not None:  # it was lost without a number
                self.uncounted -= not least
                self.counted += known
            yield self.bad_chunk
        self.bad_chunk = None

    def regained(self, at: int, messages: int) -> Iterator[Damage]:
        """Messages of the chunk at byte ``at`` that were said to be lost, and were read in the end."""
        again = min(messages, self.counted)
        if again:
            self.counted -= again
            yield replace(
                self.harmless(at, f"chunk at byte {at} was found by the index and read after all"), messages=-again
            )

    def unclosed(self, at: int) -> Damage:
        """The file ends where a record would start, and nothing ends it."""
        return self.lost(at, UNCLOSED_HURT if self.hurt else UNCLOSED)

    def nameless(self, at: int, channels: WatchedChannels) -> Damage:
        """Messages that were found, and that nothing describes."""
        return self.lost(at, "messages of channels that nothing describes", channels.nameless)

    def totals(self, at: int, found: int, declared: int, by: str, *, least: bool = False) -> Iterator[Damage]:
        """Compare messages found with those ``declared``, ``by`` what; the last word where damages had no number.

        ``least``: there may have been more than ``declared``, so that this settles nothing.
        """
        more = declared - found - self.counted
        if not self.hurt and declared != found:
            what = f"{by} {declared} messages, but {found} were found"
            yield self.lost(at, what, declared - found if declared > found else None)
        elif more > 0:
            what = f"{by} {declared} messages, {more} more than were found or said to be lost"
            yield replace(self.lost(at, what, more), in_all=not least and not self.apart)
        elif self.uncounted and not self.apart and not least and declared == found + self.counted:
            what = f"{by} {declared} messages, which is what was found and said to be lost"
            yield replace(self.harmless(at, what), in_all=True)
