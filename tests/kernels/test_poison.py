"""No value in a kernel's arguments makes it read or write beside its arrays.

A quick share; ``python -m tests.kernels`` runs the whole, with numba's bounds checks as well.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mclcli.native import backend
from tests.kernels.cases import CASES
from tests.kernels.process import finding

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="guard pages are asked of mprotect")
KERNELS = Path(backend.__file__).parents[1] / "kernels"
MODULES = sorted(path.stem for path in KERNELS.glob("*.py") if not path.stem.startswith("_"))


def test_every_kernel_has_a_case() -> None:
    assert {f"{module}.{kernel}" for module in MODULES for kernel in vars(backend.load(module))} == set(CASES)


def test_poison_between_guard_pages_stays_there() -> None:
    assert not finding("guarded", seeds=60)


def test_a_fault_is_a_finding_that_names_the_kernel() -> None:
    """What happens to a kernel that does index by what it is given: numba's own, compiled for this test."""
    code = (
        "import numba, types; from tests.kernels import poison\n"
        "@numba.njit\n"
        "def f(a, i, o):\n    o[0] = a[i[0]]\n"
        "poison.CASES['toy.read'] = (lambda rng: [poison.np.zeros(4), poison.np.array([3]), poison.np.zeros(1)],)\n"
        "print(poison.run(lambda _: types.SimpleNamespace(read=f), ['toy.read'], range(40)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=KERNELS.parents[1], capture_output=True, text=True, check=False
    )
    assert done.returncode < 0
    assert done.stderr.rstrip().rsplit("\n", 1)[-1].startswith("toy.read")


def test_a_write_beside_an_array_is_seen() -> None:
    from tests.kernels.guarded import guard

    one = guard(np.arange(3.0), at_end=False)
    assert one.is_intact()
    assert one.array.tolist() == [0.0, 1.0, 2.0]
    one.pages[one.array.nbytes] = 0
    assert not one.is_intact()
