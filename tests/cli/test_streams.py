"""Standard streams that are closed, full or left by their reader: outputs are whole or refused, and never mixed up."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.cli.support import ENTRY, OFFICE, OFFICE_MAP, REFERENCE_MAP, ROOT, SAMPLES

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a POSIX shell and /dev/full")
SCAN = SAMPLES / "reference_set3.yaml"
TRUTH = SAMPLES / "office.truth.tum"
POSE = ("--map", REFERENCE_MAP, "--pose", "0,0,0")
TRACKED = ("--map", OFFICE_MAP, "--init", "/initialpose", "--particles", 50)
# command: its words, what it writes into its folder, whether it writes to stdout; "-" stands where a log or file may
COMMANDS: dict[str, tuple[tuple[object, ...], tuple[str, ...], bool]] = {
    "info": (("info", OFFICE), (), True),
    "dt": (("dt", OFFICE_MAP), (), True),
    "score": (("score", SCAN, *POSE), (), True),
    "score to a file": (("score", SCAN, *POSE, "-o", "scores.csv"), ("scores.csv",), False),
    "locate": (("locate", SCAN, "--map", REFERENCE_MAP), (), True),
    "run": (("run", "short.mcap", *TRACKED), (), True),
    "run to files": (
        ("run", "short.mcap", *TRACKED, "-o", "t.mcap", "--track", "t.csv", "--picture", "t.png"),
        ("t.csv", "t.mcap", "t.png"),
        False,
    ),
    "eval": (("eval", TRUTH, "--truth", TRUTH), (), True),
    "extract": (("extract", OFFICE), (), True),
    "recover": (("recover", OFFICE, "-o", "r.mcap"), ("r.mcap",), False),
    "params": (("params",), (), True),
    "--help": (("--help",), (), True),
    "--version": (("--version",), (), True),
}
READERS: dict[str, tuple[object, ...]] = {
    "info": ("info", "-"),
    "score": ("score", "-", *POSE),
    "poses": ("score", SCAN, "--map", REFERENCE_MAP, "--poses", "-"),
    "locate": ("locate", "-", "--map", REFERENCE_MAP),
    "run": ("run", "-", *TRACKED),
    "eval": ("eval", "-", "--truth", TRUTH),
    "recover": ("recover", "-", "-o", "r.mcap"),
}
WRONG_STDIN = ("<&-", "</dev/full", "0>/dev/null")
WRONG_STDOUT = (">&-", ">/dev/full", "1</dev/null")
WRONG_STDERR = ("2>&-", "2>/dev/full", "2</dev/null")


def run(
    folder: Path, words: tuple[object, ...], shell: str = "", *, left: str = ""
) -> subprocess.CompletedProcess[bytes]:
    """Run mcl in a folder with its streams as the shell's words have them, or one a pipe that nobody reads."""
    command = ["bash", "-c", f'exec "$@" {shell}', "bash", sys.executable, "-c", ENTRY, *map(str, words)]
    streams: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    environment["PYTHONPATH"] = str(ROOT)
    with ExitStack() as stack:
        if left:
            reader, writer = os.pipe()
            os.close(reader)
            stack.callback(os.close, writer)
            streams[left] = writer
        return subprocess.run(
            command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, timeout=120, check=False, **streams
        )


@pytest.fixture
def folder(tmp_path: Path, short: Path) -> Iterator[Path]:
    (tmp_path / "short.mcap").symlink_to(short)
    yield tmp_path
    assert not list(tmp_path.glob("*.part"))


def written(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.is_symlink()}


def is_quiet(done: subprocess.CompletedProcess[bytes]) -> bool:
    return not any(word in (done.stderr or b"") for word in (b"Traceback", b"Exception ignored", b"internal error"))


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_and_its_streams(folder: Path, name: str) -> None:
    """Files are the same, byte for byte, however a stream is wrong; only results that nobody takes are an error."""
    words, files, on_stdout = COMMANDS[name]
    usual = run(folder, words)
    outputs = written(folder)
    assert usual.returncode in {0, 5}
    assert sorted(outputs) == sorted(files)
    lost = 1 if on_stdout else usual.returncode
    cases = [(shell, "", usual.returncode) for shell in (*WRONG_STDERR, *WRONG_STDIN, "<&- 2>&-")]
    cases += [(shell, "", lost) for shell in (*WRONG_STDOUT, "<&- >&- 2>&-", ">/dev/full 2>&1")]
    cases += [("", "stderr", usual.returncode), ("", "stdout", 141 if on_stdout else usual.returncode)]
    for shell, left, code in cases:
        for path in files:
            (folder / path).unlink()
        done = run(folder, words, shell, left=left)
        assert done.returncode == code, (shell, left, done.stderr)
        assert is_quiet(done), (shell, left, done.stderr)
        assert written(folder) == outputs, (shell, left)
        if code == usual.returncode and name != "dt":  # which says how long it took
            assert done.stdout == (None if left == "stdout" else usual.stdout), (shell, left)
        if code == 1 and "2>" not in shell:
            assert done.stderr.decode().splitlines()[-1].startswith("mcl: error: "), (shell, left)


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("shell", [*WRONG_STDIN, "</dev/null"])
def test_nothing_to_read(folder: Path, name: str, shell: str) -> None:
    done = run(folder, READERS[name], shell)
    assert done.returncode == 1, done.stderr
    assert is_quiet(done), done.stderr
    assert done.stderr.decode().splitlines()[-1].startswith("mcl: error: ")
    assert written(folder) == {}


@pytest.mark.parametrize(("target", "shell"), [("/dev/stdout", ">&-"), ("/dev/stderr", "2>&-"), ("/dev/fd/1", ">&-")])
def test_a_closed_stream_by_its_name(folder: Path, target: str, shell: str) -> None:
    """What is written there would be lost, or end up in whatever got the descriptor."""
    done = run(folder, ("run", "short.mcap", *TRACKED, "--track", target), shell)
    assert done.returncode in {1, 2}, done.stderr
    assert is_quiet(done)
    assert written(folder) == {}


OPENED = """
import os, sys
from mclcli import startup
startup.secure_streams()
print(os.open(os.devnull, os.O_RDONLY), sys.stderr is not None, file=open({target!r}, "w"))
"""


@pytest.mark.parametrize("shell", ["<&-", ">&-", "2>&-", "<&- 2>&-", "<&- >&- 2>&-"])
def test_descriptors_of_closed_streams_are_not_given_away(tmp_path: Path, shell: str) -> None:
    target = tmp_path / "number"
    script = OPENED.format(target=str(target))
    command = ["bash", "-c", f'exec "$@" {shell}', "bash", sys.executable, "-c", script]
    subprocess.run(command, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True, timeout=60)
    number, has_stderr = target.read_text().split()
    assert int(number) > 2
    assert has_stderr == "True"
