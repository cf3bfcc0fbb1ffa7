"""Arrays between pages that nobody may touch: a kernel that reads or writes beside them ends the process.

An array lies flush against the page after it, or against the one before. What is left of its own pages holds a pattern,
which a kernel must leave as it is. POSIX only.
"""

from __future__ import annotations

import contextlib
import ctypes
import mmap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pytest
    from numpy.typing import NDArray

_PATTERN = 0xA5


@final
@dataclass(frozen=True, slots=True, eq=False)
class Guarded:
    """A copy of an array between guard pages, ``pages`` being what may be touched."""

    array: NDArray[Any]
    pages: NDArray[np.uint8]
    start: int

    def is_intact(self) -> bool:
        """Whether nothing was written beside the array on its own pages."""
        before, after = self.pages[: self.start], self.pages[self.start + self.array.nbytes :]
        return bool((before == _PATTERN).all() and (after == _PATTERN).all())


def guard(array: NDArray[Any], *, at_end: bool) -> Guarded:
    """Copy an array to where its end, or else its start, touches a page that cannot be read or written."""
    size = -(-max(array.nbytes, 1) // mmap.PAGESIZE) * mmap.PAGESIZE
    memory = mmap.mmap(-1, size + 2 * mmap.PAGESIZE)
    whole = np.frombuffer(memory, np.uint8)
    _forbid(whole.ctypes.data)
    _forbid(whole.ctypes.data + mmap.PAGESIZE + size)
    pages = whole[mmap.PAGESIZE : mmap.PAGESIZE + size]
    pages[:] = _PATTERN
    start = size - array.nbytes if at_end else 0
    copy = pages[start : start + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return Guarded(copy, pages, start)


@contextlib.contextmanager
def guarded_arrays(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Guarded]]:
    """All arrays that ``np.empty`` and ``np.zeros`` give meanwhile, guarded and full of zeros.

    What a kernel writes beside the scratch array that its caller measured is seen; so is scratch that nobody fills.
    """
    given: list[Guarded] = []
    zeros = np.zeros

    def guarded(shape: Any, dtype: Any = np.float64) -> Any:
        given.append(guard(zeros(shape, dtype), at_end=False))
        return given[-1].array

    with monkeypatch.context() as patches:
        patches.setattr(np, "empty", guarded)
        patches.setattr(np, "zeros", guarded)
        yield given


def _forbid(address: int) -> None:
    library = ctypes.CDLL(None, use_errno=True)
    if library.mprotect(ctypes.c_void_p(address), ctypes.c_size_t(mmap.PAGESIZE), 0):
        raise OSError(ctypes.get_errno(), "mprotect")
