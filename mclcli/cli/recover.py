"""``mcl recover``: every whole message of a damaged log in a clean MCAP."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import click

from mclcli.cli import completion, console, options
from mclcli.errors import ExitCode, InputError
from mclcli.text import clean, counted

if TYPE_CHECKING:
    from mclcli.io.logs import Log
    from mclcli.io.logs.base import Attachment, Beside, Channel, MetadataRecord, RawMessage, Tally
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.recovered_mcap import RecoveredMcap


@final
@dataclass(frozen=True, slots=True)
class RecoverOptions:
    """What ``mcl recover`` is asked for."""

    logs: tuple[str, ...]
    output: str
    as_json: bool


@click.command("recover", short_help="Save every whole message of a damaged log into a clean MCAP.")
@click.argument("logs", metavar="DAMAGED...", shell_complete=completion.files, nargs=-1, required=True)
@click.option("-o", "--output", metavar="GOOD.mcap", required=True, help="Where to write; - is stdout.")
@options.as_json
@options.common
@options.into(RecoverOptions)
def command(recover: RecoverOptions) -> ExitCode:
    """Write what can be read of DAMAGED (a file, a rosbag2 folder, several, or -) into an indexed, checksummed MCAP.

    Messages keep their bytes, types, times and numbers: those of ROS 1 stay ROS 1. Attachments and metadata of an MCAP
    are saved too; messages that were compressed one by one are unpacked. Exits with 0 if all was saved, with 3 if
    something was lost or may have been, with 1 if there was nothing to save.
    """
    from mclcli.cli.results import keep_stdout_free, print_json
    from mclcli.io.logs import open_log
    from mclcli.io.logs.base import Tally
    from mclcli.io.traces.output import open_output

    keep_stdout_free((recover.output,), as_json=recover.as_json)
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
    if recover.as_json:
        print_json(_facts(recover.output, saved, tally))
    else:
        _report(recover.output, saved, tally)
    return ExitCode.DAMAGED if tally.lossy else ExitCode.COMPLETE


def _save(log: Log, tally: Tally, sink: Output) -> RecoveredMcap:
    from mclcli.io.logs.base import Heading
    from mclcli.io.messages.guessing import Guesses
    from mclcli.io.traces.recovered_mcap import UNWRITABLE, RecoveredMcap

    beside: list[Beside] = []
    messages = log.messages(None, tally, beside=beside.append, guess=Guesses())
    first = next(messages, None)
    if first is None and not _carried(beside):
        raise InputError(f"{', '.join(log.names)}: no message could be saved; `mcl info` says what it holds")
    headings = [item for item in beside if isinstance(item, Heading)]
    saved = RecoveredMcap.begin(sink, _channels(log, first), headings)
    try:
        whole = chain(() if first is None else (first,), messages)
        for message in console.counting(whole, "saving"):
            _carry(beside, saved)
            if not saved.write(message):
                tally.reject(message.channel.topic, UNWRITABLE)
        _carry(beside, saved)
    finally:
        saved.close()
        sink.allow_part()
    return saved


def _carried(beside: list[Beside]) -> list[Attachment | MetadataRecord]:
    from mclcli.io.logs.base import Heading

    return [item for item in beside if not isinstance(item, Heading)]


def _carry(beside: list[Beside], saved: RecoveredMcap) -> None:
    """Write what has come beside the messages since the last call."""
    for item in _carried(beside):
        saved.carry(item)
    beside.clear()


def _channels(log: Log, first: RawMessage | None) -> list[Channel]:
    """Channels of the whole log where it can be read twice, else that of its first message."""
    from mclcli.io.logs.base import Tally

    ahead = Tally()
    if log.seekable:
        for _ in log.messages(frozenset(), ahead, announce=False):
            pass
    return ahead.channels or ([] if first is None else [first.channel])


def _report(output: str, saved: RecoveredMcap, tally: Tally) -> None:
    """What was saved, by topic, and what was not."""
    for topic, count in sorted(saved.written.items()):
        console.remark(f"{clean(topic)}: {counted(count, 'message')} saved{_guessed(topic, saved)}")
    for what, count in sorted(saved.beside.items()):
        console.remark(f"{counted(count, what)} saved")
    for topic, reasons in sorted(tally.skipped.items()):
        for why, count in sorted(reasons.items()):
            console.remark(f"{clean(topic)}: {counted(count, 'message')} not saved: {why}")
    lost, more = tally.lost()
    said = ([str(lost)] if lost else []) + (["an unknown number"] if more else [])
    total = saved.written.total()
    console.remark(f"{output}: {counted(total, 'message')}; lost: {' and '.join(said) or 'none'}")


def _facts(output: str, saved: RecoveredMcap, tally: Tally) -> dict[str, Any]:
    """The same for --json."""
    lost, more = tally.lost()
    return {
        "output": output,
        "messages": saved.written.total(),
        "topics": dict(sorted(saved.written.items())),
        "beside": dict(sorted(saved.beside.items())),
        "not_saved": [
            {"topic": topic, "reason": why, "messages": count}
            for topic, reasons in sorted(tally.skipped.items())
            for why, count in sorted(reasons.items())
        ],
        "lost": lost,
        "lost_more": more,
    }


def _guessed(topic: str, saved: RecoveredMcap) -> str:
    """What to say of a topic that nothing in the log describes."""
    kinds = {channel.type for channel, _ in saved.keys if channel.topic == topic}
    guessed = re.fullmatch(r"/unknown/\d+", topic)
    return f"; nothing in the log describes them, they parse as {', '.join(sorted(kinds))}" if guessed else ""
