"""Small files read whole: bounded, and told apart from what merely stands in their place."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

from mclcli.errors import InputError, UsageError

_STAND_INS = {
    b"version https://git-lfs": "is a Git LFS pointer, not the file itself; fetch it with git lfs pull",
    b"\x1f\x8b": "is compressed with gzip; unpack it first",
    b"PK\x03\x04": "is a zip archive; unpack it first",
}
_WEB_PAGE = (b"<!doctype html", b"<html", b"<head")


def read_bytes(path: str | Path, limit: int) -> bytes:
    """Contents of a regular file of at most ``limit`` bytes.

    Raises
    ------
    UsageError
        If there is no such file, or it is a folder.
    InputError
        If it cannot be read, is longer than ``limit``, empty, or a stand-in (Git LFS pointer, web page).

    """
    try:
        status = Path(path).stat()
        if not stat.S_ISREG(status.st_mode):
            raise UsageError(f"{path}: is not a regular file; name a file")
        with Path(path).open("rb") as stream:
            data = stream.read(limit + 1)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file; check the name") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot read: {reason}; check the file") from error
    if len(data) > limit:
        raise InputError(
            f"{path}: is longer than {limit} bytes, the most that is read; check that it is the right file"
        )
    refuse_stand_ins(data, str(path))
    return data


def read_stdin(limit: int) -> bytes:
    """Standard input to its end. InputError if it cannot be read, or is longer than ``limit`` bytes."""
    try:
        data = sys.stdin.buffer.read(limit + 1)
    except OSError as error:
        raise InputError(f"standard input: cannot read: {error.strerror or error}; name a file") from error
    if len(data) > limit:
        raise InputError(f"standard input: is longer than {limit} bytes, the most that is read; check it")
    return data


def refuse_stand_ins(data: bytes, name: str) -> None:
    """Raise InputError if the data are empty, a Git LFS pointer, a web page or packed."""
    if not data:
        raise InputError(f"{name}: is empty (0 bytes); copy it again")
    for magic, what in _STAND_INS.items():
        if data.startswith(magic):
            raise InputError(f"{name}: {what}")
    if data[:512].lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(_WEB_PAGE):
        raise InputError(f"{name}: is a web page; download the file itself")


def decode(data: bytes, name: str) -> str:
    """UTF-8 text, without a byte order mark; InputError naming the line where it is not UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}: not UTF-8 text, line {line}; save it as UTF-8") from None
