"""What must be right before anything else is imported: the standard streams and the signals that end a process."""

from __future__ import annotations

import os
import signal
import sys
from functools import partial
from typing import TYPE_CHECKING, NoReturn, TextIO, cast, final

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType


def secure_streams() -> None:
    """Keep descriptors 0 to 2 from being given to files, and commands from failing because nobody reads stderr."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # the shell closed it (``2>&-``): the next file opened would get its number, and our messages
            _occupy()
    sys.stderr = cast("TextIO", Messages(sys.stderr or open(os.devnull, "w", encoding="utf-8")))  # noqa: SIM115, PTH123


def _occupy() -> None:
    """Open a folder, as the lowest descriptor that is free: nobody can write there or read, not even by name."""
    try:
        os.open("/", os.O_RDONLY)
    except OSError:  # Windows
        os.open(os.devnull, os.O_RDONLY)


@final
class Messages:
    """Standard error that ends no command: what it does not take is lost, for want of a place to say so."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.encoding = stream.encoding
        self.errors = stream.errors

    def write(self, text: str) -> int:
        """Write what can be written."""
        try:
            return self._stream.write(text)
        except OSError:
            self._give_up()
            return len(text)

    def flush(self) -> None:
        """Hand it to the system."""
        try:
            self._stream.flush()
        except OSError:
            self._give_up()

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Its descriptor."""
        return self._stream.fileno()

    def _give_up(self) -> None:
        """Send the rest where it does no harm, or Python would try again at its end and exit with 120."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


def end_on_signals() -> None:
    """Let signals end the process at once and in silence: nothing is open yet, and imports may swallow exceptions."""
    _handle(_end, _end)


@final
class Received:
    """The last signal that came, 0 for none: NumPy's import makes an ImportError of what a signal raises."""

    number = 0


def unwind_on_signals() -> Received:
    """Let signals unwind like exceptions from now on, so that outputs are finished or removed; says which came."""
    received = Received()
    _handle(partial(_interrupt, received), partial(_unwind, received))
    return received


def _handle(interrupt: Callable[..., object], terminate: Callable[..., object]) -> None:
    """Set handlers; what the parent process ignores, as nohup does with SIGHUP, stays ignored."""
    for name, handler in (("SIGINT", interrupt), ("SIGTERM", terminate), ("SIGHUP", terminate)):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> NoReturn:
    del frame
    os._exit(128 + number)


def _interrupt(received: Received, number: int, frame: FrameType | None) -> None:
    received.number = number
    signal.default_int_handler(number, frame)


def _unwind(received: Received, number: int, frame: FrameType | None) -> NoReturn:
    del frame
    received.number = number
    for name in ("SIGTERM", "SIGHUP"):  # a terminal that closes sends several: the first is being obeyed
        if name in signal.Signals.__members__:  # not on Windows
            signal.signal(signal.Signals[name], signal.SIG_IGN)
    sys.exit(128 + number)
