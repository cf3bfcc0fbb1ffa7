"""Every write that can fail, failing: what stands under the final name is the old file or the whole new one."""

from __future__ import annotations

import contextlib
import errno
import io
import os
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from unittest import mock

from mclcli.io.traces import output
from mclcli.native import machine_code
from tests.battery import content
from tests.battery.bases import base_logs
from tests.battery.harness import WRONG, Case, Verdict
from tests.battery.outcome import unclean
from tests.cli.support import Result, mcl
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

OLD = b"what was there before\n"
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "run": (
        ("run", "x.mcap", "--map", "room.yaml", "--init", content.INIT, "--particles", "300", "-q"),
        ("-o=t.csv", "-o=t.csv.gz", "-o=t.mcap", "--track=p.csv", "--track=p.tum", "--steps=s.csv", "--picture=p.png"),
    ),
    "recover": (("recover", "x.mcap", "-q"), ("-o=good.mcap",)),
    "score": (("score", "x.mcap", "--map", "room.yaml", "--grid", "0.5", "-q"), ("-o=s.csv", "--heatmap=h.png")),
    "dt": (("dt", "room.yaml", "-q"), ("-o=f.npy", "--png=f.png")),
}


def cases(seed: int, share: float) -> list[Case]:
    """The k-th write of every command fails, for every k; and so for the cache's file; and all reach the disk."""
    rng = seeded(f"{seed} writing")
    found = [Case(f"{name}: on the disk before it has its name", partial(check_durable, name)) for name in COMMANDS]
    found.append(Case("cache: on the disk before it has its name", check_durable_cache))
    for name in COMMANDS if share == 1.0 else ("run", "recover"):
        count = int(reference(name)[0])
        numbers = range(1, count + 1)
        for number in numbers if share == 1.0 else sorted(rng.sample(numbers, min(3, count))):
            failure = Failure(number, rng.choice(ERRORS), rng.random())
            found.append(Case(f"{name}: operation {number} of {count} fails", partial(check, name, failure)))
    for number in range(1, 6):
        failure = Failure(number, rng.choice(ERRORS), rng.random())
        found.append(Case(f"cache: operation {number} fails", partial(check_cache, failure)))
    return found


def check(name: str, failure: Failure, folder: Path) -> Verdict:
    """Let one operation fail and look at what is left."""
    _, whole = reference(name)
    for target in whole:
        (folder / target).write_bytes(OLD)
    with failing(failure) as failed:
        result = _run(name, folder)
    problems = unclean(result)
    if not failed.happened:
        return Verdict([(WRONG, "no operation failed")], {})
    if result.code != 1 or len(result.err.splitlines()) != 1 or not result.err.startswith("mcl: error: "):
        problems.append((WRONG, f"ended with {result.code}: {result.err}"))
    problems += left_behind(folder, whole)
    kept = sum((folder / target).read_bytes() != OLD for target in whole if (folder / target).exists())
    return Verdict(problems, {"failures": 1, "files already whole": kept})


def left_behind(folder: Path, whole: dict[str, bytes], *, parts: bool = False) -> list[tuple[str, str]]:
    """Files that are neither the old nor the whole new one, are gone, or should not be there; ``parts`` may be."""
    problems = [(WRONG, f"{name} is gone") for name in whole if not (folder / name).exists()]
    for path in sorted(folder.iterdir()):
        if path.name in whole:
            if path.read_bytes() not in {OLD, whole[path.name]}:
                problems.append((WRONG, f"{path.name} is broken"))
        elif path.name not in {"x.mcap", "room.yaml", "room.pgm"} and not (parts and path.name.endswith(".part")):
            problems.append((WRONG, f"{path.name} was left behind"))
    return problems


def check_cache(failure: Failure, folder: Path) -> Verdict:
    """A field that cannot be kept costs a warning."""
    put_inputs(folder)
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(folder / "cache")}), failing(failure):
        result = mcl("dt", folder / "room.yaml", "--json")
        again = mcl("dt", folder / "room.yaml", "--json")
    problems = unclean(result) + unclean(again)
    if (result.code, again.code) != (0, 0):
        problems.append((WRONG, f"ended with {result.code}, then {again.code}"))
    if [path for path in folder.rglob("*") if path.name.startswith(".field-")]:
        problems.append((WRONG, "a temporary file was left behind"))
    return Verdict(problems, {"warnings": result.err.count("cannot keep")})


def check_durable(name: str, folder: Path) -> Verdict:
    """What a command makes grows under another name, and is on the disk as a whole when it gets its own."""
    with synced() as moves:
        result = _run(name, folder)
    problems = unclean(result)
    for target in reference(name)[1]:
        problems += _not_durable(folder / target, moves)
    return Verdict(problems, {"files synced": len(moves)})


