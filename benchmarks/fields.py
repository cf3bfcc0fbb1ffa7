"""Rows of the table about distance fields: computing them, and reading them from the cache."""

from __future__ import annotations

import hashlib
import os
import tempfile
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.measure import added_memory, alternate, timed
from mclcli.io.maps.field_cache import cached_field
from mclcli.world import distance_field
from mclcli.world.occupancy import FREE, OCCUPIED, OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.measure import Row
    from mclcli.arrays import BoolArray


def walls(side: int) -> OccupancyGrid:
    """A map of walls along both axes, one for eight rows."""
    rng, occupied = np.random.default_rng(0), np.zeros((side, side), np.bool_)
    for k in range(side // 8):
        row, column, length = (int(v) for v in rng.integers(0, [side, side, side // 4]))
        occupied[(row, slice(column, column + length)) if k % 2 else (slice(row, row + length), column)] = True
    return OccupancyGrid(np.where(occupied, OCCUPIED, FREE).astype(np.int8), 0.05, np.zeros(3))


def others(occupied: BoolArray) -> dict[str, Callable[[], object]]:
    """Exact transforms that pip can install; SciPy always, ``edt`` and OpenCV where the extra ``bench`` is."""
    from scipy.ndimage import distance_transform_edt

    free = ~occupied
    found: dict[str, Callable[[], object]] = {"SciPy": lambda: distance_transform_edt(free)}
    if find_spec("edt"):
        import edt

        found["edt"] = lambda: edt.edt(free, parallel=1)
    if find_spec("cv2"):
        import cv2

        cv2.setNumThreads(1)
        whole = free.astype(np.uint8)
        found["OpenCV"] = lambda: cv2.distanceTransform(whole, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return found


def exact() -> list[Row]:
    """Exact fields clamped at 2 m against others, unclamped and in metres."""
    rows = []
    for side, rounds, target in ((2000, 7, "≤ 40 ms"), (4000, 5, "≤ 160 ms"), (10_000, 1, "≤ 1,200 ms")):
        grid = walls(side)
        ours = timed(partial(distance_field.compute, grid, "exact", 2.0))
        names = others(grid.occupied) if side < 10_000 else {}
        pairs = {name: alternate(ours, timed(other), rounds) for name, other in names.items()}
        least = min((pair.a for pair in pairs.values()), default=ours())
        against = ", ".join(f"{name} × {pair.ratio:.2f}" for name, pair in pairs.items())
        rows.append((f"exact distance field, {side:,}²", f"{least * 1e3:.0f} ms", target, against))
    return [*rows, brushfire(), peak()]


def brushfire() -> Row:
    """Shortest paths over eight neighbours."""
    grid = walls(2000)
    pair = alternate(
        timed(lambda: distance_field.compute(grid, "brushfire", 2.0)),
        timed(lambda: distance_field.compute(grid, "exact", 2.0)),
        5,
    )
    return "brushfire field, 2,000²", f"{pair.a * 1e3:.0f} ms", "", f"{pair.ratio:.1f} × the exact one"


def peak(side: int = 10_000) -> Row:
    """Peak memory of computing a field, beyond the map's own, in fields of two bytes a cell."""
    make = f"from benchmarks.fields import *\ngrid = walls({side})\ndistance_field.compute(walls(50), 'exact', 2.0)"
    added = added_memory(make, "distance_field.compute(grid, 'exact', 2.0)")
    ratio = added * 2**20 / (2 * side * side)
    return f"its peak memory, {side:,}²", f"{ratio:.1f} × the field", "≤ 3 ×", "beyond that of the map"


def cached(side: int = 4000) -> Row:
    """A field from the cache, its digest checked, against hashing the same bytes."""
    grid = walls(side)
    with tempfile.TemporaryDirectory() as folder:
        before, os.environ["MCL_CACHE_DIR"] = os.environ.get("MCL_CACHE_DIR", ""), folder
        field, _ = cached_field(grid, "exact", 2.0)
        data = field.codes.tobytes()
        pair = alternate(
            timed(lambda: cached_field(grid, "exact", 2.0)), timed(lambda: hashlib.sha256(data).digest()), 25
        )
        os.environ["MCL_CACHE_DIR"] = before
    return f"cached field, {side:,}²", f"{pair.a * 1e3:.0f} ms", "≤ 60 ms, ≤ 1.3 ×", f"{pair.ratio:.2f} × its SHA-256"
