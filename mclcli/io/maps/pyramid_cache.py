"""Pyramids of the search kept on disk beside the distance fields they are made of, under the same rules.

Source: ``mclcli.world.pyramid``; see ``mclcli.io.maps.field_cache`` for the fields.
"""

from __future__ import annotations

import hashlib
import json
import os
from typing import TYPE_CHECKING

import numpy as np

from mclcli import cache
from mclcli.io.maps.field_cache import HEADER, read_into
from mclcli.world import pyramid
from mclcli.world.pyramid import Pyramid

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.arrays import IntArray
    from mclcli.world.distance_field import DistanceField

_MAGIC = b"mcl pyramid\n"
_FORMAT = 2


def pyramid_path(field: DistanceField) -> Path:
    """Where the pyramid of this field belongs."""
    return cache.folder("fields") / f"{_digest(field)[:32]}.pyramid"


def cached_pyramid(field: DistanceField) -> tuple[Pyramid, bool]:
    """The pyramid of a field, and whether it came from the cache; computed and stored where it did not."""
    path, digest, layout = pyramid_path(field), _digest(field), pyramid.layout(*field.codes.shape)
    stored = _load(path, digest, layout)
    if stored is not None:
        return stored, True
    built = pyramid.build(field)
    try:
        cache.write_whole(path, [_header(digest, hashlib.sha256(built.pool.data).hexdigest()), built.pool.data])
    except OSError as error:
        cache.cannot_keep("the pyramid", path, error)
    return built, False


def _digest(field: DistanceField) -> str:
    hashed = hashlib.sha256(f"{_FORMAT} {field.codes.shape} {field.codes.dtype} {field.levels.size}".encode())
    hashed.update(field.codes.data)
    hashed.update(np.ascontiguousarray(field.levels).data)
    return hashed.hexdigest()


def _load(path: Path, digest: str, layout: IntArray) -> Pyramid | None:
    """Pyramid of a cache file, or None if there is none, it is not ours, or anything in it does not fit."""
    pool = np.empty(pyramid.size_of(layout), np.uint8)
    try:
        with cache.open_kept(path) as file:
            status, start, hashed = os.fstat(file.fileno()), file.read(HEADER), hashlib.sha256()
            if status.st_size != HEADER + pool.nbytes:
                return None
            if not read_into(pool, file, hashed) or start != _header(digest, hashed.hexdigest()):
                return None
    except OSError:
        return None
    pool.flags.writeable = False
    return Pyramid(pool, layout)


def _header(digest: str, payload: str) -> bytes:
    text = json.dumps({"format": _FORMAT, "field": digest, "sha256": payload})
    return (_MAGIC + text.encode()).ljust(HEADER - 1) + b"\n"
