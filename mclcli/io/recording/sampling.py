"""A survey of a large log from its index and a sample of its chunks, in a time that does not grow with the log."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.io.logs.base import Damage, FileFacts, Tally
from mclcli.io.logs.inflate import Budget, CorruptError
from mclcli.io.logs.log import PACKED, unpack, unreadable
from mclcli.io.recording.clocks import Clocks, clocks_of
from mclcli.io.recording.survey import LogSurvey, TopicSurvey

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import IntArray
    from mclcli.io.logs import Log
    from mclcli.io.logs.base import Channel
    from mclcli.io.logs.mcap_index import IndexedChunk, McapIndex
    from mclcli.io.recording.diagnosis import Diagnosis

LARGE = 1 << 30
"""Logs above this size are sampled [bytes]."""
SAMPLES = 40
"""Chunks read of a log, beside those in which a topic begins, and of those with static transforms."""


@final
@dataclass(frozen=True, slots=True)
class SampledLog:
    """What a ``Recording`` says of a log, from a sample: counts and log times of all messages, contents of some."""

    log: Log
    survey: LogSurvey = field(default_factory=LogSurvey)
    tally: Tally = field(default_factory=Tally)

    @property
    def clocks(self) -> Clocks:
        """Clocks of stamps and log times."""
        return clocks_of(self.survey)


def sample(log: Log, diagnosis: Diagnosis, above: int = LARGE) -> SampledLog | None:
    """Survey of a log of more than ``above`` bytes whose files are all whole, indexed MCAP; None for any other.

    Where chunks that are read turn out damaged, ``tally`` says so; of others nothing is known. Raises InputError if a
    file cannot be read.
    """
    if not log.seekable or log.missing:
        return None
    indexes: list[McapIndex] = []
    try:
        if sum(path.stat().st_size for path in log.paths) <= above:
            return None
        from mclcli.io.logs.mcap_index import read_index

        for path in log.paths:
            index = read_index(path)
            if index is None or not all(channel.type for channel in index.channels.values()):
                return None  # a metadata.yaml may say the types that it does not
            indexes.append(index)
        return _survey(SampledLog(log), indexes, diagnosis)
    except OSError as error:
        raise unreadable(Path(error.filename or log.names[0]).name, error) from error


def _survey(found: SampledLog, indexes: list[McapIndex], diagnosis: Diagnosis) -> SampledLog:
    chunks = sorted(((i, c) for i in indexes for c in i.chunks), key=lambda pair: pair[1].span_ns)
    verified, budget = {index.path: 0 for index in indexes}, Budget()
    for number in _choose(chunks):
        index, chunk = chunks[number]
        try:
            messages, checked = index.messages(chunk)
        except CorruptError as error:
            _report(found.tally, index, chunk, error)
            continue
        verified[index.path] += checked
        for message in sorted(messages, key=lambda message: message.log_time_ns):
            plain = unpack(message, budget)
            if plain is None:
                found.tally.undecodable += 1
                found.tally.skip(message.channel.topic, PACKED)
                continue
            diagnosis.add(plain)
            found.survey.add(plain)
    for channel, times in _times(chunks):
        found.survey.topics.setdefault(channel.topic, TopicSurvey(channel)).count_all(times)
        diagnosis.count_all(channel.topic, times)
    silent = (channel for index in indexes for channel in index.channels.values())
    found.survey.silent = {of.topic: of for of in silent if of.topic not in found.survey.topics}
    for name, index in zip(found.log.names, indexes, strict=True):
        checksums = f"{verified[index.path]} of {len(index.chunks)} chunks verified, the rest not read"
        found.tally.files.append(FileFacts(name, "MCAP", closed=True, checksums=checksums))
    return found


def _choose(chunks: Sequence[tuple[McapIndex, IndexedChunk]]) -> list[int]:
    """Chunks to read: those in which a topic begins, some with static transforms, and some in all, evenly spread."""
    first: dict[str, int] = {}
    static: list[int] = []
    for number, (index, chunk) in enumerate(chunks):
        topics = {index.channels[channel].topic for channel in chunk.times}
        for topic in topics:
            first.setdefault(topic, number)
        if any(topic.endswith("tf_static") for topic in topics):
            static.append(number)
    return sorted({*first.values(), *_spread(static), *_spread(range(len(chunks)))})


def _spread(numbers: Sequence[int]) -> list[int]:
    """At most ``SAMPLES`` of some numbers, the first and the last among them."""
    if len(numbers) <= SAMPLES:
        return list(numbers)
    return [numbers[place] for place in np.linspace(0, len(numbers) - 1, SAMPLES).round().astype(int).tolist()]


def _times(chunks: Sequence[tuple[McapIndex, IndexedChunk]]) -> list[tuple[Channel, IntArray]]:
    """Log times of all messages by topic, with the topic's first channel."""
    parts: dict[str, tuple[Channel, list[IntArray]]] = {}
    for index, chunk in chunks:
        for number, times in chunk.times.items():
            channel = index.channels[number]
            parts.setdefault(channel.topic, (channel, []))[1].append(times)
    return [(channel, np.concatenate(times)) for channel, times in parts.values()]


def _report(tally: Tally, index: McapIndex, chunk: IndexedChunk, error: CorruptError) -> None:
    count = sum(times.size for times in chunk.times.values())
    what = f"chunk at byte {chunk.start} {error}"
    tally.damages.append(Damage(index.path.name, chunk.start, what, count, *chunk.span_ns))
    logging.getLogger("mclcli").warning("%s: %s; %d messages skipped", index.path.name, what, count)
