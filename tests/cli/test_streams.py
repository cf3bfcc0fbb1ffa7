"""Standard streams that are closed, full or left by their reader: outputs are whole or refused, and never mixed up.

A choice for every command; the battery's class *streams* has every combination.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.battery import streams, writing
from tests.battery.streams import COMMANDS, LEFT, POSE, SCAN, TRACKED, TRUTH, Streams
from tests.cli.support import REFERENCE_MAP, ROOT, mcl

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a POSIX shell and /dev/full")
# Where nothing is lost a wrong stdin and a wrong stderr are tried together: neither may change what comes out.
CHOSEN = [
    Streams("<&-", "", "2>&-"),
    Streams("</dev/full", "", "2>/dev/full"),
    Streams("0>/dev/null", "", LEFT),
    Streams("", ">&-", ""),
    Streams("", ">/dev/full", ""),
    Streams("", LEFT, "2</dev/null"),
    Streams("<&-", ">&-", "2>&-"),
]
SELDOM = [Streams("", "1</dev/null", ""), Streams("", ">/dev/full", "2>&1"), Streams("", "", "2</dev/null")]
READERS: dict[str, tuple[object, ...]] = {
    "info": ("info", "-"),
    "score": ("score", "-", *POSE),
    "poses": ("score", SCAN, "--map", REFERENCE_MAP, "--poses", "-"),
    "locate": ("locate", "-", "--map", REFERENCE_MAP),
    "run": ("run", "-", *TRACKED),
    "eval": ("eval", "-", "--truth", TRUTH),
    "recover": ("recover", "-", "-o", "r.mcap"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    writing.put_inputs(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_and_its_streams(tmp_path: Path, name: str) -> None:
    for number, wrong in enumerate([*CHOSEN, *(SELDOM if name in {"info", "recover"} else [])]):
        place = tmp_path / str(number)
        place.mkdir()
        assert streams.check(name, wrong, place).problems == [], wrong


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("stdin", ["<&-", "</dev/full"])
def test_nothing_to_read(folder: Path, name: str, stdin: str) -> None:
    done = streams.run(folder, READERS[name], Streams(stdin))
    assert done.returncode == 1, done.stderr
    assert streams.unclean(done) == []
    assert done.stderr.decode().splitlines()[-1].startswith("mcl: error: ")
    assert streams.written(folder) == {}


@pytest.mark.parametrize("name", READERS)
def test_an_empty_stdin(folder: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    done = mcl(*READERS[name], stdin=b"")
    assert done.code == 1, done.err
    assert done.err.splitlines()[-1].startswith("mcl: error: ")
    assert streams.written(folder) == {}


@pytest.mark.parametrize(
    ("target", "wrong"),
    [
        ("/dev/stdout", Streams("", ">&-")),
        ("/dev/stderr", Streams("", "", "2>&-")),
        ("/dev/fd/1", Streams("", ">&-")),
    ],
)
def test_a_closed_stream_by_its_name(folder: Path, target: str, wrong: Streams) -> None:
    """What is written there would be lost, or end up in whatever got the descriptor."""
    done = streams.run(folder, ("run", "x.mcap", *TRACKED, "--track", target), wrong)
    assert done.returncode in {1, 2}, done.stderr
    assert streams.unclean(done) == []
    assert streams.written(folder) == {}


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
