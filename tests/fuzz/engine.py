"""The loop: change an input, give it to the target, keep it if it reached new code, note it if it broke a promise."""

from __future__ import annotations

import contextlib
import signal
import time
import traceback
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tests.fuzz import blocks
from tests.fuzz.mutation import mutate
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType

PROMISED_S = 1.0
"""Most processor time that one input may take; they are far smaller than files, which may take ten."""
_RECENT = 0.3  # how often one of the inputs found last is changed, and not any


class Target(NamedTuple):
    """One parser.

    ``run`` gives it bytes and may raise the ``allowed`` errors. ``starts`` are inputs to begin with, ``words`` what may
    stand in them; ``mend`` repairs what no change would get right by chance (checksums). Inputs have at most ``limit``
    bytes.
    """

    name: str
    run: Callable[[bytes], object]
    allowed: tuple[type[Exception], ...]
    starts: Sequence[bytes]
    words: Sequence[bytes] = ()
    mend: Callable[[bytes], bytes] | None = None
    limit: int = 1024


class Find(NamedTuple):
    """An input that broke a promise, and how."""

    data: bytes
    what: str


class HangError(BaseException):
    """An input took more processor time than promised; no handler of exceptions may take it."""


@dataclass(slots=True)
class Result:
    """What came of one target: executions, inputs that reached new code in their order, finds by their place."""

    executions: int = 0
    blocks: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    kept: list[bytes] = field(default_factory=list)
    finds: dict[str, Find] = field(default_factory=dict)


def fuzz(target: Target, corpus: Sequence[bytes], executions: int, seed: int) -> Result:
    """Run what is known once, then so many executions of changed inputs."""
    rng, result, seen = seeded(f"{seed} {target.name}"), Result(), 0
    began = time.process_time()
    with warnings.catch_warnings(), _limited():
        warnings.simplefilter("error")
        for data in (*target.starts, *corpus):
            seen = _execute(target, data, result, seen)
        pool = [*target.starts, *corpus]
        while result.executions < executions:
            parent = rng.choice(pool[-16:]) if rng.random() < _RECENT else rng.choice(pool)
            data = mutate(parent, pool, target.words, rng, target.limit)
            if target.mend is not None and rng.random() < 0.7:
                data = target.mend(data)
            before = seen
            seen = _execute(target, data, result, seen)
            if seen != before:
                pool.append(data)
    result.seconds, result.blocks = time.process_time() - began, seen.bit_count()
    return result


def fewest(target: Target, inputs: Sequence[bytes]) -> list[bytes]:
    """Those inputs, the shortest first, that reach code which the target's starts and the ones before do not."""
    result, seen = Result(), 0
    with _limited():
        for data in (*target.starts, *sorted(set(inputs), key=lambda data: (len(data), data))):
            seen = _execute(target, data, result, seen)
    return [data for data in result.kept if data not in target.starts]


def _execute(target: Target, data: bytes, result: Result, seen: int) -> int:
    """Give one input to the target; all code that was reached so far."""
    blocks.clear()
    began = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, PROMISED_S)
    try:
        target.run(data)
    except target.allowed:
        pass
    except (Exception, HangError) as error:  # noqa: BLE001 - what is looked for
        place = _place(error)
        result.finds.setdefault(place, Find(data, "".join(traceback.format_exception(error, limit=-3))))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    result.executions += 1
    result.slowest = max(result.slowest, time.process_time() - began)
    reached = blocks.reached()
    if reached & ~seen:
        result.kept.append(data)
    return seen | reached


def _place(error: BaseException) -> str:
    """Kind of an error and the line of mcl that it came from, so that one fault is told once."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "mclcli" in Path(f.filename).parts]
    where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "outside mcl"
    return f"{type(error).__name__} at {where}"


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """End an execution that takes too long, by processor time."""

    def hang(number: int, frame: FrameType | None) -> None:
        del number, frame
        raise HangError(f"more than {PROMISED_S:.0f} s")

    before = signal.signal(signal.SIGPROF, hang)
    try:
        yield
    finally:
        signal.signal(signal.SIGPROF, before)
