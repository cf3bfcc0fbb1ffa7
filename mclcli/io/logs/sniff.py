"""What a file is, by its first bytes and never by its name."""

from __future__ import annotations

from mclcli.errors import InputError

HEAD = 512
"""Bytes looked at."""

_KINDS = {
    b"\x89MCAP0\r\n": "mcap",
    b"#ROSBAG V2.0\n": "bag1",
    b"SQLite format 3\0": "db3",
    b"\x28\xb5\x2f\xfd": "zstd",
}
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


def kind_of(head: bytes, name: str) -> str:
    """``mcap``, ``bag1``, ``db3`` or ``zstd`` (one of them, compressed as a whole) from the first bytes of a file.

    Raises InputError naming what the file is instead.
    """
    for magic, kind in _KINDS.items():
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
    return "is not a log (neither MCAP, nor a ROS 1 bag, nor a rosbag2 database); name another file"
