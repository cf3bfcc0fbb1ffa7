"""Calls of kernels with poisoned arguments between guard pages: ``python -m tests.kernels`` runs them by the hundred.

Each call is told before it is made, so that what ends the process is known by name.
"""

from __future__ import annotations

import os
import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.kernels.cases import CASES
from tests.kernels.guarded import guard

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Load = Callable[[str], SimpleNamespace]

REALS = (
    *(np.nan, np.inf, -np.inf, 1e308, -1e308, 1e300, -1e300, 5e-324, -5e-324, 1e-310, 0.0, -0.0, 1.0, -1.0),
    *(2.0**31, -(2.0**31), 2.0**31 - 1.0, 2.0**32, 2.0**63, -(2.0**63), 2.0**62, 1e9, -1e9, 255.0, 65536.0),
)
_SHARES = (0.0, 0.02, 0.5, 1.0)  # of an array's elements


def extremes(kind: np.dtype[Any]) -> NDArray[Any]:
    """Whole numbers at, and beside, the ends of what a type holds, and small ones."""
    ends = np.iinfo(kind)
    values = {ends.min, ends.min + 1, -(2**31), -2, -1, 0, 1, 2, 2**31 - 1, 2**31, 2**62, ends.max - 1, ends.max}
    return np.array([v for v in sorted(values) if ends.min <= v <= ends.max], kind)


def _poisoned(value: Any, rng: np.random.Generator) -> Any:
    """The argument with some of its values replaced."""
    if isinstance(value, np.ndarray):
        where = rng.random(value.shape) < rng.choice(_SHARES)
        choices = (
            np.array(REALS) if value.dtype.kind == "f" else extremes(value.dtype) if value.dtype.kind in "iu" else None
        )
        if choices is None:
            return value
        return np.where(where, rng.choice(choices, value.shape), value).astype(value.dtype)
    if isinstance(value, bool) or rng.random() < 0.6:
        return value
    return float(rng.choice(REALS)) if isinstance(value, float) else int(rng.choice(extremes(np.dtype(np.int64))))


def call(load: Load, name: str, seed: int) -> str:
    """One call of a kernel with arguments drawn by a seed; what is wrong with it, empty if nothing is."""
    module, kernel = name.split(".")
    rng = np.random.default_rng([seed, *name.encode()])
    makes = CASES[name]
    arguments = makes[seed % len(makes)](rng)
    touched = rng.random(len(arguments)) < rng.choice([0.0, 0.15, 0.5, 1.0])
    given = [_poisoned(v, rng) if yes else v for v, yes in zip(arguments, touched, strict=True)]
    guarded = {i: guard(v, at_end=bool(rng.integers(2))) for i, v in enumerate(given) if isinstance(v, np.ndarray)}
    getattr(load(module), kernel)(*(guarded[i].array if i in guarded else v for i, v in enumerate(given)))
    wrong = [str(i) for i, one in guarded.items() if not one.is_intact()]
    return f"{name}, seed {seed}: wrote beside argument {', '.join(wrong)}" if wrong else ""


def run(load: Load, names: Sequence[str], seeds: range) -> list[str]:
    """Call kernels with every seed; what went wrong. Names are told on stderr as they come."""
    problems = []
    for name in names:
        for seed in seeds:
            os.write(2, f"\n{name} {seed}".encode())
            try:
                problem = call(load, name, seed)
            except Exception as error:  # noqa: BLE001 - of any kind, it is a finding
                problem = f"{name}, seed {seed}: {type(error).__name__}: {error}"
            problems += [problem] if problem else []
    return problems


def checked(name: str) -> SimpleNamespace:
    """A module's kernels by numba's own dispatchers, every index tested."""
    import importlib

    from mclcli import kernels

    kernels.OPTIONS.update(boundscheck=True, no_cpython_wrapper=False)
    return SimpleNamespace(**vars(importlib.import_module(f"mclcli.kernels.{name}")))


def main(arguments: Sequence[str]) -> int:
    """``guarded`` or ``checked``, first and last seed, names of kernels (all if none is given)."""
    from mclcli.native import backend

    how, first, last, *names = arguments
    problems = run(backend.load if how == "guarded" else checked, names or sorted(CASES), range(int(first), int(last)))
    sys.stdout.write("\n".join(problems))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
