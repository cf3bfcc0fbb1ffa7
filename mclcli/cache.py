"""The folder that keeps what is costly to make again: distance fields and compiled kernels.

Compiled kernels are run, so nothing is taken that another user may have written: every folder and file is opened
without following links, and its owner and mode are asked of the descriptor. Where the user's folder is not safe,
a folder for this process alone takes its place.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import functools
import logging
import os
import secrets
import shutil
import stat
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from mclcli import ownership

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from io import FileIO

_WARNED: set[Path] = set()  # folders and files that were warned of
_NOWHERE = Path(os.devnull)  # where no folder can be made
_BINARY = getattr(os, "O_BINARY", 0)
_UNFOLLOWED = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)


def cache_root() -> Path:
    """Folder of the user's choice: MCL_CACHE_DIR, else the platform's (XDG_CACHE_HOME where that is the custom)."""
    chosen = os.environ.get("MCL_CACHE_DIR")
    if chosen:
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("mcl", appauthor=False))


def folder(name: str) -> Path:
    """Folder of this name in the cache.

    If others may change the user's cache, that is warned of once, and the folder is one of this process, which is
    removed when it ends. Nothing is created otherwise.
    """
    root = cache_root()
    wanted = root / name
    remedy = _remedy(root, wanted)
    if not remedy:
        return wanted
    _warn_once(root, f"cache {root} is not used: {remedy}, or name a folder of your own with --cache-dir")
    return _of_this_process() / name


def open_kept(path: Path) -> FileIO:
    """Open a file within a ``folder`` to read.

    Raises
    ------
    OSError
        If there is none, it is no regular file, or others may write to it or its folders.

    """
    with _entered(path.parent) as entered:
        name = path if entered is None else path.name
        why = ""
        if not stat.S_ISREG(os.stat(name, dir_fd=entered, follow_symlinks=False).st_mode):
            why = "it is no regular file"  # and not opened: that may wait for ever
        else:
            handle = os.open(name, os.O_RDONLY | _BINARY | _UNFOLLOWED, dir_fd=entered)
            file = open(handle, "rb", buffering=0)  # noqa: PTH123, SIM115 - the caller closes it
            status = os.fstat(handle)
            why = ownership.fault(status, handle) if stat.S_ISREG(status.st_mode) else "it is no regular file"
            if not why:
                return file
            file.close()
    _warn_once(path, f"{path} is not used: {why}; it is made anew")
    raise PermissionError(errno.EPERM, why)


def write_whole(path: Path, parts: Iterable[bytes | memoryview]) -> None:
    """Write a file of the user's own (mode 0600) beside its place and move it there: nobody ever sees half of it.

    Raises
    ------
    OSError
        If its folder cannot be made or written, or others may write to it.

    """
    _make(path.parent)
    with _entered(path.parent) as entered:
        temporary = f".new-{secrets.token_hex(8)}"
        new, old = (path.with_name(temporary), path) if entered is None else (Path(temporary), Path(path.name))
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY | _UNFOLLOWED
        handle = os.open(new, flags, 0o600, dir_fd=entered)
        try:
            with os.fdopen(handle, "wb") as file:
                file.writelines(parts)
                file.flush()
                os.fsync(file.fileno())
            os.replace(new, old, src_dir_fd=entered, dst_dir_fd=entered)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(new, dir_fd=entered)
            raise


def cannot_keep(what: str, path: Path, error: OSError) -> None:
    """Warn that something could not be kept, once a cache: what follows will hardly fare better."""
    _warn_once(path.parents[1], f"{path}: cannot keep {what}: {error.strerror}; going on without")


def _warn_once(place: Path, text: str) -> None:
    if place not in _WARNED:
        _WARNED.add(place)
        logging.getLogger("mclcli").warning("%s", text)


def _remedy(root: Path, wanted: Path) -> str:
    """What is wrong with the user's cache and what helps; empty if it may be used."""
    if not root.is_absolute() and not os.environ.get("MCL_CACHE_DIR"):
        return "no home folder is known; set HOME"
    found = ownership.fault_on_the_way(root)
    for place in (root, wanted):
        if found is None:
            try:
                status = place.stat(follow_symlinks=place is root)
            except OSError:  # not there yet, or whoever opens it meets the same error
                continue
            why = "it is a link" if stat.S_ISLNK(status.st_mode) else ownership.fault(status, str(place))
            found = (place, why) if why else None
    if found is None:
        return ""
    place, why = found
    if place in {root, wanted}:
        return f"{place}: {why}; remove it, as its files may be anybody's"
    return f"{place}: {why}; correct that (chmod go-w, chown) and remove {root}, as its files may be anybody's"


@functools.cache
def _of_this_process() -> Path:
    """A new folder that is removed at the end; where none can be had, a place in which nothing can be kept."""
    try:
        made = Path(tempfile.mkdtemp(prefix="mcl-cache-"))  # mode 0700
    except OSError:
        return _NOWHERE
    if ownership.fault_on_the_way(made) is not None:
        made.rmdir()
        return _NOWHERE
    atexit.register(_remove, made, os.getpid())
    return made


def _remove(made: Path, maker: int) -> None:
    if os.getpid() == maker:  # not a process that was forked from it
        shutil.rmtree(made, ignore_errors=True)


def _make(wanted: Path) -> None:
    """Create a folder and those above it where they are missing, each with mode 0700."""
    if not wanted.is_dir():
        _make(wanted.parent)
        wanted.mkdir(mode=0o700, exist_ok=True)


@contextlib.contextmanager
def _entered(place: Path) -> Iterator[int | None]:
    """Descriptor of a folder, opened from the one above without following a link, both checked.

    None where folders cannot be opened (Windows).

    Raises
    ------
    OSError
        If there is no such folder, or it is not this user's alone.

    """
    if sys.platform == "win32":
        yield None
        return
    above = os.open(place.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _refuse_shared(above)
        entered = os.open(place.name, os.O_RDONLY | os.O_DIRECTORY | _UNFOLLOWED, dir_fd=above)
    finally:
        os.close(above)
    try:
        _refuse_shared(entered)
        yield entered
    finally:
        os.close(entered)


def _refuse_shared(handle: int) -> None:
    why = ownership.fault(os.fstat(handle), handle)
    if why:
        raise PermissionError(errno.EPERM, why)
