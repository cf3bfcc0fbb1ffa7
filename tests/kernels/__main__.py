"""``python -m tests.kernels [SEEDS]``: all kernels, poisoned, between guard pages and with numba's bounds checks.

Every kernel in a process of its own; 300 seeds each unless another number is given.
"""

from __future__ import annotations

import sys

from tests.kernels.cases import CASES
from tests.kernels.process import finding


def main() -> int:
    """Print a line a kernel; 1 if one of them did what it must not."""
    seeds, bad = int(sys.argv[1]) if len(sys.argv) > 1 else 300, 0
    for name in sorted(CASES):
        found = [finding(how, seeds, [name]) for how in ("guarded", "checked")]
        bad += any(found)
        sys.stdout.write(f"{name:40s} {'  '.join(text or 'held' for text in found)}\n")
        sys.stdout.flush()
    return 1 if bad else 0


sys.exit(main())
