"""Where results go: files that appear whole or not at all, standard output, devices and pipes."""

from __future__ import annotations

import os
import secrets
import stat
import sys
import zlib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, final

from mclcli.errors import InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType
    from typing import Self


def open_output(
    target: str | Path,
    *,
    binary: bool,
    inputs: Sequence[Path] = (),
) -> Output:
    """Check a target and return the ``Output`` to use as a context manager; nothing is created before it is entered.

    Parameters
    ----------
    target
        A path, or ``-`` for standard output. Text to a name ending in ``.gz`` is compressed (no clock, no name inside).
    binary
        Whether bytes will be written, else text (UTF-8, newlines as given).
    inputs
        Files, or folders of files, that are being read: none of them may be the target.

    Raises
    ------
    UsageError
        If the folder is missing, the target is a folder, or it is one of the inputs.

    """
    name = str(target)
    found = _status(name)
    if found is not None:
        _refuse_inputs(name, found, inputs)
    if name != "-" and not _is_direct(name, found):
        _check_regular(name, found)
    return Output(name, gz=not binary and name.endswith(".gz"), direct=_is_direct(name, found))


@final
class Output:
    """One open target; made by ``open_output``.

    Takes ``str`` or ``bytes``. A regular file grows beside its target as ``NAME.XXXXXXXX.part`` and is moved into place
    when the block ends without an exception; with one it is removed, unless that is a KeyboardInterrupt or SystemExit
    after ``allow_part``. Anything else is written directly. ``kept`` is the path under which a regular file ended up,
    None before and if it was removed.

    Writing raises InputError if the system refuses; BrokenPipeError passes through untouched.
    """

    __slots__ = ("_direct", "_file", "_gzip", "_keep_part", "_name", "_temporary", "kept")

    def __init__(self, name: str, *, gz: bool, direct: bool) -> None:
        self._name = name
        self._direct = direct
        self._keep_part = False
        self._gzip = zlib.compressobj(6, zlib.DEFLATED, 31) if gz else None  # 31: gzip header with time 0, no name
        self._file: BinaryIO | None = None
        self._temporary: Path | None = None
        self.kept: Path | None = None

    def __enter__(self) -> Self:
        if self._name == "-":
            self._file = _stdout()
            return self
        try:
            if self._direct:
                self._file = Path(self._name).open("wb")
            else:
                self._open_temporary()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise self._failure(error) from error
        except BaseException:  # an interrupt once the file is there
            self._discard()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.keep(as_part=False)
        elif self._keep_part and issubclass(kind, KeyboardInterrupt | SystemExit):
            self.keep(as_part=True)
        else:
            self._discard()

    def write(self, data: str | bytes) -> int:
        """Append text or bytes, all of it; returns how many bytes were taken."""
        raw = data.encode() if isinstance(data, str) else data
        self._put(self._gzip.compress(raw) if self._gzip else raw)
        return len(raw)

    def flush(self) -> None:
        """Hand everything written so far to the system."""
        try:
            self._opened().flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise self._failure(error) from error

    def allow_part(self) -> None:
        """Let an interrupt keep the file as ``NAME.part``: what was written is complete in its format.

        Where that name is taken it is ``NAME.1.part``, and so on: no file of the user's is ever replaced by half a one.
        """
        self._keep_part = True

    def keep(self, *, as_part: bool) -> Path | None:
        """Finish now: the file appears under its name, or as ``NAME.part``. Its path; None if written directly.

        The end of the block does this by itself; later calls change nothing.
        """
        if self._file is None:
            return self.kept
        try:
            if self._gzip:
                self._put(self._gzip.flush())
            self.flush()
            if self._temporary is not None:
                self._move(self._temporary, as_part=as_part)
        except BaseException:
            self._discard()
            raise
        self._close()
        return self.kept

    def _put(self, raw: bytes) -> None:
        try:
            self._opened().write(raw)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise self._failure(error) from error

    def _opened(self) -> BinaryIO:
        if self._file is None:
            raise ValueError("the output is closed")
        return self._file

    def _open_temporary(self) -> None:
        final = Path(self._name).resolve()
        self._temporary = final.with_name(f"{_shortened(final.name)}.{secrets.token_hex(4)}.part")
        # 0666 with O_EXCL: the umask decides the mode, as for a plain open(), and nobody's file is taken over.
        handle = os.open(self._temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._file = open(handle, "wb", buffering=1 << 16)  # noqa: PTH123, SIM115 - closed by _close
        if final.exists():
            self._temporary.chmod(stat.S_IMODE(final.stat().st_mode))

    def _move(self, temporary: Path, *, as_part: bool) -> None:
        final = Path(self._name).resolve()
        try:
            os.fsync(self._opened().fileno())
            self._close()
            self.kept = _move_to_part(temporary, final) if as_part else temporary.replace(final)
        except OSError as error:
            raise self._failure(error) from error
        self._temporary = None

    def _failure(self, error: OSError) -> InputError:
        where = "standard output" if self._name == "-" else self._name
        regular = self._temporary is not None
        self._discard()
        outcome = "nothing was kept" if regular else "what was written is incomplete"
        return InputError(f"{where}: cannot write: {error.strerror or error}; {outcome}")

    def _discard(self) -> None:
        """Leave no trace of a regular file; push whole rows out of a direct one."""
        self._close()
        self.kept = None
        if self._temporary is not None:
            with suppress(OSError):
                self._temporary.unlink()
            self._temporary = None

    def _close(self) -> None:
        file, self._file = self._file, None
        with suppress(OSError, ValueError):  # everything that matters was flushed before
            if file is not None:
                file.flush() if self._name == "-" else file.close()


def _move_to_part(temporary: Path, final: Path) -> Path:
    """Move a file to ``NAME.part``, or to a name with a number where that is taken, and return its path."""
    number, path = 0, final.with_name(f"{_shortened(final.name)}.part")
    while True:
        try:
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))  # taken, without a race
            break
        except FileExistsError:
            number += 1
            path = final.with_name(f"{_shortened(final.name)}.{number}.part")
    try:
        return temporary.replace(path)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _shortened(name: str) -> str:
    """Leave room for an ending within the 255 bytes of a name."""
    raw = os.fsencode(name)
    return name if len(raw) <= 235 else os.fsdecode(raw[:200])


