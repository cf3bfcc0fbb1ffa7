"""A copy of the repository in which a patch is applied, tests are run, and the patch is taken back."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("mclcli", "tests", "samples", "maps", "pyproject.toml")
LIMIT_S = 600
"""Processor time after which tests end; a promise about time is broken by then, which is noticed as well."""


class Patch(NamedTuple):
    """A sabotage: ``old`` text, which stands once in a ``file`` below mclcli, and what takes its place.

    ``breaks`` is the promise; ``noticed_by`` the test, or parts of one, that must fail.
    """

    breaks: str
    file: str
    old: str
    new: str
    noticed_by: str


class StalePatchError(Exception):
    """A patch whose text is not there any more, or not once."""


def applied(patch: Patch, root: Path) -> str:
    """The file's text with the patch; StalePatchError if it does not apply."""
    path = root / "mclcli" / patch.file
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    if (count := text.count(patch.old)) != 1:
        raise StalePatchError(
            f"patch '{patch.breaks}': its text stands {count} times in mclcli/{patch.file}, not once: "
            f"{patch.old!r}; write it for the code as it is now"
        )
    return text.replace(patch.old, patch.new)


@contextlib.contextmanager
def copy(root: Path = ROOT) -> Iterator[Path]:
    """A scratch copy of what tests need."""
    with tempfile.TemporaryDirectory(prefix="mcl-sabotage-") as folder:
        for name in PARTS:
            if (root / name).is_dir():
                shutil.copytree(root / name, Path(folder) / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(root / name, folder)
        yield Path(folder)


@contextlib.contextmanager
def patched(patch: Patch, scratch: Path) -> Iterator[None]:
    """The scratch copy with a patch in it."""
    path, after = scratch / "mclcli" / patch.file, applied(patch, scratch)
    before = path.read_bytes()
    path.write_text(after, encoding="utf-8")
    try:
        yield
    finally:
        path.write_bytes(before)


class Outcome(NamedTuple):
    """How tests ended: pytest's exit code (negative: a signal), the processor time they took [s], their last words."""

    code: int
    seconds: float
    tail: str


def test(noticed_by: str, scratch: Path) -> Outcome:
    """Run tests in the scratch copy, until the first fails."""
    node, _, words = noticed_by.partition(" -k ")
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", f"tests/{node}"]
    environment = {
        **os.environ,
        "PYTHONPATH": str(scratch),
        "PYTHONDONTWRITEBYTECODE": "1",  # a patch may be taken back within the second that dates bytecode
        "XDG_CACHE_HOME": str(scratch / "cache"),
    }
    if (ROOT.parent / "shared").is_dir():
        environment.setdefault("MCL_TEST_DATA", str(ROOT.parent / "shared"))
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command + (["-k", words] if words else []),
        cwd=scratch,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S)),
    )
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
    return Outcome(done.returncode, seconds, done.stdout[-2000:])
