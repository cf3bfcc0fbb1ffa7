"""Runs the tests of machine code under other versions of Python, NumPy and numba: ``python -m tests.versions``.

Each combination gets a virtual environment of its own in a temporary folder. Pythons that are not here are left out;
arguments name the combinations to run, such as ``3.11/numpy-1.26``. Exits with 1 if any fails.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MATRIX = {
    "3.11/numpy-1.26": ("numpy==1.26.*", "numba==0.61.*", "scipy<1.17"),
    "3.11/numpy-2.0": ("numpy==2.0.*", "numba==0.61.*", "scipy<1.17"),
    "3.11/newest": (),
    "3.12/numpy-1.26": ("numpy==1.26.*", "scipy<1.17"),
    "3.12/newest": (),
    "3.13/newest": (),
}
NEAREST = (
    "tests/native",
    "tests/sensors/test_backends.py",
    "tests/filter/test_particle_kernels.py",
    "tests/geometry/test_trigonometry.py",
    "tests/io/test_number_text.py",
    "tests/io/test_trace_messages.py",
)
SHOWN = ("numpy", "numba", "llvmlite")


def main(names: list[str]) -> int:
    """Run the combinations of these names, or all; the exit code."""
    failed = 0
    for name in names or MATRIX:
        version = name.partition("/")[0]
        python = shutil.which(f"python{version}")
        if python is None or not answers(python):
            print(f"{name}: no Python {version} here")
            continue
        with tempfile.TemporaryDirectory(prefix="mcl-versions-") as folder:
            outcome = run(python, MATRIX[name], Path(folder))
        print(f"{name}: {outcome}", flush=True)
        failed += not outcome.startswith("passed")
    return min(failed, 1)


def answers(python: str) -> bool:
    """Whether this is a Python, not a stand-in for one that is not installed."""
    return subprocess.run([python, "-c", ""], check=False, capture_output=True).returncode == 0


def run(python: str, constraints: tuple[str, ...], folder: Path) -> str:
    """``passed`` or what went wrong, and the versions."""
    subprocess.run([python, "-m", "venv", folder / "v"], check=True)
    own = str(folder / "v/bin/python")
    install = [own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"{ROOT}[test]", *constraints]
    installed = subprocess.run(install, check=False, capture_output=True, text=True)
    if installed.returncode:
        return f"cannot be installed: {installed.stderr.strip().splitlines()[-1]}"
    code = f"import importlib.metadata as m; print(*(n + ' ' + m.version(n) for n in {SHOWN}), sep=', ')"
    versions = subprocess.run([own, "-c", code], check=True, capture_output=True, text=True).stdout.strip()
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment |= {"MCL_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    tests = [own, "-m", "pytest", "-q", "-p", "no:cacheprovider", *NEAREST]
    done = subprocess.run(tests, cwd=ROOT, env=environment, check=False, capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("FAILED")]
    last = (done.stdout.strip().splitlines() or done.stderr.strip().splitlines() or ["no output"])[-1]
    return "; ".join([f"{'failed' if done.returncode else 'passed'} with {versions}: {last}", *lines])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
