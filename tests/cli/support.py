"""Running mcl inside the test's own process or as one of its own, and logs cut out of the samples."""

from __future__ import annotations

import csv
import io
import logging
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.writer import Writer

from mclcli.cli import group
from mclcli.cli.process import run
from mclcli.evaluate.metrics import absolute_pose_errors
from mclcli.geometry.trajectory import Trajectory
from tests import processes
from tests.io.ros_messages import STORES, build

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from mclcli.arrays import FloatArray

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "samples"
MAPS = ROOT / "maps"
OFFICE = SAMPLES / "office.mcap"
OFFICE_MAP = MAPS / "office.yaml"
REFERENCE_MAP = MAPS / "reference.yaml"
FILES = ("trace.csv", "trace.csv.gz", "trace.mcap", "track.csv", "track.tum", "steps.csv")  # all outputs of a run
START_NS = 1_715_697_000 * 10**9
STORE = STORES["cdr"]
ENTRY = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from mclcli.__main__ import main; main()"
)


@dataclass(frozen=True, slots=True)
class Result:
    """How a call ended: exit code, bytes on stdout, text on stderr."""

    code: int
    out: bytes
    err: str

    @property
    def table(self) -> Table:
        """Standard output read as CSV."""
        return Table(self.out.decode())


class Table:
    """A CSV file: ``names``, ``rows``, and columns of numbers by name; lines of metadata left out."""

    def __init__(self, text: str) -> None:
        lines = [line for line in text.splitlines() if not line.startswith("#")]
        self.names, *self.rows = list(csv.reader(lines))

    def __getitem__(self, name: str) -> FloatArray:
        at = self.names.index(name)
        return np.array([float(row[at]) for row in self.rows])

    def texts(self, name: str) -> list[str]:
        """A column as it is written."""
        return [row[self.names.index(name)] for row in self.rows]


def mcl(*words: object, stdin: bytes = b"") -> Result:
    """Run the command line in this process, and leave the process as it was."""
    arguments = [str(word) for word in words]
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    logger = logging.getLogger("mclcli")
    handlers, level = logger.handlers, logger.level
    with (
        mock.patch.dict(os.environ),
        mock.patch.object(sys, "argv", ["mcl", *arguments]),
        CliRunner().isolation(input=stdin) as (out, err, _),
    ):
        try:
            code = run(group, arguments)
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
            logger.handlers = handlers
            logger.setLevel(level)
        return Result(code, out.getvalue(), err.getvalue().decode())


def process(*words: object, **options: Any) -> subprocess.Popen[bytes]:
    """Start mcl as a process of its own; stdout and stderr are pipes unless said otherwise.

    Its output is buffered, whatever the environment of the tests says, as it is for users.
    """
    command = [sys.executable, "-c", ENTRY, *map(str, words)]
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.Popen(command, cwd=ROOT, **{"env": environment, **streams, **options})


def finish(started: subprocess.Popen[bytes]) -> Result:
    """Wait for a process that ``process`` started."""
    out, err = processes.finish(started)
    return Result(started.returncode, out or b"", (err or b"").decode())


def single_error(result: Result, code: int) -> str:
    """The one line of a refusal; nothing else may be said, on either stream."""
    assert result.code == code, result.err
    lines = result.err.splitlines()
    assert [line for line in lines if line.startswith("mcl: error: ")] == lines[-1:]
    assert result.out == b""
    return lines[-1].removeprefix("mcl: error: ")


def outputs(folder: Path) -> tuple[object, ...]:
    """Arguments that ask for every kind of output."""
    folder.mkdir(exist_ok=True)
    trace, zipped, mcap, track, tum, steps = (folder / name for name in FILES)
    return "-o", trace, "-o", zipped, "-o", mcap, "--track", track, "--track", tum, "--steps", steps


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@dataclass(frozen=True, slots=True)
class Everything:
    """All outputs of one run."""

    files: dict[str, bytes]

    def table(self, name: str) -> Table:
        return Table(self.files[name].decode())


@dataclass(frozen=True, slots=True)
class Message:
    """One message of an MCAP: topic, type, definition, log time and bytes."""

    topic: str
    type: str
    definition: bytes
    log_ns: int
    data: bytes


def messages(path: Path | io.BytesIO) -> list[Message]:
    """Everything in an MCAP, read by mcap's own reader."""
    raw = path.read_bytes() if isinstance(path, Path) else path.getvalue()
    read = make_reader(io.BytesIO(raw)).iter_messages()
    return [Message(c.topic, s.name if s else "", s.data if s else b"", m.log_time, m.data) for s, c, m in read]


def write_mcap(path: Path, contents: Iterable[Message], chunk_size: int = 1 << 16) -> Path:
    """Write messages with mcap's own writer."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for number, message in enumerate(contents):
            if message.topic not in channels:
                schema = writer.register_schema(message.type, "ros2msg", message.definition)
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
            writer.add_message(channels[message.topic], message.log_ns, message.data, message.log_ns, number)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def decoded(message: Message) -> Any:
    """The message as rosbags decodes it."""
    return STORE.deserialize_cdr(message.data, message.type)


def edited(message: Message, edit: Callable[[Any], None]) -> Message:
    """The message after an edit of its decoded form."""
    contents = decoded(message)
    edit(contents)
    data = bytes(STORE.serialize_cdr(contents, message.type))
    return Message(message.topic, message.type, message.definition, message.log_ns, data)


def made(topic: str, kind: str, values: Any, log_ns: int = START_NS) -> Message:
    """A new message of a type from nested dicts."""
    text, _ = STORE.generate_msgdef(kind, ros_version=2)
    return Message(topic, kind, text.encode(), log_ns, bytes(STORE.serialize_cdr(build("cdr", kind, values), kind)))


def error_against(track: Table, reference: Path) -> float:
    """RMSE [m] of a track against a TUM file, interpolated at the track's stamps."""
    rows = np.loadtxt(reference)
    yaws = 2.0 * np.arctan2(rows[:, 6], rows[:, 7])
    truth = Trajectory(np.round(rows[:, 0] * 1e9).astype(np.int64), np.column_stack((rows[:, 1:3], yaws)))
    stamps = np.array([int(text.replace(".", "")) for text in track.texts("stamp")])
    poses = np.column_stack((track["x"], track["y"], track["yaw"]))
    return float(absolute_pose_errors(Trajectory(stamps, poses), truth).translation_rmse)


def without(contents: list[Message], *topics: str) -> list[Message]:
    """The messages on other topics."""
    return [message for message in contents if message.topic not in topics]
