"""Poisoned calls in a process of their own, so that a fault is a finding that names the kernel."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

ROOT = Path(__file__).resolve().parents[2]


def finding(how: str, seeds: int, names: Sequence[str] = (), first: int = 0) -> str:
    """What went wrong, empty if nothing did."""
    command = [sys.executable, "-m", "tests.kernels.poison", how, str(first), str(first + seeds), *names]
    environment = os.environ | {"NUMBA_BOUNDSCHECK": "1" if how == "checked" else "0"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=1800, env=environment)
    if done.returncode == 0:
        return ""
    last = done.stderr.rstrip().rsplit("\n", 1)[-1]
    return done.stdout or f"ended with {done.returncode} at {last}"
