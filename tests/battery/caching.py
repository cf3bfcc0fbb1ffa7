"""Cache files altered anywhere, and many processes at once: the field is right, whatever happens to its file."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from functools import cache, partial
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
from llvmlite.binding.targets import FeatureMap

from mclcli.cache import cache_root
from mclcli.io.maps.field_cache import cached_field, field_path
from mclcli.io.maps.pyramid_cache import cached_pyramid, pyramid_path
from mclcli.native import machine_code
from mclcli.native.array_gate import Argument
from mclcli.native.backend import kernel_folder
from mclcli.native.machine_code import Function
from mclcli.world import distance_field
from mclcli.world.occupancy import OccupancyGrid
from tests.battery.harness import WRONG, Case, Verdict
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mclcli.world.distance_field import DistanceField

REACH = 1.0
PROCESSES = 8


def cases(seed: int, share: float) -> list[Case]:
    """Every byte of the header, bits anywhere, cuts, other users and processors, and processes side by side."""
    step = max(1, round(0.2 / share))
    found = [Case(f"header byte {at}", partial(check, at, at)) for at in range(0, 400, step)]
    rng = seeded(f"{seed} cache")
    found += [Case(f"bit {n}", partial(check, None, rng.random())) for n in range(round(300 * share))]
    found += [Case(f"cut {n}", partial(check_cut, rng.random())) for n in range(round(60 * share))]
    found += [Case(f"pyramid, bit {n}", partial(check_pyramid, rng.random())) for n in range(max(2, round(60 * share)))]
    found += [
        Case(f"kernels, {what} {n}", partial(check_kernels, what, rng.random()))
        for what, count in (("byte of the head", 200), ("bit", 300), ("cut", 60))
        for n in range(max(4, round(count * share)))
    ]
    found += [Case(f"{what} of another user", partial(check_foreign, make)) for what, make in KEPT.items()]
    found += [Case(f"another processor: {what}", partial(check_processor, what)) for what in PROCESSORS]
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


def check_pyramid(place: float, folder: Path) -> Verdict:
    """Alter one bit of a pyramid's file."""
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder)}):
        right, _ = cached_pyramid(truth())
        path = pyramid_path(truth())
        _flip(path, int(place * path.stat().st_size))
        found, hit = cached_pyramid(truth())
    problems = [(WRONG, "an altered pyramid was taken")] if hit else []
    if not np.array_equal(found.pool, right.pool):
        problems.append((WRONG, "a wrong pyramid"))
    return Verdict(problems, {})


def check_kernels(what: str, place: float, folder: Path) -> Verdict:
    """Alter or cut a file of machine code: none of it may be believed."""
    path = folder / "kernels-x" / "k.kernels"  # a folder of the user, and not /tmp, must be above its own
    machine_code.write(path, FUNCTIONS)
    whole = path.read_bytes()
    if machine_code.read(path) != list(FUNCTIONS):
        return Verdict([(WRONG, "machine code is not read as it was written")], {})
    head = whole.rindex(b"\n", 0, len(whole) - sum(len(f.code + f.gate) for f in FUNCTIONS))
    if what == "cut":
        path.write_bytes(whole[: int(place * len(whole))])
    else:
        _flip(path, int(place * (head if what != "bit" else len(whole))))
    believed = machine_code.read(path)
    problems = [(WRONG, "altered machine code was taken")] if believed not in (None, list(FUNCTIONS)) else []
    return Verdict(problems, {})


def _flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 4
    path.write_bytes(data)


def check_foreign(make: Callable[[], bool], folder: Path) -> Verdict:
    """What another user put there is made anew."""
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder)}):
        if make() or not make():
            return Verdict([(WRONG, "not kept, or there already")], {})
        other = os.getuid() + 1
        with mock.patch.object(os, "getuid", return_value=other), mock.patch.object(os, "geteuid", return_value=other):
            taken = make()
    return Verdict([(WRONG, "another user's file was taken")] if taken else [], {})


def _kernels_hit() -> bool:
    path = cache_root() / "kernels-x" / "k.kernels"
    if machine_code.read(path) is not None:
        return True
    with contextlib.suppress(OSError):
        machine_code.write(path, FUNCTIONS)
    return False


def check_processor(what: str, folder: Path) -> Verdict:
    """Machine code of one processor is not looked for on another."""
    import llvmlite.binding as llvm

    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder)}):
        here = kernel_folder()
        again = kernel_folder()
        with mock.patch.object(llvm, what, PROCESSORS[what]):
            there = kernel_folder()
    problems = [(WRONG, f"the same folder {here.name}")] if here == there else []
    return Verdict(problems + ([(WRONG, "another folder each time")] if here != again else []), {})


KEPT: dict[str, Callable[[], bool]] = {
    "a field": lambda: cached_field(grid(), "exact", REACH)[1],
    "a pyramid": lambda: cached_pyramid(truth())[1],
    "kernels": _kernels_hit,
}
PROCESSORS: dict[str, Callable[[], Any]] = {
    "get_host_cpu_name": lambda: "another",
    "get_host_cpu_features": FeatureMap,
}
FUNCTIONS = (
    Function("first", "symbol_1", (Argument("float64"), Argument("<f8", 2, writable=True)), b"\x90" * 40, b"\xc3" * 20),
    Function("second", "symbol_2", (Argument("int64"),), bytes(range(30)), b"gate"),
)


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
