"""Logs and runs that several tests of the command line look at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.cli.support import (
    OFFICE,
    OFFICE_MAP,
    START_NS,
    Everything,
    Message,
    Result,
    contents,
    mcl,
    messages,
    outputs,
    write_mcap,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Runner = Callable[..., Result]

SHORT_NS = 12 * 10**9


@pytest.fixture(scope="session")
def office_messages() -> list[Message]:
    """The first 12 s of the office sample."""
    return [message for message in messages(OFFICE) if message.log_ns < START_NS + SHORT_NS]


@pytest.fixture(scope="session")
def short(office_messages: list[Message], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 12 s of the office sample as a log of its own."""
    return write_mcap(tmp_path_factory.mktemp("short") / "short.mcap", office_messages)


@pytest.fixture(scope="session")
def run_short(short: Path) -> Runner:
    """Run 300 particles over the short log, from its /initialpose unless said otherwise."""

    def call(*words: object, log: object = short, stdin: bytes = b"", init: object = "/initialpose") -> Result:
        arguments = ("run", log, "--map", OFFICE_MAP, "--init", init, "--particles", 300, *words)
        return mcl(*arguments, stdin=stdin)

    return call


@pytest.fixture(scope="session")
def short_track(run_short: Runner) -> bytes:
    """Track of the short log as CSV."""
    result = run_short()
    assert result.code == 0
    return result.out


@pytest.fixture(scope="session")
def everything(run_short: Runner, tmp_path_factory: pytest.TempPathFactory) -> Everything:
    """Every kind of output over the short log."""
    folder = tmp_path_factory.mktemp("everything")
    result = run_short(*outputs(folder))
    assert (result.code, result.out) == (0, b"")
    return Everything(contents(folder))
