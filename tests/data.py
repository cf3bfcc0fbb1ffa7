"""Where tests find the real logs, maps and golden numbers that do not belong to this repository."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_BESIDE = Path(__file__).resolve().parents[2] / "shared"


def _root() -> Path:
    return Path(os.environ.get("MCL_TEST_DATA") or _BESIDE)


def shared(relative: str, folder: str = "data") -> Path:
    """Path of one shared file; skips the test, saying why, where there is none."""
    path = _root() / folder / relative
    if not path.exists() and os.environ.get("CI") == "true" and (_root() / folder).is_dir():
        pytest.fail(f"{folder}/ is there, but {relative} is not")
    if not path.exists():
        pytest.skip(f"needs {folder}/{relative}: set MCL_TEST_DATA to the folder that holds data/ and golden/")
    return path


def golden(relative: str) -> Path:
    """Path of one golden file; skips the test where there is none."""
    return shared(relative, folder="golden")
