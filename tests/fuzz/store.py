"""The corpus: a file for each target, an input a line; text as JSON, everything else packed."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

FOLDER = Path(__file__).parent / "corpus"


def load(target: str, folder: Path = FOLDER) -> list[bytes]:
    """Inputs of a target, none if it has no file yet."""
    path = _path(target, folder)
    lines = path.read_text(encoding="ascii").splitlines() if path.exists() else []
    return [_read(json.loads(line)) for line in lines]


def save(target: str, inputs: Iterable[bytes], folder: Path = FOLDER) -> None:
    """Write all inputs of a target, the shortest first."""
    ordered = sorted(set(inputs), key=lambda data: (len(data), data))
    lines = (json.dumps(_written(data)) for data in ordered)
    _path(target, folder).write_text("".join(f"{line}\n" for line in lines), encoding="ascii")


def _written(data: bytes) -> str | dict[str, str]:
    if data.isascii() and data.replace(b"\n", b"").decode().isprintable():
        return data.decode()
    return {"zlib": base64.b64encode(zlib.compress(data, 9)).decode()}


def _read(value: str | dict[str, str]) -> bytes:
    return value.encode() if isinstance(value, str) else zlib.decompress(base64.b64decode(value["zlib"]))


def _path(target: str, folder: Path) -> Path:
    return folder / f"{target.replace(' ', '_')}.txt"
