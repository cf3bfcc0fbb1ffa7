"""From what the user named to an open log: files, folders, pipes, told apart by their first bytes."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Protocol

from mclcli.errors import InputError, UsageError
from mclcli.io.logs.folder import counts_of, files_of, lists, types_of
from mclcli.io.logs.log import Log, unreadable
from mclcli.io.logs.sniff import HEAD, kind_of
from mclcli.io.logs.source import ByteSource, Origin, open_source

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.io.logs.base import Container, Damage
    from mclcli.io.logs.sniff import Kind


class Opener(Protocol):
    """Makes the container of one kind."""

    def __call__(self, source: str, start: Origin, /) -> Container:
        """Container of the bytes at ``start``, called ``source`` before the user; nothing is read yet."""
        ...


def open_log(paths: Sequence[Path | str], *, stdin: BinaryIO | None = None) -> Log:
    """Open files and rosbag2 folders as one log; ``-`` alone is ``stdin`` (default: the process's own).

    Raises UsageError for a file that does not exist, InputError for one that is not a log.
    """
    if not paths:
        raise UsageError("no log was named; name a file, a folder, or - for stdin")
    if "-" in map(str, paths):
        if len(paths) > 1:
            raise UsageError("- (stdin) cannot be combined with other logs; name either")
        return Log((_stream("stdin", stdin or sys.stdin.buffer, borrowed=True),), (), seekable=False)
    try:
        return _open_files([Path(path) for path in paths])
    except OSError as error:
        raise unreadable(Path(error.filename or paths[0]).name, error) from error


def _open_files(paths: list[Path]) -> Log:
    files: list[Path] = []
    missing: list[Damage] = []
    counts: dict[Path, int] = {}
    arguments: list[int] = []
    for number, path in enumerate(paths):
        if not path.exists():
            raise UsageError(f"{path}: no such file; check the name")
        if path.is_dir():
            found, gone = files_of(path)
            files += found
            missing += gone
            counts |= {file: count for file in found if (count := counts_of(path).get(file.name.removesuffix(".zstd")))}
        else:
            files.append(path)
        arguments += [number] * (len(files) - len(arguments))
    seekable = all(path.is_file() for path in files)
    containers = tuple(
        _file(path, counts.get(path)) if path.is_file() else _stream(path.name, path.open("rb")) for path in files
    )
    return Log(containers, tuple(files), seekable, tuple(missing), tuple(arguments))


def _file(path: Path, counted: int | None) -> Container:
    """Container for a file; ``counted`` messages stand in it, says its folder's metadata.yaml, if that says so.

    A metadata.yaml beside the file that lists it says what types its topics have.
    """
    types = types_of(path.parent) if lists(path.parent, path.name) else {}
    with path.open("rb") as stream:
        kind = kind_of(stream.read(HEAD), path.name)
    if kind is not None:
        return _opener(kind)(path.name, Origin(lambda: open_source(path), path, counted, types))
    from mclcli.io.logs.zstd_file import ZstdFile, first_bytes

    head = first_bytes(path, HEAD)
    if not head:
        raise InputError(f"{path.name}: does not decompress (zstd); copy it again")
    inner = kind_of(head, path.name)
    if inner is None:
        raise InputError(f"{path.name}: is compressed twice; unpack it first")

    def unpacked(plain: Path) -> Container:
        return _opener(inner)(path.name, Origin(lambda: open_source(plain), plain, counted, types))

    return ZstdFile(path.name, path, unpacked)


def _opener(kind: Kind) -> Opener:
    module, _, attribute = kind.opener.partition(":")
    opener: Opener = getattr(import_module(module), attribute)
    return opener


def _stream(name: str, stream: BinaryIO, *, borrowed: bool = False) -> Container:
    """Container for a pipe, which can be read once."""
    head = b""
    while len(head) < HEAD and (more := stream.read(HEAD - len(head))):
        head += more
    kind = kind_of(head, name)
    if kind is None or not kind.piped:
        what = "compressed as a whole" if kind is None else f"{kind.name} ({kind.endings[0]})"
        raise InputError(f"{name}: is {what} and cannot be read from a pipe; name the file instead")
    used = False

    def start() -> ByteSource:
        nonlocal used
        if used:
            raise InputError(f"{name}: was read already, and a pipe can be read once; name a file instead")
        used = True
        return ByteSource(stream, None, head, borrowed=borrowed)

    return _opener(kind)(name, Origin(start))
