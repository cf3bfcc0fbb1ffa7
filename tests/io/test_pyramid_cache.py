"""Pyramids on disk, under the rules of the fields beside which they lie."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.maps.pyramid_cache import cached_pyramid, pyramid_path
from mclcli.world import distance_field, pyramid
from tests.worlds import room

if TYPE_CHECKING:
    from pathlib import Path

FIELD = distance_field.compute(room(), "exact", 1.5)
TRUE = pyramid.build(FIELD)


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "fsync", lambda _: None)


def found() -> bool:
    """Whether the pyramid came from the cache; it must be right either way."""
    built, hit = cached_pyramid(FIELD)
    np.testing.assert_array_equal(built.pool, TRUE.pool)
    np.testing.assert_array_equal(built.shapes, TRUE.shapes)
    assert not built.pool.flags.writeable
    return hit


def test_a_hit_follows_a_miss() -> None:
    assert [found(), found()] == [False, True]
    other = distance_field.compute(room(), "exact", 1.4)
    assert pyramid_path(other) != pyramid_path(FIELD)
    assert pyramid_path(FIELD).parent.stat().st_mode & 0o777 == 0o700


def test_any_damage_is_noticed_and_repaired() -> None:
    found()
    path = pyramid_path(FIELD)
    whole = path.read_bytes()
    damages = [whole[:-1], whole + b"\0", b"", b"mcl pyramid\n[]"]
    for position in range(0, len(whole), 13):
        changed = bytearray(whole)
        changed[position] ^= 1 << position % 8
        damages.append(bytes(changed))
    for damaged in damages:
        path.write_bytes(damaged)
        assert not found()
        assert path.read_bytes() == whole
