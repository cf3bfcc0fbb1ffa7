"""``mcl extract``: one message of a log as text."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal, final, get_args

import click

from mclcli.cli import completion, console, options, parse
from mclcli.errors import InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.arrays import FloatArray
    from mclcli.cli.clock import LogTime
    from mclcli.io.recording.recording import Recording

Form = Literal["yaml", "json"]


@final
@dataclasses.dataclass(frozen=True, slots=True)
class ExtractOptions:
    """What ``mcl extract`` is asked for."""

    log: str
    topic: str | None
    at: LogTime | None
    index: int | None
    form: Form
    mounts: Mapping[str, FloatArray]
    robot: str | None


@click.command("extract", short_help="Print one message of a log, a laser scan ready for `mcl score -`.")
@click.argument("log", metavar="LOG", shell_complete=completion.files)
@click.option(
    "--topic",
    metavar="TOPIC",
    help="Topic of the message; the laser scans if not given.",
    shell_complete=completion.topics("any"),
)
@click.option(
    "--at",
    metavar="TIME",
    callback=parse.parse_at,
    help="The message nearest to this time: seconds into the log, @SECONDS, 14:32:05 or ISO 8601.",
)
@click.option(
    "--index", metavar="N", type=click.IntRange(min=0), help="The message of this number on its topic, from 0."
)
@click.option(
    "--format", "form", type=click.Choice(get_args(Form)), default="yaml", show_default=True, help="How to write it."
)
@click.option(
    "--mount",
    "mounts",
    multiple=True,
    metavar="[FRAME=]X,Y,YAW",
    callback=parse.parse_mounts,
    help="Where the lidar sits, instead of what the log says.",
)
@options.robot
@options.common
@options.into(ExtractOptions)
def command(extract: ExtractOptions) -> None:
    """Print one message of LOG as YAML or JSON; with a laser scan goes where its lidar sits on the base."""
    from mclcli.cli import one_scan
    from mclcli.io.logs import open_log
    from mclcli.io.recording.kinds import SCAN
    from mclcli.io.recording.recording import Recording
    from mclcli.io.tables.scan_file import format_scan

    recording = Recording(open_log([Path(extract.log)]), watch=console.look)
    topic = None if extract.topic is None else recording.survey.topic_named(extract.topic)
    channel = recording.survey.topics.get(topic or "")
    if topic is not None and (channel is None or channel.channel.type not in SCAN):
        click.echo(_other(recording, topic, extract), nl=False)
        return
    parts = one_scan.roles_for_scan(recording, topic, extract.robot)
    scan = one_scan.scan_of_log(recording, parts, extract.at, extract.index)
    try:
        mount = one_scan.mount_in_log(recording, parts, scan, extract.mounts)
    except InputError as error:
        console.warn(f"{error}; the scan is printed without it")
        mount = None
    click.echo(format_scan(scan, mount, parts.base_frame, extract.form), nl=False)


def _other(recording: Recording, topic: str, extract: ExtractOptions) -> str:
    """Any other message whose type is known, as it is."""
    from mclcli.cli import one_scan
    from mclcli.io.messages.decoding import to_plain
    from mclcli.io.tables.yaml_text import to_yaml

    if topic not in recording.survey.topics:
        raise UsageError(
            f"no topic '{topic}' in the log; it has {', '.join(sorted(recording.survey.topics)) or 'none'}"
        )
    messages, first_ns = recording.raw(topic), recording.first_ns
    message = one_scan.pick_one(messages, recording.stamp_of, first_ns, extract.at, extract.index)
    plain = to_plain(message)
    return to_yaml(plain) if extract.form == "yaml" else json.dumps(plain) + "\n"
