""".ci/run by parts: what each calls, and that the service's workflow and the pre-commit hooks call parts that exist."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BASH = shutil.which("bash") or "bash"


def call(*parts: str, top: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """.ci/run of a repository, for some of its parts."""
    return subprocess.run([BASH, ".ci/run", *parts], cwd=top, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("path", "left_out"), [(".github/workflows/ci.yml", set()), (".pre-commit-config.yaml", {"readme"})]
)
def test_all_parts_are_called(path: str, left_out: set[str]) -> None:
    refused = call("none")
    assert (refused.returncode, refused.stdout) == (2, "")
    parts = set(re.findall(r"\w+", refused.stderr.partition("there are")[2]))
    text = (ROOT / path).read_text(encoding="utf-8")
    assert set(re.findall(r"\.ci/run (\w+)$", text, re.MULTILINE)) == parts - left_out


@pytest.fixture
def stubbed(tmp_path: Path) -> Path:
    """Folder with nothing but .ci/run, and tools in .venv that print how they were called; lint-imports fails."""
    (tmp_path / ".ci").mkdir()
    (tmp_path / ".ci/run").write_bytes((ROOT / ".ci/run").read_bytes())
    tools = tmp_path / ".venv/bin"
    tools.mkdir(parents=True)
    for name in ("ruff", "mypy", "lint-imports", "python"):
        ending = "exit 1" if name == "lint-imports" else ""
        (tools / name).write_text(f'#!/bin/sh\necho "{name} $*"\n{ending}\n', encoding="utf-8")
        (tools / name).chmod(0o755)
    return tmp_path


def test_parts_call_their_tools(stubbed: Path) -> None:
    done = call("lint", "types", "docs", top=stubbed)
    calls = [line.strip() for line in done.stdout.splitlines() if not line.startswith("==")]
    assert calls == ["ruff check .", "ruff format --check .", "mypy", "python docs/build.py --check"]
    assert done.returncode == 0


def test_a_part_that_fails_ends_it(stubbed: Path) -> None:
    done = call("imports", "docs", top=stubbed)
    assert done.returncode == 1
    assert "docs/build.py" not in done.stdout
