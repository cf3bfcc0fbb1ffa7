"""Which files of a folder make up its log."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from mclcli.errors import InputError
from mclcli.io.logs.base import Damage
from mclcli.io.logs.sniff import CONTAINERS

if TYPE_CHECKING:
    from pathlib import Path

_METADATA_LIMIT = 1 << 24  # bytes of metadata.yaml that are looked at


def counts_of(folder: Path) -> dict[str, int]:
    """Messages that metadata.yaml counts in each file, by the file's base name; nothing where it does not say."""
    text = _metadata(folder)
    block = re.search(r"^ *files: *\r?\n((?: *- .*\n(?: +[^-\s].*\n)*)+)", text, re.MULTILINE)
    counts: dict[str, int] = {}
    for entry in re.split(r"^ *- ", block[1], flags=re.MULTILINE) if block else []:
        path, count = (re.search(rf"^ *{key}: *(.*?)\s*$", entry, re.MULTILINE) for key in ("path", "message_count"))
        if path and count and count[1].isdecimal():
            counts[path[1].strip("\"'").rpartition("/")[2].removesuffix(".zstd")] = int(count[1][:18])
    return counts


def types_of(folder: Path) -> dict[str, str]:
    """Type of each topic that metadata.yaml names, '' that it does not; nothing without one."""
    entries = re.split(r"^ *(?:- *)?topic_metadata:[ \t\r]*$", _metadata(folder), flags=re.MULTILINE)[1:]
    keys = [re.compile(rf"^ *{key}: *(\S+)\s*$", re.MULTILINE) for key in ("name", "type")]
    pairs = ([key.search(entry) for key in keys] for entry in entries)
    return {name[1].strip("\"'"): kind[1].strip("\"'") for name, kind in pairs if name and kind}


def lists(folder: Path, file: str) -> bool:
    """Whether a folder's metadata.yaml lists a file of this name."""
    return any(entry.replace("\\", "/").rpartition("/")[2] == file for entry in _listed(folder))


def files_of(folder: Path) -> tuple[list[Path], list[Damage]]:
    """Files of a rosbag2 folder in recorded order, and a Damage for each that its metadata.yaml names in vain.

    Without metadata.yaml: all files of the first kind there is (.mcap, .db3, .bag), numbers in their names in order.
    Raises InputError for a folder without any.
    """
    listed = _listed(folder)
    found = [(name, _locate(folder, name)) for name in listed]
    files = [path for _, path in found if path is not None] or _by_name(folder)
    if not files:
        *most, last = (kind.endings[0] for kind in CONTAINERS.values())
        raise InputError(
            f"{folder.name}: folder holds no log (no {', '.join(most)} or {last} file); name the log itself"
        )
    gone = [name for name, path in found if path is None]
    return files, [Damage(folder.name, 0, f"{name}, listed in metadata.yaml, is not there") for name in gone]


def _listed(folder: Path) -> list[str]:
    """Entries of ``relative_file_paths`` in metadata.yaml, in order.

    rosbag2 writes that list one entry a line; anything else counts as no list, and the file names decide. So nothing
    of a YAML file has to be built from a log that may be hostile.
    """
    text = _metadata(folder)
    block = re.search(r"^ *relative_file_paths: *\r?\n((?: *- +\S.*\n?)+)", text, re.MULTILINE)
    entries = re.findall(r"^ *- +(.*?)\s*$", block[1], re.MULTILINE) if block else []
    return [entry.strip("\"'") for entry in entries]


def _metadata(folder: Path) -> str:
    """Text of metadata.yaml, '' without one."""
    path = folder / "metadata.yaml"
    if not path.is_file():
        return ""
    with path.open("rb") as stream:
        return stream.read(_METADATA_LIMIT).decode("utf-8", "replace")


def _locate(folder: Path, name: str) -> Path | None:
    """File for an entry: its base name within the folder (old bags list longer paths), compressed or not."""
    base = name.replace("\\", "/").rpartition("/")[2]
    candidates = (folder / base, folder / f"{base}.zstd", folder / base.removesuffix(".zstd"))
    return next((path for path in candidates if base and path.is_file()), None)


def _by_name(folder: Path) -> list[Path]:
    files = sorted((path for path in folder.iterdir() if path.is_file()), key=_natural)
    endings = (ending for kind in CONTAINERS.values() for ending in kind.endings)
    of_ending = ([path for path in files if path.name.removesuffix(".zstd").endswith(ending)] for ending in endings)
    return next((some for some in of_ending if some), [])


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key under which x_9 comes before x_10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", path.name)]