def _status(name: str) -> os.stat_result | None:
    """What stands at the target now, or None."""
    try:
        return os.fstat(_stdout().fileno()) if name == "-" else Path(name).stat()
    except (OSError, ValueError):
        return None


def _stdout() -> BinaryIO:
    # Python sets sys.stdout to None where the shell closed it (``>&-``).
    if sys.stdout is None or sys.stdout.closed:
        raise InputError("standard output: cannot write: it is closed; name a file with -o")
    sys.stdout.flush()
    return sys.stdout.buffer


def _is_direct(name: str, found: os.stat_result | None) -> bool:
    """Whether a target is written directly: standard output, devices, pipes, and open descriptors by name."""
    by_descriptor = name in {"-", "/dev/stdout", "/dev/stderr"} or name.startswith(("/dev/fd/", "/proc/"))
    return by_descriptor or (found is not None and not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode))


def _refuse_inputs(name: str, found: os.stat_result, inputs: Sequence[Path]) -> None:
    if not stat.S_ISREG(found.st_mode):
        return
    for source in inputs:
        for path in (source, *(source.iterdir() if source.is_dir() else ())):
            status = os.fstat(0) if str(path) == "-" else _status(str(path))
            if status is not None and os.path.samestat(found, status):
                raise UsageError(f"{name}: the output is one of the inputs ({path}); choose another name")


def _check_regular(name: str, found: os.stat_result | None) -> None:
    if not name:
        raise UsageError("the output's name is empty; write - for standard output")
    if found is not None and stat.S_ISDIR(found.st_mode):
        raise UsageError(f"{name}: is a folder; name a file in it")
    try:
        folder = Path(name).resolve().parent
    except (OSError, RuntimeError, ValueError) as error:
        raise UsageError(f"{name}: not a usable name for an output: {error}; choose another name") from error
    if not folder.is_dir():
        raise UsageError(f"{name}: folder {folder} does not exist; create it first")
    if found is not None and not os.access(name, os.W_OK):
        raise InputError(f"{name}: cannot write: Permission denied; make it writable or choose another name")
