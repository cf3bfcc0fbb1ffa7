"""Timing two things in alternation, so that a machine whose speed drifts does not decide between them."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


Row = tuple[str, str, str, str]
"""What, measured, its target, and against what."""


@dataclass(frozen=True)
class Pair:
    """Least seconds of A and of B, and the median of their ratio A/B, round by round."""

    a: float
    b: float
    ratio: float


def alternate(a: Callable[[], float], b: Callable[[], float], rounds: int) -> Pair:
    """Run A and B in turn; each returns its own seconds. The first round warms up and does not count."""
    times = [(a(), b()) for _ in range(rounds + 1)][1:]
    return Pair(
        min(x for x, _ in times),
        min(y for _, y in times),
        statistics.median(x / y for x, y in times),
    )


def timed(
    task: Callable[[], object], repeat: int = 1, clock: Callable[[], float] = time.thread_time
) -> Callable[[], float]:
    """The seconds that one call of a task takes, averaged over ``repeat`` calls.

    By default those that this thread had of a processor: what else runs on the machine counts less.
    """

    def run() -> float:
        began = clock()
        for _ in range(repeat):
            task()
        return (clock() - began) / repeat

    return run


def process(*words: str) -> Callable[[], float]:
    """The seconds of processor time that a whole process takes, its output thrown away."""
    return timed(
        lambda: subprocess.run(words, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL),
        clock=_children,
    )


def _children() -> float:
    """Processor time of the child processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def peak_memory(code: str) -> float:
    """Peak resident memory [MiB] of a Python process that runs ``code``, as Linux counts it since its start."""
    report = f"{code}\nprint(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"
    shown = subprocess.run([sys.executable, "-c", report], check=True, capture_output=True, text=True)
    return float(shown.stdout.split()[-1]) / 2**10


def added_memory(prepare: str, code: str) -> float:
    """Peak resident memory [MiB] while ``code`` runs, beyond what was resident after ``prepare``."""
    status = "next(int(line.split()[1]) for line in open('/proc/self/status') if line.startswith('{}'))"
    reset = f"open('/proc/self/clear_refs', 'w').write('5')\nbefore = {status.format('VmRSS')}"
    script = f"{prepare}\n{reset}\n{code}\nprint({status.format('VmHWM')} - before)"
    shown = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    return float(shown.stdout.split()[-1]) / 2**10


def table(
    rows: Sequence[tuple[str, ...]], head: tuple[str, ...] = ("what", "measured", "against, in the same run")
) -> str:
    """Markdown table."""
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
