"""Distance fields kept on disk, addressed by what they were made from; checked at every open, never trusted.

A file is a magic line, JSON (format, shapes, types, SHA-256 of the payload) filled up with blanks, and the payload:
codes, levels.
"""

from __future__ import annotations

import hashlib
import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli import cache
from mclcli.world import distance_field
from mclcli.world.distance_field import DistanceField

if TYPE_CHECKING:
    from hashlib import _Hash as Digest
    from io import FileIO
    from pathlib import Path

    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray
    from mclcli.world import FieldMethod
    from mclcli.world.occupancy import OccupancyGrid

_MAGIC = b"mcl distance field\n"
_FORMAT = 2
HEADER = 512  # bytes of magic line and JSON line, filled up with blanks
_PIECE = 1 << 19  # bytes that are read and hashed at a time


def field_path(
    grid: OccupancyGrid,
    method: FieldMethod,
    max_dist: float,
    *,
    boundary_only: bool = False,
    mark_unknown: bool = False,
) -> Path:
    """Where the field of this map, method and clamp belongs."""
    return _path(grid, _kind(method, boundary_only=boundary_only, mark_unknown=mark_unknown), max_dist)


def cached_field(
    grid: OccupancyGrid,
    method: FieldMethod,
    max_dist: float,
    *,
    boundary_only: bool = False,
    mark_unknown: bool = False,
) -> tuple[DistanceField, bool]:
    """The distance field, and whether it came from the cache; computed and stored where it did not.

    Arguments as of ``distance_field.compute``. Whatever is wrong with the cache costs a warning at most.
    """
    kind = _kind(method, boundary_only=boundary_only, mark_unknown=mark_unknown)
    path = _path(grid, kind, max_dist)
    stored = _load(path, grid, kind, max_dist)
    if stored is not None:
        return stored, True
    field = distance_field.compute(grid, method, max_dist, boundary_only=boundary_only, mark_unknown=mark_unknown)
    try:
        _store(path, grid, field, kind, max_dist)
    except OSError as error:
        cache.cannot_keep("the field", path, error)
    return field, False


def _kind(method: FieldMethod, *, boundary_only: bool, mark_unknown: bool) -> str:
    return f"{method}{' boundary' if boundary_only else ''}{' unknown' if mark_unknown else ''}"


def _path(grid: OccupancyGrid, kind: str, max_dist: float) -> Path:
    key = f"{_FORMAT} {grid.digest()} {kind} {max_dist!r}"
    return cache.folder("fields") / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.field"


def _load(path: Path, grid: OccupancyGrid, kind: str, max_dist: float) -> DistanceField | None:
    """Field of a cache file, or None if there is none, it is not ours, or anything in it does not fit."""
    try:
        with cache.open_kept(path) as file:
            return _read(file, grid, kind, max_dist)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _read(file: FileIO, grid: OccupancyGrid, kind: str, max_dist: float) -> DistanceField | None:
    """The same of an open file. It is read, not mapped: a file that shrinks under a map would end the process."""
    status = os.fstat(file.fileno())
    start = file.read(HEADER)
    if not start.startswith(_MAGIC) or not start.endswith(b"\n"):
        return None
    header = json.loads(start[len(_MAGIC) :])
    codes, levels = np.empty(grid.cells.shape, _code_type(header["code_type"])), np.empty(header["levels"], "<f8")
    if status.st_size != HEADER + codes.nbytes + levels.nbytes:
        return None
    digest = hashlib.sha256()
    if not (read_into(codes, file, digest) and read_into(levels, file, digest)):
        return None
    if header != _header(grid, kind, max_dist, codes, levels, digest.hexdigest()):
        return None
    codes.flags.writeable = levels.flags.writeable = False
    return DistanceField(codes, levels, grid.resolution, grid.origin)


def read_into(array: NDArray[Any], file: FileIO, digest: Digest) -> bool:
    """Read an array piece by piece, each hashed while it is in the processor's cache; False if the file ends before."""
    left = array.reshape(-1).view(np.uint8).data
    while left:
        count = file.readinto(left[:_PIECE])
        if not count:
            return False
        digest.update(left[:count])
        left = left[count:]
    return True


def _code_type(name: str) -> str:
    if name not in {"<u2", "<u4"}:
        raise ValueError(name)
    return name


def _header(
    grid: OccupancyGrid,
    kind: str,
    max_dist: float,
    codes: NDArray[Any],
    levels: FloatArray,
    digest: str,
) -> dict[str, object]:
    """What the file says of its payload; a payload that is not what its maker wrote has another digest."""
    return {
        "format": _FORMAT,
        "map": grid.digest(),
        "kind": kind,
        "max_dist": max_dist,
        "shape": list(codes.shape),
        "code_type": codes.dtype.newbyteorder("<").str,
        "levels": levels.size,
        "sha256": digest,
    }


def _store(path: Path, grid: OccupancyGrid, field: DistanceField, kind: str, max_dist: float) -> None:
    """Write beside the target and move into place, so that no reader ever sees half a file."""
    codes = np.ascontiguousarray(field.codes, field.codes.dtype.newbyteorder("<"))
    levels = np.ascontiguousarray(field.levels, "<f8")
    payload = [codes.reshape(-1).view(np.uint8).data, levels.view(np.uint8).data]
    digest = hashlib.sha256(payload[0])
    digest.update(payload[1])
    header = json.dumps(_header(grid, kind, max_dist, codes, levels, digest.hexdigest()))
    cache.write_whole(path, [(_MAGIC + header.encode()).ljust(HEADER - 1) + b"\n", *payload])
