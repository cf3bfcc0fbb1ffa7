"""The containers of messages that can be read, and which of them a file is: by its first bytes, never by its name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from mclcli.errors import InputError

HEAD = 512
"""Bytes looked at."""


@final
@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of container: its ``name`` in a sentence, and the ``endings`` that a folder is searched for.

    ``opener`` is where its ``Opener`` (``opening``) stands, as ``module:name``; it is imported when a file is opened.
    One that is not ``piped`` needs a file to go back and forth in.
    """

    name: str
    endings: tuple[str, ...]
    opener: str
    piped: bool = True


CONTAINERS: dict[bytes, Kind] = {
    b"\x89MCAP0\r\n": Kind("MCAP", (".mcap",), "mclcli.io.logs.mcap_file:open_mcap"),
    b"SQLite format 3\0": Kind("a rosbag2 database", (".db3",), "mclcli.io.logs.db3_file:open_db3", piped=False),
    b"#ROSBAG V2.0\n": Kind("a ROS 1 bag", (".bag", ".active"), "mclcli.io.logs.bag1_file:Bag1File"),
}
"""By the first bytes of a file; folders are searched in this order."""
_ZSTD = b"\x28\xb5\x2f\xfd"
_OTHERS = {
    b"version https://git-lfs": "is a Git LFS pointer, not the log itself; fetch it with git lfs pull",
    b"\x89MCAP": "is MCAP of another version than 0; convert it with the mcap tool",
    b"#ROSBAG V": "is a ROS 1 bag of another version than 2.0; convert it with rosbag fix",
    b"\x1f\x8b": "is compressed with gzip; unpack it first",
    b"BZh": "is compressed with bzip2; unpack it first",
    b"\xfd7zXZ": "is compressed with xz; unpack it first",
    b"\x04\x22\x4d\x18": "is compressed with lz4; unpack it first",
    b"PK\x03\x04": "is a zip archive; unpack it first",
    b"P5": "is a picture, not a log; give it with --map",
    b"\x89PNG": "is a picture, not a log; give it with --map",
}
_HTML = (b"<!doctype html", b"<html", b"<head", b"<?xml")


def kind_of(head: bytes, name: str) -> Kind | None:
    """What a file is, from its first bytes; None: compressed as a whole with zstd.

    Raises InputError naming what the file is instead.
    """
    if head.startswith(_ZSTD):
        return None
    for magic, kind in CONTAINERS.items():
        if head.startswith(magic):
            return kind
    raise InputError(f"{name}: {_what_else(head)}")


def _what_else(head: bytes) -> str:
    if not head:
        return "is empty (0 bytes); record or copy it again"
    for magic, what in _OTHERS.items():
        if head.startswith(magic):
            return what
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(_HTML):
        return "is a web page, not a log; download the file itself"
    if not any(head):
        return "begins with zeros, not with a log; copy it again"
    return f"is not a log (neither {', nor '.join(kind.name for kind in CONTAINERS.values())}); name another file"
