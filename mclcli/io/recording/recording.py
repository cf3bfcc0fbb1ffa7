"""A log opened for replay: looked through once to find its way about, then read message by message."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, final

from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from mclcli.io.logs.spans import strands
from mclcli.io.messages.decoding import Undecodable, decode
from mclcli.io.recording.cameras import Cameras
from mclcli.io.recording.clocks import clocks_of
from mclcli.io.recording.roles import RequestedRoles, Roles, assign
from mclcli.io.recording.stamps import stamp_in
from mclcli.io.recording.survey import LogSurvey, survey_log
from mclcli.records import NextLog

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from mclcli.arrays import FloatArray
    from mclcli.io.logs import Log
    from mclcli.io.logs.base import RawMessage
    from mclcli.io.logs.spans import Strand
    from mclcli.io.recording.diagnosis import Diagnosis

    Watch = Callable[[Iterator[RawMessage]], Iterator[RawMessage]]

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
    ``diagnosis`` sees all that is looked through, ``watch`` passes it on; ``clocks`` are those of stamps and log times.
    Of several logs those that follow one another make up a strand; ``strands`` are read one after the other.
    """

    def __init__(
        self,
        log: Log,
        *,
        strict: bool = False,
        whole: bool = False,
        diagnosis: Diagnosis | None = None,
        watch: Watch | None = None,
    ) -> None:
        self.log = log
        self.tally = Tally()
        self._head: list[RawMessage] = []
        self._rest: Iterator[RawMessage] = iter(())
        self.survey = LogSurvey(complete=log.seekable or whole)
        messages = log.messages(None, self.tally, strict=strict, origin=self._origin)
        if self.survey.complete:
            messages = watch(messages) if watch else messages
            survey_log(diagnosis.watch(messages) if diagnosis else messages, self.survey)
            seen = self.survey.topics
            self.survey.silent = {of.topic: of for of in self.tally.channels if of.topic not in seen}
        else:
            self._rest = messages
            self._look_ahead()
        self.clocks = clocks_of(self.survey)
        self.strands = strands(self.tally.spans) if log.seekable else []

    def roles(self, requested: RequestedRoles | None = None) -> Roles:
        """Which topic plays which part; see ``mclcli.io.recording.roles.assign``."""
        return assign(self.survey, requested or RequestedRoles())

    def events(self, topics: Iterable[str]) -> Iterator[tuple[str, object]]:
        """Decoded messages of some topics, (topic, record), in log-time order; those that cannot be are counted.

        Between logs that do not follow one another comes a ``NextLog``, of topic ''.
        Landmarks found in images come as rays: calibrations of their cameras are read along with them.
        """
        wanted = frozenset(topics)
        cameras = Cameras(self.survey, wanted, self.tally)
        needed = wanted | cameras.topics
        if len(self.strands) < 2:
            yield from self._decoded(self._messages(needed), wanted, cameras)
            return
        for strand in self.strands:
            if strand.why:
                yield "", NextLog(strand.why)
            yield from self._decoded(self._of(strand, needed), wanted, cameras)

    def _decoded(
        self, messages: Iterable[RawMessage], wanted: frozenset[str], cameras: Cameras
    ) -> Iterator[tuple[str, object]]:
        tally = self.tally
        for message in map(self._on_stamps_clock, messages) if self.clocks.offset_ns else messages:
            record = decode(message, tally)
            if isinstance(record, Undecodable):
                continue
            usable = cameras.see(message.channel.topic, record)
            if usable is not None and message.channel.topic in wanted:
                yield message.channel.topic, usable

    def records(self, topic: str) -> list[object]:
        """Everything decodable of one topic; of a pipe, only what its head holds."""
        return [record for _, record in self.first_events([topic])]

    def first_events(self, topics: Iterable[str]) -> Iterator[tuple[str, object]]:
        """Decoded messages before a replay, (topic, record), uncounted; of a pipe, only what its head holds."""
        wanted = frozenset(topics)
        messages = self._messages(wanted) if self.log.seekable else iter(self._head)
        for message in messages:
            record = decode(self._on_stamps_clock(message)) if message.channel.topic in wanted else None
            if record is not None and not isinstance(record, Undecodable):
                yield message.channel.topic, record

    @property
    def first_ns(self) -> int:
        """First stamp of scans, odometry and sightings, from which seconds into the log count; 0 for an empty log."""
        return self.clocks.first_ns

    @property
    def last_ns(self) -> int:
        """About the last stamp: the last log time, brought to the stamps' clock."""
        return (self.survey.span_ns or (0, 0))[1] - self.clocks.offset_ns

    def stamp_of(self, message: RawMessage) -> int:
        """Stamp of a message as recorded; where it has none, its log time brought to the stamps' clock."""
        return stamp_in(message) or message.log_time_ns - self.clocks.offset_ns

    def raw(self, topic: str) -> Iterator[RawMessage]:
        """Messages of one topic as recorded."""
        return self._messages(frozenset({topic}))

    def keep_to(self, parts: Roles) -> None:
        """Of a log of several robots, know the transforms of one from here on: frames of others may be named alike."""
        if parts.robot:
            self.survey = self.survey.within(parts.transform_topics)

    def mount_at(self, parts: Roles, frame: str, stamp_ns: int) -> FloatArray | None:
        """``base_from_frame`` (4, 4) at a stamp, None if no transform says it; reads the log where the mount moves."""
        tree = parts.frames
        if not tree.moves_between(parts.base_frame, frame):
            return tree.lookup(parts.base_frame, frame, stamp_ns)
        tree = tree.replayed()
        for message in self._messages(frozenset(parts.transform_topics)):
            record = decode(self._on_stamps_clock(message))
            for transform in record if isinstance(record, tuple) else ():
                tree.add(transform)
            mount = tree.lookup(parts.base_frame, frame, stamp_ns)
            if mount is not None:
                return mount
            latest_ns = tree.latest_common(parts.base_frame, frame)
            tree.forget_before(min(stamp_ns, stamp_ns if latest_ns is None else latest_ns))
        return None

    def _messages(self, wanted: frozenset[str]) -> Iterator[RawMessage]:
        if not self.log.seekable:
            return (message for message in chain(self._head, self._rest) if message.channel.topic in wanted)
        if len(self.strands) > 1:
            return chain.from_iterable(self._of(strand, wanted) for strand in self.strands)
        return self.log.messages(wanted, Tally(), announce=False)

    def _of(self, strand: Strand, wanted: frozenset[str]) -> Iterator[RawMessage]:
        """Messages of one strand; logs without scans and odometry go with the first."""
        arguments = strand.arguments
        if strand is self.strands[0]:
            arguments = arguments | (set(self.log.arguments).difference(*(s.arguments for s in self.strands)))
        return self.log.part(arguments).messages(wanted, Tally(), announce=False)

    def _on_stamps_clock(self, message: RawMessage) -> RawMessage:
        """The message with a log time that may stand for its stamp, where that is 0."""
        return message._replace(log_time_ns=message.log_time_ns - self.clocks.offset_ns)

    def _origin(self) -> int | None:
        """Log time from which damage is told while the log is looked through: None before there is a first stamp."""
        told = any(topic.first_stamp_ns and not topic.carries_transforms for topic in self.survey.topics.values())
        return clocks_of(self.survey).first_logged_ns if told else None

    def _look_ahead(self) -> None:
        size = 0
        for message in self._rest:
            self._head.append(message)
            self.survey.add(message)
            size += len(message.data)
            span = self.survey.span_ns
            if size > _HEAD_BYTES or (span and span[1] - span[0] > _HEAD_NS):
                break
