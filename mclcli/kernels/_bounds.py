"""What stands between any value and an index: inlined into other kernels.

A comparison with NaN is false, so tests ask whether a value is within bounds, never whether it is beyond them.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS

_FAR = 2**40  # cells: farther than any map reaches; sums of a few such numbers do not overflow


@nb.njit(**OPTIONS)
def _whole(value, low, high):  # type: ignore[no-untyped-def]
    """``value`` as a whole number from ``low`` to ``high``, cut off; NaN is ``low``.

    What the processor makes of a number that is out of an integer's range is nobody's promise.
    """
    return nb.int64(_within(value, np.float64(low), np.float64(high)))


@nb.njit(**OPTIONS)
def _within(value, low, high):  # type: ignore[no-untyped-def]
    """``value`` from ``low`` to ``high``, cut off; NaN is ``low``."""
    return min(max(value, low), high)


@nb.njit(**OPTIONS)
def _holds(size, height, width):  # type: ignore[no-untyped-def]
    """Whether ``size`` elements are enough for so many rows and columns, at least one of each."""
    return height > 0 and width > 0 and size // width >= height


@nb.njit(**OPTIONS)
def _is_level(shape, size):  # type: ignore[no-untyped-def]
    """Whether the level that ``shape`` (5,) describes lies in a pool of this size."""
    start, height, width, margin = shape[0], shape[1], shape[2], shape[4]
    return 0 <= start <= size and 0 <= margin < _FAR and _holds(size - start, height, width)


@nb.njit(**OPTIONS)
def _extremes(numbers):  # type: ignore[no-untyped-def]
    """Least and greatest of whole numbers (G, B) of 32 bits; 0 and 0 of none."""
    least = greatest = numbers[0, 0] if numbers.size else np.int32(0)
    for row in range(numbers.shape[0]):
        line = numbers[row]
        for i in range(line.size):
            least, greatest = min(least, line[i]), max(greatest, line[i])
    return nb.int64(least), nb.int64(greatest)


@nb.njit(**OPTIONS)
def _reaches(size, at, low, high, count):  # type: ignore[no-untyped-def]
    """Whether ``count`` elements from ``at`` + s on are among ``size`` for all s, ``low`` ≤ s ≤ ``high``."""
    return at >= -low and at <= size - count - high
