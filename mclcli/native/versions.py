"""The versions that kernels have been tested with; beyond them numba itself calls them (see decision 9)."""

from __future__ import annotations

import functools
import importlib
import sys
from typing import Final

Version = tuple[int, int]

TESTED: Final[dict[str, tuple[Version, Version]]] = {
    "python": ((3, 11), (3, 13)),
    "numpy": ((1, 26), (2, 5)),
    "numba": ((0, 61), (0, 68)),
    "llvmlite": ((0, 44), (0, 50)),
}


def untested() -> str:
    """What is here in a version that has not been tested, with the range that has; empty if nothing is."""
    for name, (first, last) in TESTED.items():
        text = installed(name)
        if not first <= _major_and_minor(text) <= last:
            (a, b), (c, d) = first, last
            return f"{name} {text} (tested: {a}.{b} to {c}.{d})"
    return ""


@functools.cache
def installed(name: str) -> str:
    """Version of what is here, without importing the compiler."""
    if name == "python":
        return f"{sys.version_info.major}.{sys.version_info.minor}"
    if name in {"numpy", "llvmlite"}:  # imported anyway, and asking for metadata takes some milliseconds each
        return str(importlib.import_module(name).__version__)
    from importlib.metadata import version

    return version(name)


def _major_and_minor(text: str) -> Version:
    major, minor, *_ = text.split(".")
    return (int(major), int(minor)) if major.isdigit() and minor.isdigit() else (0, 0)