def check_durable_cache(folder: Path) -> Verdict:
    """The same of a field and of machine code."""
    put_inputs(folder)
    kept = folder / "cache"
    kernels = kept / "kernels" / "x.kernels"
    with mock.patch.dict(os.environ, {"MCL_CACHE_DIR": str(kept)}), synced() as moves:
        result = mcl("dt", folder / "room.yaml", "--json")
        machine_code.write(kernels, [])
    fields = list(kept.rglob("*.field"))
    problems = unclean(result) + [problem for path in (*fields, kernels) for problem in _not_durable(path, moves)]
    if not fields:
        problems.append((WRONG, "no field was kept"))
    return Verdict(problems, {"files synced": len(moves)})


class Move(NamedTuple):
    """A file that got its name: its size then, and the size up to which it was on the disk."""

    size: int
    synced: int


@contextlib.contextmanager
def synced() -> Iterator[dict[str, Move]]:
    """Files by the path that they are moved to."""
    sizes: dict[int, int] = {}
    moves: dict[str, Move] = {}
    sync = os.fsync

    def fsync(handle: int) -> None:
        sync(handle)
        status = os.fstat(handle)
        sizes[status.st_ino] = status.st_size

    def moving(function: Callable[..., None]) -> Callable[..., None]:
        def move(source: Any, target: Any, **options: Any) -> None:
            status = os.stat(source, dir_fd=options.get("src_dir_fd"))
            function(source, target, **options)
            folder = options.get("dst_dir_fd")
            place = target if folder is None else Path(f"/proc/self/fd/{folder}").readlink() / target
            moves[os.path.realpath(place)] = Move(status.st_size, sizes.get(status.st_ino, -1))

        return move

    with contextlib.ExitStack() as patches:
        patches.enter_context(mock.patch.object(os, "fsync", fsync))
        for name in ("replace", "rename", "link"):
            patches.enter_context(mock.patch.object(os, name, moving(getattr(os, name))))
        yield moves


def _not_durable(path: Path, moves: dict[str, Move]) -> list[tuple[str, str]]:
    move = moves.get(os.path.realpath(path))
    if move is None:
        return [(WRONG, f"{path.name} grew under its final name")]
    return [(WRONG, f"{path.name} got its name before it was on the disk")] if move.size != move.synced else []


ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG)


class Failure(NamedTuple):
    """Which operation fails, with which error, and which share of its bytes is written before."""

    number: int
    error: int
    share: float


NEVER = Failure(1 << 30, errno.EIO, 0.0)


class Countdown:
    """Operations until one fails."""

    def __init__(self, failure: Failure) -> None:
        self.done, self.failure = 0, failure

    @property
    def happened(self) -> bool:
        """Whether it has failed."""
        return self.done >= self.failure.number

    def __call__(self) -> None:
        """One operation."""
        self.done += 1
        if self.done == self.failure.number:
            raise OSError(self.failure.error, os.strerror(self.failure.error))


class _Raw(io.FileIO):
    """A file whose writes are counted."""

    def __init__(self, handle: int, count: Countdown) -> None:
        super().__init__(handle, "wb")
        self._count = count

    def write(self, data: Any, /) -> int:
        try:
            self._count()
        except OSError:
            super().write(memoryview(data)[: int(self._count.failure.share * len(data))])
            raise
        return super().write(data) or 0


@contextlib.contextmanager
def failing(failure: Failure) -> Iterator[Countdown]:
    """Let one operation fail: opening, writing, syncing and moving of outputs and of the cache."""
    count = Countdown(failure)

    def counted(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **options: Any) -> Any:
            count()
            return function(*args, **options)

        return call

    def opened(handle: int, mode: str, buffering: int = 1 << 16) -> io.BufferedWriter:
        assert mode == "wb"
        return io.BufferedWriter(_Raw(handle, count), buffering)

    with (
        mock.patch.object(output, "open", opened, create=True),
        mock.patch.object(os, "fdopen", opened),
        mock.patch.object(os, "fsync", counted(os.fsync)),
        mock.patch.object(os, "replace", counted(os.replace)),
        mock.patch.object(os, "link", counted(os.link)),
    ):
        yield count


@cache
def reference(name: str) -> tuple[int, dict[str, bytes]]:
    """Operations of an undisturbed run, and the files that it makes."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        _run(name, Path(folder))  # the cache is warm from here on
        with failing(NEVER) as count:
            result = _run(name, Path(folder))
        assert result.code == 0, result.err
        made = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
    return count.done, {
        target: data for target, data in made.items() if target not in {"x.mcap", "room.yaml", "room.pgm"}
    }


def put_inputs(folder: Path) -> None:
    """A log and a map."""
    (folder / "x.mcap").write_bytes(base_logs()[0].data)
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)


def words_of(name: str) -> list[str]:
    """Arguments of a command with all its outputs, for a process in their folder."""
    words, targets = COMMANDS[name]
    return [*words, *(part for target in targets for part in target.split("=", 1))]


def _run(name: str, folder: Path) -> Result:
    put_inputs(folder)
    before = Path.cwd()
    os.chdir(folder)
    try:
        return mcl(*words_of(name))
    finally:
        os.chdir(before)
