"""Bytes as a file for libraries that want a path."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextlib.contextmanager
def on_disk(data: bytes, name: str) -> Iterator[Path]:
    """A file of this name and content, for as long as the block lasts."""
    with tempfile.TemporaryDirectory(prefix="mcl-battery-") as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        yield path
