"""Completion by Tab, as the shells ask for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from tests.cli.support import OFFICE, ROOT

if TYPE_CHECKING:
    from pathlib import Path

ENTRY = f"{sys.executable} -c 'from mclcli.__main__ import main; main()'"


def offered(*words: str) -> list[str]:
    """What bash is offered for the last of some words."""
    asked = {"_MCL_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(("mcl", *words)), "COMP_CWORD": str(len(words))}
    command = [sys.executable, "-c", "from mclcli.__main__ import main; main()"]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | asked, capture_output=True, text=True, check=True)
    return [line.partition(",")[2] for line in done.stdout.splitlines() if line]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("lo",), ["locate"]),
        (("run", "--prof"), ["--profile"]),
        (("run", "--profile", ""), ["textbook", "nav2", "beluga"]),
        (("run", str(OFFICE), "--scan", "/"), ["/scan"]),
        (("run", str(OFFICE), "--odom", ""), ["tf", "/odom"]),
        (("run", str(OFFICE), "--init", "/g"), ["/ground_truth"]),
        (("run", "--set", "map_upd"), ["map_update="]),
        (("run", "--set", "map_update=f"), ["map_update=first", "map_update=follow"]),
        (("extract", str(OFFICE), "--topic", "/tf"), ["/tf", "/tf_static"]),
        (("run", "no-such-log.bag", "--scan", "/"), []),
    ],
)
def test_what_is_offered(words: tuple[str, ...], expected: list[str]) -> None:
    assert offered(*words) == expected


def test_bash_completes_at_its_own_prompt(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash here")
    program = tmp_path / "mcl"
    program.write_text(f'#!/bin/sh\nexec {ENTRY} "$@"\n')
    program.chmod(0o755)
    script = (
        'eval "$(_MCL_COMPLETE=bash_source mcl)"; COMP_WORDS=(mcl run --rec); COMP_CWORD=2; '
        '_mcl_completion mcl; echo "${COMPREPLY[@]}"'
    )
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [bash, "-c", script], cwd=tmp_path, env=os.environ | path, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["--recovery"]


@pytest.mark.parametrize(("shell", "word"), [("bash", "complete"), ("zsh", "compdef"), ("fish", "complete")])
def test_each_shell_has_its_script(shell: str, word: str) -> None:
    command = [sys.executable, "-c", "from mclcli.__main__ import main; main()"]
    asked = {"_MCL_COMPLETE": f"{shell}_source"}
    done = subprocess.run(command, cwd=ROOT, env=os.environ | asked, capture_output=True, text=True, check=True)
    assert word in done.stdout
    assert "_MCL_COMPLETE" in done.stdout
