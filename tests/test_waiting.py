"""Waiting for processes: one that spins or sleeps for good is told from one that has much to do."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests import processes


def started(code: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_what_a_process_says_comes_back() -> None:
    code = "import sys; print('out'); print('err', file=sys.stderr); sum(range(3_000_000)); sys.exit(3)"
    process = started(code)
    assert processes.finish(process) == (b"out\n", b"err\n")
    assert process.returncode == 3


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("while True: pass", "processor time"),
        ("import signal; signal.pause()", "never comes"),
    ],
)
def test_one_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch, code: str, why: str) -> None:
    monkeypatch.setattr(processes, "ASLEEP", 15)
    process = started(code)
    with pytest.raises(TimeoutError, match=why):
        processes.finish(process, patience_s=1.0)
    process.communicate()
    assert process.returncode == -9
