"""What the user sees on stderr: warnings, remarks, progress; and where the cache is."""

from __future__ import annotations

import logging
import os
import sys
import time
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, TypeVar

import click

from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from rich.console import Console

_LINE = 1000
_REDRAW_S = 0.1

Item = TypeVar("Item")


def set_up(*, verbosity: int, color: str) -> None:
    """Print the library's log records as lines ``mcl: warning: …``; verbosity −1 hides mere information."""
    logger = logging.getLogger("mclcli")
    logger.handlers = [_Lines()]
    logger.setLevel({-1: logging.WARNING, 0: logging.INFO}.get(verbosity, logging.DEBUG))
    if color == "always":
        os.environ["FORCE_COLOR"] = "1"
        os.environ.pop("NO_COLOR", None)
    elif color == "never":
        os.environ["NO_COLOR"] = "1"


class _Lines(logging.Handler):
    """Writes each record as one clean line."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record to stderr; an information without its level."""
        kind = record.levelname.lower() if record.levelno >= logging.WARNING else ""
        click.echo(line(kind, clean(record.getMessage(), _LINE)), err=True, color=in_colour() or None)


def line(kind: str, text: str) -> str:
    """``mcl: error: text``, the kind in colour where colours are on."""
    if not kind:
        return f"mcl: {text}"
    if not in_colour():
        return f"mcl: {kind}: {text}"
    return f"mcl: {click.style(f'{kind}:', fg={'error': 'red'}.get(kind, 'yellow'), bold=True)} {text}"


def in_colour() -> bool:
    """Whether stderr takes colours: --color, else NO_COLOR and FORCE_COLOR, else a terminal that is not dumb."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM", "") != "dumb"


def remark(message: str) -> None:
    """One line for the user, hidden by -q."""
    logging.getLogger("mclcli").info("%s", message)


def warn(message: str) -> None:
    """One warning for the user, which -q does not hide: it changes what a result means."""
    logging.getLogger("mclcli").warning("%s", message)


def tell_kept(path: Path | None) -> None:
    """Say where the output of an interrupted command is, if it was kept."""
    if path is not None:
        warn(f"interrupted: what was written so far is kept as {path.name}")


def detail(message: str) -> None:
    """One line for the user who asked for more, with -v."""
    logging.getLogger("mclcli").debug("%s", message)


def tell_cost(seconds: float) -> None:
    """With -v: what a command took, in time and in memory at its peak."""
    try:
        import resource
    except ImportError:  # of POSIX alone
        detail(f"took {seconds:.2f} s")
        return
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    megabytes = peak / (1e6 if sys.platform == "darwin" else 1e3)
    detail(f"took {seconds:.2f} s and at most {megabytes:.0f} MB of memory")


def block(text: str) -> None:
    """Several lines for the user as they are, hidden by -q."""
    if logging.getLogger("mclcli").isEnabledFor(logging.INFO):
        click.echo(text, err=True)


def error(message: str) -> None:
    """One line that says why the exit code is not 0, where the command has finished all the same."""
    logging.getLogger("mclcli").error("%s", message)


@contextmanager
def each_once() -> Iterator[None]:
    """For a command that does the same several times: what was said already is not said again."""
    said: set[str] = set()

    def new(record: logging.LogRecord) -> bool:
        message = record.getMessage()
        known = message in said
        said.add(message)
        return not known

    logger = logging.getLogger("mclcli")
    logger.addFilter(new)
    try:
        yield
    finally:
        logger.removeFilter(new)


def is_live() -> bool:
    """Whether progress can be shown: stderr is a terminal and -q was not given."""
    return sys.stderr.isatty() and logging.getLogger("mclcli").isEnabledFor(logging.INFO)


def use_cache(folder: Path) -> None:
    """Keep the cache in a folder of the user's choice, for this process and its children."""
    os.environ["MCL_CACHE_DIR"] = str(folder)


def stderr() -> Console:
    """A rich console on stderr that treats text as text."""
    from rich.console import Console

    return Console(stderr=True, markup=False, highlight=False, emoji=False)


@contextmanager
def live_line() -> Iterator[Callable[[Sequence[str]], None]]:
    """A line on stderr that is drawn again and again and goes in the end; only where ``is_live``.

    It is called with forms of one text, the longest first, and shows the first that fits the screen, uncut.
    """
    from rich.live import Live
    from rich.text import Text

    screen = stderr()
    with Live(console=screen, transient=True, auto_refresh=False) as live:

        def draw(forms: Sequence[str]) -> None:
            live.update(Text(fitting(forms, screen.width), no_wrap=True, overflow="crop"), refresh=True)

        yield draw


def counting(items: Iterable[Item], what: str, after_s: float = 1.0) -> Iterator[Item]:
    """The same items; on a terminal their number is shown beside ``what`` is being done, once that takes a while."""
    if not is_live():
        yield from items
        return
    began = drawn = time.perf_counter()
    with ExitStack() as stack:
        draw = None
        for number, item in enumerate(items, 1):
            yield item
            now = time.perf_counter()
            if now - began < after_s or (draw and now - drawn < _REDRAW_S):
                continue
            draw, drawn = draw or stack.enter_context(live_line()), now
            told = f"{number:,} messages".replace(",", " ")
            draw((f"{what}: {told} in {now - began:.0f} s", told))


@contextmanager
def waiting(what: str, *, long: bool) -> Iterator[None]:
    """On a terminal, say what is being done while it is, if it takes ``long``."""
    if not (long and is_live()):
        yield
        return
    with live_line() as draw:
        draw((what,))
        yield


def look(messages: Iterator[Item]) -> Iterator[Item]:
    """Messages of the first look through a log, counted on the terminal."""
    return counting(messages, "looking through the log")


def fitting(forms: Sequence[str], width: int) -> str:
    """The first form that is not wider than the screen, else the last."""
    from rich.cells import cell_len

    return next((form for form in forms if cell_len(form) <= width), forms[-1])
