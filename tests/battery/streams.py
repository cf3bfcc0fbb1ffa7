"""Standard streams that are closed, full or left by their reader, under every command and in every combination."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from tests.battery import content, writing
from tests.battery.harness import CRASH, WRONG, Case, Verdict
from tests.cli.support import ENTRY, REFERENCE_MAP, ROOT, SAMPLES
from tests.io.logs import seeded

SCAN = SAMPLES / "reference_set3.yaml"
TRUTH = SAMPLES / "office.truth.tum"
POSE = ("--map", REFERENCE_MAP, "--pose", "0,0,0")
TRACKED = ("--map", "room.yaml", "--init", content.INIT, "--particles", 50, "--duration", 2)
# command: its words, what it writes into its folder, whether it writes to stdout; "-" stands where a log or file may
COMMANDS: dict[str, tuple[tuple[object, ...], tuple[str, ...], bool]] = {
    "info": (("info", "x.mcap"), (), True),
    "dt": (("dt", "room.yaml"), (), True),
    "score": (("score", SCAN, *POSE), (), True),
    "score to a file": (("score", SCAN, *POSE, "-o", "scores.csv"), ("scores.csv",), False),
    "locate": (("locate", SCAN, "--map", "room.yaml"), (), True),
    "run": (("run", "x.mcap", *TRACKED), (), True),
    "run to files": (
        ("run", "x.mcap", *TRACKED, "-o", "t.mcap", "--track", "t.csv", "--picture", "t.png"),
        ("t.csv", "t.mcap", "t.png"),
        False,
    ),
    "eval": (("eval", TRUTH, "--truth", TRUTH), (), True),
    "extract": (("extract", "x.mcap"), (), True),
    "recover": (("recover", "x.mcap", "-o", "r.mcap"), ("r.mcap",), False),
    "params": (("params",), (), True),
    "--help": (("--help",), (), True),
    "--version": (("--version",), (), True),
}
LEFT = "left by its reader"
STDIN = ("", "<&-", "</dev/full", "0>/dev/null")
STDOUT = ("", ">&-", ">/dev/full", "1</dev/null", LEFT)
STDERR = ("", "2>&-", "2>/dev/full", "2</dev/null", LEFT)


class Streams(NamedTuple):
    """The three streams, each as the shell's words have it, or left by its reader; empty: as usual."""

    stdin: str = ""
    stdout: str = ""
    stderr: str = ""

    @property
    def wrong(self) -> int:
        """How many are not as usual."""
        return sum(map(bool, self))

    @property
    def told(self) -> str:
        """What is wrong with which."""
        return ", ".join(f"{name} {how}" for name, how in zip(self._fields, self, strict=True) if how)


USUAL = Streams()


def cases(seed: int, share: float) -> list[Case]:
    """Every command with one stream wrong, some with two and three; a share: ``cli/test_streams.py`` has its own."""
    found = [
        (name, streams)
        for name in COMMANDS
        for streams in map(Streams._make, product(STDIN, STDOUT, STDERR))
        if streams.wrong == 1 or (streams.wrong and name in {"info", "run to files"})
    ]
    found = found if share == 1.0 else seeded(f"{seed} streams").sample(found, 2)
    return [Case(f"{name}: {s.told}", partial(check, name, s)) for name, s in found]


def check(name: str, streams: Streams, folder: Path) -> Verdict:
    """Files are the same, byte for byte, however a stream is wrong; only results that nobody takes are an error."""
    words, _, on_stdout = COMMANDS[name]
    usual, outputs = undisturbed(name)
    writing.put_inputs(folder)
    done = run(folder, words, streams)
    code = usual.returncode
    if on_stdout and streams.stdout:
        code = 141 if streams.stdout == LEFT else 1
    problems = unclean(done)
    if done.returncode != code:
        problems.append((WRONG, f"ended with {done.returncode}, not {code}: {done.stderr!r}"))
    if written(folder) != outputs:
        problems.append((WRONG, f"files are others: {sorted(written(folder))}"))
    if not streams.stdout and name != "dt" and done.stdout != usual.stdout:  # dt says how long it took
        problems.append((WRONG, f"other words on stdout: {done.stdout[:200]!r}"))
    if code == 1 and not streams.stderr and not done.stderr.splitlines()[-1].startswith(b"mcl: error: "):
        problems.append((WRONG, f"no error is told: {done.stderr!r}"))
    return Verdict(problems, {"refused": int(code == 1)})


@cache
def undisturbed(name: str) -> tuple[subprocess.CompletedProcess[bytes], dict[str, bytes]]:
    """A command with its streams as usual, and the files that it writes."""
    words, files, _ = COMMANDS[name]
    with tempfile.TemporaryDirectory() as folder:
        writing.put_inputs(Path(folder))
        done = run(Path(folder), words)
        outputs = written(Path(folder))
    assert done.returncode in {0, 5}, done.stderr
    assert sorted(outputs) == sorted(files)
    return done, outputs


def run(folder: Path, words: tuple[object, ...], streams: Streams = USUAL) -> subprocess.CompletedProcess[bytes]:
    """Run mcl in a folder with such streams."""
    shell = " ".join(word for word in streams if word != LEFT)
    command = ["bash", "-c", f'exec "$@" {shell}', "bash", sys.executable, "-c", ENTRY, *map(str, words)]
    pipes: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    environment["PYTHONPATH"] = str(ROOT)
    with ExitStack() as stack:
        for name in [name for name in pipes if getattr(streams, name) == LEFT]:
            reader, pipes[name] = os.pipe()
            os.close(reader)
            stack.callback(os.close, pipes[name])
        return subprocess.run(
            command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, timeout=120, check=False, **pipes
        )


def written(folder: Path) -> dict[str, bytes]:
    """Files in a folder besides what was put there."""
    paths = [path for path in folder.iterdir() if path.name not in {"x.mcap", "room.yaml", "room.pgm"}]
    return {path.name: path.read_bytes() for path in paths}


def unclean(done: subprocess.CompletedProcess[bytes]) -> list[tuple[str, str]]:
    """What Python says where a program has gone wrong."""
    said = done.stderr or b""
    words = (b"Traceback", b"Exception ignored", b"internal error")
    return [(CRASH, said.decode()[-300:])] if any(word in said for word in words) else []
