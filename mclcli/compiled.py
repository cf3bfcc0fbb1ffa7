"""Compiled or not: when the kernels are worth their compiler, and where their machine code is kept.

It is kept in a folder named by the digest of all kernels and the versions of the compiler: numba by itself misses
changes in inlined helpers.
"""

from __future__ import annotations

import functools
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from mclcli import cache

if TYPE_CHECKING:
    from types import ModuleType

# Loading compiler and machine code takes about 0.8 s; compiled code saves about 14 ns a step over NumPy.
_STEPS_WORTH_COMPILING = 6e7


def worth_compiling(steps: float) -> bool:
    """Whether a job of so many elementary steps (particle × beam, cell × neighbour) should use compiled code.

    A pure function of the job's size, so that the same job always takes the same path.
    """
    return steps >= _STEPS_WORTH_COMPILING


@functools.cache
def load(name: str) -> ModuleType:
    """Kernel module of this name, compiled or taken from the cache of earlier processes."""
    import importlib

    _choose_cache_folder()
    return importlib.import_module(f"mclcli.kernels.{name}")


@functools.cache
def _choose_cache_folder() -> None:
    import logging

    import numba

    folder = cache.cache_root() / f"kernels-{_digest()}"
    try:
        cache.make_private(folder)
    except OSError as error:
        folder = _temporary_folder()
        logging.getLogger("mclcli").warning(
            "%s: %s; compiling again each time", error.filename or folder, error.strerror
        )
    if not any(folder.iterdir()):
        logging.getLogger("mclcli").info("compiling the inner loops (once; some seconds)")
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


def _temporary_folder() -> Path:
    import atexit
    import shutil
    import tempfile

    folder = Path(tempfile.mkdtemp(prefix="mcl-kernels-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _digest() -> str:
    import hashlib

    import llvmlite
    import numba

    digest = hashlib.sha256(f"{sys.version} {numba.__version__} {llvmlite.__version__}".encode())
    for path in sorted((Path(__file__).parent / "kernels").glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
