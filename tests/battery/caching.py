"""Cache files altered anywhere, and many processes at once: the field is right, whatever happens to its file."""

from __future__ import annotations

import multiprocessing
import os
from functools import cache, partial
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np

from mclcli.io.maps.field_cache import cached_field, field_path
from mclcli.world import distance_field
from mclcli.world.occupancy import OccupancyGrid
from tests.battery.harness import WRONG, Case, Verdict
from tests.io.logs import seeded

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.world.distance_field import DistanceField

REACH = 1.0
PROCESSES = 8


def cases(seed: int, share: float) -> list[Case]:
    """Every byte of the header, bits anywhere, cuts, and processes side by side."""
    step = max(1, round(0.2 / share))
    found = [Case(f"header byte {at}", partial(check, at, at)) for at in range(0, 400, step)]
    rng = seeded(f"{seed} cache")
    found += [Case(f"bit {n}", partial(check, None, rng.random())) for n in range(round(300 * share))]
    found += [Case(f"cut {n}", partial(check_cut, rng.random())) for n in range(round(60 * share))]
    return found + [
        Case(f"{PROCESSES} processes, {n}", partial(check_processes, n)) for n in range(max(1, round(12 * share)))
    ]


@cache
def grid() -> OccupancyGrid:
    """A small map."""
    cells = np.where(np.random.default_rng(5).random((40, 60)) < 0.05, 100, 0).astype(np.int8)
    return OccupancyGrid(cells, 0.05, np.array([1.0, 2.0, 0.0]))


@cache
def truth() -> DistanceField:
    """Its field, computed."""
    return distance_field.compute(grid(), "exact", REACH)


def is_right(field: DistanceField) -> bool:
    """Whether a field is the one computed."""
    return np.array_equal(field.codes, truth().codes) and np.array_equal(field.levels, truth().levels)


def check(byte: int | None, place: float, folder: Path) -> Verdict:
    """Alter one byte of the header in several ways, or one bit anywhere."""
    wrong, hits = 0, 0
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder)}):
        cached_field(grid(), "exact", REACH)
        path = field_path(grid(), "exact", REACH)
        whole = path.read_bytes()
        at = min(byte, len(whole) - 1) if byte is not None else int(place * len(whole))
        for value in (
            (whole[at] ^ 1, whole[at] ^ 0x80, 0, 0xFF, ord(" "), ord("9")) if byte is not None else (whole[at] ^ 4,)
        ):
            path.write_bytes(whole[:at] + bytes([value]) + whole[at + 1 :])
            field, hit = cached_field(grid(), "exact", REACH)
            wrong += not is_right(field)
            hits += hit
    return Verdict([(WRONG, f"{wrong} wrong fields")] if wrong else [], {"altered files still taken, rightly": hits})


def check_cut(share: float, folder: Path) -> Verdict:
    """Cut the file, then lengthen it."""
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder)}):
        cached_field(grid(), "exact", REACH)
        path = field_path(grid(), "exact", REACH)
        whole = path.read_bytes()
        for data in (whole[: int(share * len(whole))], whole + b"\0"):
            path.write_bytes(data)
            if not is_right(cached_field(grid(), "exact", REACH)[0]):
                return Verdict([(WRONG, "a wrong field")], {})
    return Verdict([], {})


def check_processes(number: int, folder: Path) -> Verdict:
    """Processes that write and read the same file, while it is damaged again and again."""
    context = multiprocessing.get_context("fork")
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder)}):
        workers = [context.Process(target=_work, args=(number + n,)) for n in range(PROCESSES)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        codes = [worker.exitcode for worker in workers]
        left = [path.name for path in folder.rglob(".field-*")]
    problems = [(WRONG, f"processes ended with {codes}")] if any(codes) else []
    return Verdict(
        problems + ([(WRONG, f"left behind: {left}")] if left else []), {"reads side by side": 20 * PROCESSES}
    )


def _work(number: int) -> None:
    path = field_path(grid(), "exact", REACH)
    rng = seeded(number)
    for _ in range(20):
        if not is_right(cached_field(grid(), "exact", REACH)[0]):
            os._exit(9)
        if rng.random() < 0.3 and path.exists():
            path.write_bytes(rng.randbytes(100))  # as a bad disk would, in place
    os._exit(0)
