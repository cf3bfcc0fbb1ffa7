"""The folder that keeps what is costly to make again: distance fields and compiled kernels."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


_REFUSED: set[Path] = set()  # folders that were warned of


def cache_root() -> Path:
    """Folder of the user's own: MCL_CACHE_DIR, else the platform's (XDG_CACHE_HOME where that is the custom)."""
    import platformdirs

    return Path(os.environ.get("MCL_CACHE_DIR") or platformdirs.user_cache_dir("mcl", appauthor=False))


def is_ours(status: os.stat_result) -> bool:
    """Whether a file or folder belongs to this user; what belongs to others is not used."""
    return sys.platform == "win32" or status.st_uid == os.getuid()


def make_private(folder: Path) -> None:
    """Create a folder (mode 0700) where it is missing.

    Raises
    ------
    OSError
        If that fails, or the folder is somebody else's.

    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not is_ours(folder.stat()):
        raise PermissionError(0, "it belongs to another user")
    if not os.access(folder, os.W_OK):
        raise PermissionError(0, "it is not writable")


def write_whole(path: Path, parts: Iterable[bytes | memoryview]) -> None:
    """Write a file of the user's own (mode 0600) beside its place and move it there: nobody ever sees half of it.

    Raises
    ------
    OSError
        If its folder cannot be made or written, or is somebody else's.

    """
    make_private(path.parent)
    handle, name = tempfile.mkstemp(prefix=".new-", dir=path.parent)  # mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.writelines(parts)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise


def cannot_keep(what: str, path: Path, error: OSError) -> None:
    """Warn that something could not be kept, once a cache: what follows will hardly fare better."""
    root = cache_root()
    if root not in _REFUSED:
        _REFUSED.add(root)
        logging.getLogger("mclcli").warning("%s: cannot keep %s: %s; going on without", path, what, error.strerror)
