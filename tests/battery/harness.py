"""Running cases in a worker process: what came of each, its time and its memory."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import re
import resource
import shutil
import signal
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tests import processes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from multiprocessing.connection import Connection

PROMISED_S = 10.0
"""Most processor time that a case may take."""
PATIENCE_S = 3 * PROMISED_S
"""Processor time after which a worker is ended. However busy the machine is, a case takes the same."""
PROMISED_MIB = 512.0
"""Most memory above what the worker had before the case."""
CEILING_MIB = 8 * PROMISED_MIB
"""Memory that the system gives a worker beyond its own; more fails, so that the machine survives a bad case."""

LOSS, ALTERATION, WRONG, CRASH, HANG, LARGE = "silent loss", "silent alteration", "wrong", "crash", "hang", "memory"


class Verdict(NamedTuple):
    """What a case found: problems as (kind, what), and figures to be added up over the class."""

    problems: list[tuple[str, str]]
    figures: dict[str, int]


class Case(NamedTuple):
    """One input with its check, which gets a folder to work in; ``prepare`` fills it, unmeasured."""

    name: str
    check: Callable[[Path], Verdict]
    prepare: Callable[[Path], object] = lambda _: None


class Ended(NamedTuple):
    """How a case ended: verdict, processor time [s], memory above the worker's own [MiB]."""

    verdict: Verdict
    seconds: float
    mib: float


@dataclass(slots=True)
class Tally:
    """One class of cases, added up."""

    cases: int = 0
    seconds: float = 0.0
    mib: float = 0.0
    slowest: str = ""
    largest: str = ""
    figures: Counter[str] = field(default_factory=Counter)
    problems: list[tuple[str, str, str]] = field(default_factory=list)
    """(case, kind, what)"""

    def add(self, case: Case, ended: Ended) -> None:
        """Take one case in."""
        self.cases += 1
        if ended.seconds > self.seconds:
            self.seconds, self.slowest = ended.seconds, case.name
        if ended.mib > self.mib:
            self.mib, self.largest = ended.mib, case.name
        self.figures.update(ended.verdict.figures)
        problems = list(ended.verdict.problems)
        if ended.seconds > PROMISED_S:
            problems.append((HANG, f"took {ended.seconds:.1f} s"))
        if ended.mib > PROMISED_MIB:
            problems.append((LARGE, f"took {ended.mib:.0f} MiB"))
        self.problems += [(case.name, kind, what) for kind, what in problems]

    def count(self, kind: str) -> int:
        """Cases with a problem of this kind."""
        return len({name for name, found, _ in self.problems if found == kind})


def run_cases(cases: Sequence[Case], tell: Callable[[Case, Ended], None] = lambda *_: None) -> Tally:
    """Run all cases, one after the other, in as many workers as it takes."""
    total, worker = Tally(), _Worker(cases)
    try:
        for number, case in enumerate(cases):
            ended = worker.run(number)
            if ended.seconds > PROMISED_S:  # a first use compiles; what is slow is slow again
                ended = worker.run(number)
            total.add(case, ended)
            tell(case, ended)
    finally:
        worker.stop()
    return total


class _Worker:
    """A forked process that runs cases by number, and is replaced when it dies or hangs."""

    def __init__(self, cases: Sequence[Case]) -> None:
        self._cases = cases
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None

    def run(self, number: int) -> Ended:
        """Run one case."""
        pipe = self._pipe or self._start()
        pipe.send(number)
        why = self._wait(pipe)
        if why:
            self.stop()
            return Ended(Verdict([(HANG, why)], {}), 0.0, 0.0)
        try:
            ended: Ended = pipe.recv()
        except EOFError:
            code = self.stop()
            return Ended(Verdict([(CRASH, f"the process died with {code}")], {}), 0.0, 0.0)
        return ended

    def _wait(self, pipe: Connection) -> str:
        """Wait for an answer, or until the worker hangs: in what way, else ''."""
        group = self._process.pid if self._process and self._process.pid else 0
        watch = processes.Watch(lambda: processes.usage_of_group(group), PATIENCE_S)
        why = ""
        while not why and not pipe.poll(processes.LOOK_S):
            why = watch.look()
        return why

    def stop(self) -> int | None:
        """End the worker; how it ended."""
        process, self._process = self._process, None
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if process is None:
            return None
        process.join(0.5)
        if process.is_alive() and process.pid:
            os.killpg(process.pid, signal.SIGKILL)
            process.join()
        return process.exitcode

    def _start(self) -> Connection:
        context = multiprocessing.get_context("fork")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(self._cases, theirs), daemon=False)
        self._process.start()
        theirs.close()
        self._pipe.recv()
        return self._pipe


def _serve(cases: Sequence[Case], pipe: Connection) -> None:
    """Run the cases asked for until the pipe closes."""
    os.setpgid(0, 0)  # with all that its cases start
    limit = (_kibibytes("VmData") << 10) + int(CEILING_MIB * 2**20)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    with contextlib.suppress(EOFError, KeyboardInterrupt):
        pipe.send(None)  # ready, with a group of its own
        while True:
            pipe.send(_measured(cases[pipe.recv()]))


def _measured(case: Case) -> Ended:
    folder = Path(tempfile.mkdtemp(prefix="mcl-battery-"))
    case.prepare(folder)
    before = _reset_peak()
    began = time.process_time()
    try:
        verdict = case.check(folder)
    except Exception:  # noqa: BLE001 - an exception that escapes from mcl is what is looked for
        verdict = Verdict([(CRASH, traceback.format_exc(limit=-4))], {})
    seconds, mib = time.process_time() - began, (_kibibytes("VmHWM") - before) / 1024
    shutil.rmtree(folder, ignore_errors=True)
    return Ended(verdict, seconds, mib)


def _reset_peak() -> int:
    """Forget the largest memory so far, where the system can; memory now [KiB]."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _kibibytes("VmRSS")


def _kibibytes(what: str) -> int:
    with contextlib.suppress(OSError):
        found = re.search(rf"^{what}:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
        return int(found[1]) if found else 0
    return 0


@contextlib.contextmanager
def quiet_cache() -> Iterator[None]:
    """Keep the cache of this run in a folder of its own."""
    before = os.environ.get("MCL_CACHE_DIR")
    with tempfile.TemporaryDirectory(prefix="mcl-battery-cache-") as folder:
        os.environ["MCL_CACHE_DIR"] = folder
        yield
    if before is None:
        del os.environ["MCL_CACHE_DIR"]
    else:
        os.environ["MCL_CACHE_DIR"] = before


def preload() -> None:
    """Import what the cases need, so that every worker has it from the start."""
    import importlib
    import pkgutil

    import mclcli

    for found in pkgutil.walk_packages(mclcli.__path__, "mclcli."):
        if ".kernels" not in found.name:
            importlib.import_module(found.name)
