"""What README and the generated pages of the documentation say is so."""

from __future__ import annotations

import inspect
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import mclcli
from mclcli.cli import COMMANDS, load_command
from mclcli.errors import ExitCode

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def options_of(name: str) -> set[str]:
    return {option for parameter in load_command(name).params for option in parameter.opts}


def test_the_documented_exit_codes_are_those_there_are() -> None:
    text = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| ([\d, ]+) \|", text.partition("## Exit codes")[2], re.MULTILINE)
    signals = {128 + number for number in (signal.SIGHUP, signal.SIGINT, signal.SIGPIPE, signal.SIGTERM)}
    assert {int(code) for codes in listed for code in codes.split(",")} == {*ExitCode, *signals}


def test_the_python_block_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = blocks("python")
    monkeypatch.chdir(ROOT)
    exec(compile(block, "README.md", "exec"), {})  # noqa: S102 - the point of this test
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 300
    assert all(re.fullmatch(r"1715697\d{12} \[[^]]+\] [\d.]+", line) for line in lines)


@pytest.mark.parametrize("block", blocks("sh"))
def test_the_commands_name_files_that_exist(block: str) -> None:
    words = shlex.split(block.replace("\\\n", " "))
    named = [word for word in words if re.match(r"(samples|maps|docs|tests|mclcli|benchmarks)/", word)]
    assert [word for word in named if not (ROOT / word).exists()] == []
    assert len(blocks("sh")) == 2


def test_the_commands_use_options_that_exist() -> None:
    text = "\n".join(blocks("sh") + blocks("console")).replace("\\\n", " ").replace("|\n", "| ")
    calls = re.findall(r"\bmcl (\w+)((?:[^|&\n>])*)", text)
    assert len(calls) >= 4
    for name, rest in calls:
        assert name in COMMANDS
        used = {word for word in shlex.split(rest) if re.match(r"--?[a-z]", word)}
        assert used <= options_of(name)


def test_the_table_of_commands_is_complete() -> None:
    assert set(re.findall(r"^\| `mcl (\w+)", README, re.MULTILINE)) == set(COMMANDS)


def test_the_page_of_the_library_is_complete() -> None:
    page = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    described = set(re.findall(r"^### (\w+)$", page, re.MULTILINE))
    assert set(mclcli.__all__) - described == {"__version__"}
    assert "0x" not in page  # an address, other in every process


@pytest.mark.parametrize("name", sorted(set(mclcli.__all__) - {"__version__"}))
def test_docstrings_name_parameters_that_exist(name: str) -> None:
    thing = getattr(mclcli, name)
    text = inspect.getdoc(thing) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?:\n\n|\Z)", text, re.MULTILINE | re.DOTALL)
    if section:
        named = re.findall(r"^\w+(?:, \w+)*$", section[1], re.MULTILINE)
        assert [word for line in named for word in line.split(", ")] == list(inspect.signature(thing).parameters)


def test_the_documentation_is_up_to_date() -> None:
    words = [sys.executable, "docs/build.py", "--check"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
