"""Distance fields kept on disk, addressed by what they were made from; checked at every open, never trusted.

A file is a magic line, one line of JSON (format, shapes, types, SHA-256 of the payload) and the payload: codes, levels.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli import cache
from mclcli.world import distance_field
from mclcli.world.distance_field import DistanceField

if TYPE_CHECKING:
    from mclcli.world.distance_field import Method
    from mclcli.world.occupancy import OccupancyGrid

_MAGIC = b"mcl distance field\n"
_FORMAT = 1
_MAX_HEADER = 4096


def field_path(
    grid: OccupancyGrid, method: Method, max_dist: float, *, boundary_only: bool = False, mark_unknown: bool = False
) -> Path:
    """Where the field of this map, method and clamp belongs."""
    return _path(grid, _kind(method, boundary_only=boundary_only, mark_unknown=mark_unknown), max_dist)


def cached_field(
    grid: OccupancyGrid, method: Method, max_dist: float, *, boundary_only: bool = False, mark_unknown: bool = False
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
        logging.getLogger("mclcli").warning("%s: cannot keep the field: %s; going on without", path, error.strerror)
    return field, False


def _kind(method: Method, *, boundary_only: bool, mark_unknown: bool) -> str:
    return f"{method}{' boundary' if boundary_only else ''}{' unknown' if mark_unknown else ''}"


def _path(grid: OccupancyGrid, kind: str, max_dist: float) -> Path:
    key = f"{_FORMAT} {grid.digest()} {kind} {max_dist!r}"
    return cache.cache_root() / "fields" / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.field"


def _load(path: Path, grid: OccupancyGrid, kind: str, max_dist: float) -> DistanceField | None:
    """Field of a cache file, or None if there is none, it is not ours, or anything in it does not fit."""
    try:
        with path.open("rb") as file:
            if not cache.is_ours(os.fstat(file.fileno())) or file.readline(len(_MAGIC)) != _MAGIC:
                return None
            header = json.loads(file.readline(_MAX_HEADER))
            payload = file.read()
        code_type, levels = header["code_type"], header["levels"]
        if header != _header(grid, kind, max_dist, code_type, levels, payload):
            return None
        split = grid.cells.size * np.dtype(code_type).itemsize
        if len(payload) != split + 8 * levels:
            return None
        return DistanceField(
            np.frombuffer(payload[:split], code_type).reshape(grid.cells.shape),
            np.frombuffer(payload[split:], "<f8", count=levels),
            grid.resolution,
            grid.origin,
        )
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _header(
    grid: OccupancyGrid, kind: str, max_dist: float, code_type: str, levels: int, payload: bytes
) -> dict[str, object]:
    """What the file says of its payload; a payload that is not what its maker wrote has another digest."""
    if code_type not in {"<u2", "<u4"}:
        raise ValueError(code_type)
    return {
        "format": _FORMAT,
        "map": grid.digest(),
        "kind": kind,
        "max_dist": max_dist,
        "shape": list(grid.cells.shape),
        "code_type": code_type,
        "levels": levels,
        "sha256": hashlib.sha256(payload).hexdigest(),
    }


def _store(path: Path, grid: OccupancyGrid, field: DistanceField, kind: str, max_dist: float) -> None:
    """Write beside the target and move into place, so that no reader ever sees half a file."""
    cache.make_private(path.parent)
    code_type = field.codes.dtype.newbyteorder("<").str
    payload = field.codes.astype(code_type, copy=False).tobytes() + field.levels.astype("<f8", copy=False).tobytes()
    header = json.dumps(_header(grid, kind, max_dist, code_type, field.levels.size, payload))
    handle, name = tempfile.mkstemp(prefix=".field-", dir=path.parent)  # mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.writelines([_MAGIC, header.encode(), b"\n", payload])
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
