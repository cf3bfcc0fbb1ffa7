"""The program as a whole: help, version, ways to start it, refusals."""

from __future__ import annotations

import subprocess
import sys

import pytest

from mclcli.cli import COMMANDS, GROUPS, console
from mclcli.version import __version__
from tests.cli.support import ROOT, mcl, single_error


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("flag", ["--help", "-h"])
def test_every_command_explains_itself(name: str, flag: str) -> None:
    result = mcl(name, flag)
    assert (result.code, result.err) == (0, "")
    text = result.out.decode()
    assert text.startswith(f"Usage: mcl {name} ")
    for option in ("--cache-dir", "--debug", "--verbose", "--quiet", "--color"):
        assert option in text


@pytest.mark.parametrize("name", COMMANDS)
def test_threads_are_asked_for_where_poses_are_scored(name: str) -> None:
    assert ("--threads" in mcl(name, "--help").out.decode()) == (name in {"run", "score", "smooth"})


def test_help_lists_the_commands() -> None:
    result = mcl("--help")
    assert result.code == 0
    text = " ".join(result.out.decode().split())
    for name, what in COMMANDS.items():
        assert f"{name} {what}" in text
    assert "help Explain a command" in text


@pytest.mark.parametrize("words", [[], ["run"], ["params"]])
def test_help_as_a_command(words: list[str]) -> None:
    asked, option = mcl("help", *words), mcl(*words, "--help")
    assert (asked.code, asked.err, asked.out) == (0, "", option.out)


def test_help_on_help() -> None:
    assert mcl("help", "help").out == mcl("help", "--help").out == mcl("--help").out


def test_help_names_the_nearest_command() -> None:
    assert "did you mean 'score'?" in single_error(mcl("help", "scor"), 2)
    assert "did you mean 'help'?" in single_error(mcl("hlep"), 2)


@pytest.mark.parametrize("flag", ["--version", "-V"])
def test_version(flag: str) -> None:
    result = mcl(flag)
    assert result.code == 0
    assert __version__ in result.out.decode()


def test_without_arguments_it_shows_help_and_fails() -> None:
    result = mcl()
    assert (result.code, result.out) == (2, b"")
    assert result.err.startswith("Usage: mcl ")


def test_as_a_module() -> None:
    done = subprocess.run([sys.executable, "-m", "mclcli", "--version"], cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 0
    assert __version__ in done.stdout.decode()
    assert done.stderr == b""


def test_an_unknown_command_names_the_nearest() -> None:
    assert "did you mean 'score'?" in single_error(mcl("scor"), 2)


@pytest.mark.parametrize("words", [["run"], ["run", "x.mcap", "--foo"], ["score", "x"], ["dt", "m", "--max-dist", "x"]])
def test_click_refuses_in_one_line_too(words: list[str]) -> None:
    assert f"see `mcl {words[0]} --help`" in single_error(mcl(*words), 2)


@pytest.mark.parametrize("name", ["info", "run", "extract"])
def test_a_missing_log(name: str) -> None:
    assert single_error(mcl(name, "missing.mcap"), 2).startswith("missing.mcap: no such file; ")


def test_a_control_character_of_the_command_line_is_not_repeated() -> None:
    result = mcl("info", "\x1b]0;owned\x07.mcap")
    assert "\x1b" not in result.err
    assert "\x07" not in result.err
    assert "\\x1b" in single_error(result, 2)


def test_debug_shows_the_traceback_and_keeps_the_exit_code() -> None:
    result = mcl("info", "missing.mcap", "--debug")
    assert result.code == 2
    assert "Traceback (most recent call last)" in result.err
    assert result.err.splitlines()[-1].startswith("mcl: error: missing.mcap: ")


def test_quiet_says_nothing_but_warnings_and_errors() -> None:
    scan, grid = ROOT / "samples/reference_set3.yaml", ROOT / "maps/reference.yaml"
    loud = mcl("score", scan, "--map", grid, "--pose", "0,0,0")
    quiet = mcl("score", scan, "--map", grid, "--pose", "0,0,0", "-q")
    assert "nothing says where the lidar sits" in loud.err
    assert (quiet.code, quiet.err, quiet.out) == (0, "", loud.out)
    assert single_error(mcl("score", scan, "--map", grid, "-q"), 2)


def test_every_command_is_in_one_group() -> None:
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted(COMMANDS)


def test_without_arguments_help_ends_with_two_examples() -> None:
    result = mcl()
    assert (result.code, result.out) == (2, b"")
    *_, heading, first, second = result.err.splitlines()
    assert heading == "Try:"
    assert first.startswith("  mcl info LOG ")
    assert second.startswith("  mcl run LOG --map MAP.yaml ")
    assert max(map(len, result.err.splitlines())) <= 80


@pytest.mark.parametrize(
    ("environment", "coloured"),
    [
        ({"FORCE_COLOR": "1"}, True),
        ({"NO_COLOR": "1"}, False),
        ({}, False),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_errors_are_in_colour_where_colours_are_on(
    environment: dict[str, str], *, coloured: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("FORCE_COLOR", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    error = console.line("error", "x: no such file")
    assert error == ("mcl: \x1b[31m\x1b[1merror:\x1b[0m x: no such file" if coloured else "mcl: error: x: no such file")
    assert console.line("", "x") == "mcl: x"


@pytest.mark.parametrize("choice", ["always", "never"])
def test_color_decides(choice: str) -> None:
    result = mcl("info", "missing.mcap", "--color", choice)
    assert ("\x1b[31m" in result.err) == (choice == "always")
