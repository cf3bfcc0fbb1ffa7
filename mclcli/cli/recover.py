"""``mcl recover``: every whole message of a damaged log in a clean MCAP."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, final

import click

from mclcli.cli import console, options
from mclcli.errors import ExitCode, InputError
from mclcli.text import clean

if TYPE_CHECKING:
    from mclcli.io.logs import Log
    from mclcli.io.logs.base import Channel, Tally
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.recovered_mcap import RecoveredMcap


@final
@dataclass(frozen=True, slots=True)
class RecoverOptions:
    """What ``mcl recover`` is asked for."""

    logs: tuple[str, ...]
    output: str


@click.command("recover", short_help="Save every whole message of a damaged log into a clean MCAP.")
@click.argument("logs", metavar="DAMAGED...", nargs=-1, required=True)
@click.option("-o", "--output", metavar="GOOD.mcap", required=True, help="Where to write; - is stdout.")
@options.common
@options.into(RecoverOptions)
def command(recover: RecoverOptions) -> ExitCode:
    """Write what can be read of DAMAGED (a file, a rosbag2 folder, several, or -) into an indexed, checksummed MCAP.

    Messages keep their bytes, types and times: those of ROS 1 stay ROS 1. Exits with 0 if all of them were saved, with
    3 if some were lost or may have been, with 1 if there was nothing to save.
    """
    from mclcli.io.logs import open_log
    from mclcli.io.logs.base import Tally
    from mclcli.io.traces.output import open_output

    log = open_log(recover.logs, stdin=sys.stdin.buffer if "-" in recover.logs else None)
    tally = Tally()
    inputs = [Path(name) for name in recover.logs]
    sink = open_output(recover.output, binary=True, inputs=inputs)
    try:
        with sink:
            saved = _save(log, tally, sink)
    except (KeyboardInterrupt, SystemExit):
        console.tell_kept(sink.kept)
        raise
    _report(recover.output, saved, tally)
    return ExitCode.DAMAGED if tally.lossy else ExitCode.COMPLETE


def _save(log: Log, tally: Tally, sink: Output) -> RecoveredMcap:
    from mclcli.io.traces.recovered_mcap import UNWRITABLE, RecoveredMcap

    messages = log.messages(None, tally)
    first = next(messages, None)
    if first is None:
        raise InputError(f"{', '.join(log.names)}: no message could be saved; `mcl info` says what it holds")
    saved = RecoveredMcap.begin(sink, _channels(log, first.channel))
    try:
        for message in chain((first,), messages):
            if not saved.write(message):
                tally.reject(message.channel.topic, UNWRITABLE)
    finally:
        saved.close()
        sink.allow_part()
    return saved


def _channels(log: Log, first: Channel) -> list[Channel]:
    """Channels of the whole log where it can be read twice, else that of its first message."""
    from mclcli.io.logs.base import Tally

    if not log.seekable:
        return [first]
    ahead = Tally()
    for _ in log.messages(frozenset(), ahead, announce=False):
        pass
    return ahead.channels


def _report(output: str, saved: RecoveredMcap, tally: Tally) -> None:
    """What was saved, by topic, and what was not."""
    for topic, count in sorted(saved.written.items()):
        console.remark(f"{clean(topic)}: {count} messages saved")
    for topic, reasons in sorted(tally.skipped.items()):
        for why, count in sorted(reasons.items()):
            console.remark(f"{clean(topic)}: {count} messages not saved: {why}")
    known = [damage.messages for damage in tally.damages if not damage.lossless]
    lost = sum(count for count in known if count is not None)
    more = " and an unknown number" if None in known else ""
    total = saved.written.total()
    console.remark(f"{output}: {total} messages; lost: {lost or ('' if more else 'none')}{more}".replace(": and", ":"))
