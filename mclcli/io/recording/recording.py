"""A log opened for replay: looked through once to find its way about, then read message by message."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, final

from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from mclcli.io.messages.decoding import Undecodable, decode
from mclcli.io.recording.cameras import Cameras
from mclcli.io.recording.roles import RequestedRoles, Roles, assign
from mclcli.io.recording.survey import LogSurvey, survey_log

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.io.logs import Log
    from mclcli.io.logs.base import RawMessage
    from mclcli.io.recording.diagnosis import Diagnosis

_HEAD_NS = 10_000_000_000
_HEAD_BYTES = 64 * 2**20


def open_recording(*paths: str | Path, strict: bool = False) -> Recording:
    """Open a log: a file, a rosbag2 folder, or several files that make up one log.

    Raises
    ------
    UsageError, InputError
        If there is no such file, or it is not a log; with ``strict`` at the first damage.

    """
    return Recording(open_log([Path(path) for path in paths]), strict=strict)


@final
class Recording:
    """A log and what a first look found in it.

    A file is looked through whole. A pipe cannot be read twice: its first 10 s are kept and looked through, and what
    comes later goes by once, unless the ``whole`` of it is only to be looked at. ``tally`` counts what was read;
    ``diagnosis`` sees all that is looked through.
    """

    def __init__(
        self, log: Log, *, strict: bool = False, whole: bool = False, diagnosis: Diagnosis | None = None
    ) -> None:
        self.log = log
        self.tally = Tally()
        self._head: list[RawMessage] = []
        self._rest: Iterator[RawMessage] = iter(())
        if log.seekable or whole:
            messages = log.messages(None, self.tally, strict=strict)
            self.survey = survey_log(diagnosis.watch(messages) if diagnosis else messages)
            seen = self.survey.topics
            self.survey.silent = {of.topic: of for of in self.tally.channels if of.topic not in seen}
        else:
            self._rest = log.messages(None, self.tally, strict=strict)
            self.survey = self._look_ahead()

    def roles(self, requested: RequestedRoles | None = None) -> Roles:
        """Which topic plays which part; see ``mclcli.io.recording.roles.assign``."""
        return assign(self.survey, requested or RequestedRoles())

    def events(self, topics: Iterable[str]) -> Iterator[tuple[str, object]]:
        """Decoded messages of some topics, (topic, record), in log-time order; those that cannot be are counted.

        Landmarks found in images come as rays: calibrations of their cameras are read along with them.
        """
        wanted = frozenset(topics)
        cameras = Cameras(self.survey, wanted, self.tally)
        for message in self._messages(wanted | cameras.topics):
            record = decode(message, self.tally)
            if isinstance(record, Undecodable):
                continue
            usable = cameras.see(message.channel.topic, record)
            if usable is not None and message.channel.topic in wanted:
                yield message.channel.topic, usable

    @property
    def first_ns(self) -> int:
        """Log time of the first message, 0 for an empty log."""
        return (self.survey.span_ns or (0, 0))[0]

    def raw(self, topic: str) -> Iterator[RawMessage]:
        """Messages of one topic as recorded."""
        return self._messages(frozenset({topic}))

    def records(self, topic: str) -> list[object]:
        """Everything decodable of one topic; of a pipe, only what its head holds."""
        messages = self._messages(frozenset({topic})) if self.log.seekable else iter(self._head)
        records = (decode(message) for message in messages if message.channel.topic == topic)
        return [record for record in records if not isinstance(record, Undecodable)]

    def _messages(self, wanted: frozenset[str]) -> Iterator[RawMessage]:
        if self.log.seekable:
            return self.log.messages(wanted, Tally(), announce=False)
        return (message for message in chain(self._head, self._rest) if message.channel.topic in wanted)

    def _look_ahead(self) -> LogSurvey:
        survey, size = LogSurvey(complete=False), 0
        for message in self._rest:
            self._head.append(message)
            survey.add(message)
            size += len(message.data)
            span = survey.span_ns
            if size > _HEAD_BYTES or (span and span[1] - span[0] > _HEAD_NS):
                break
        return survey
