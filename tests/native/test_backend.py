"""Caches in the user's own folder, and the choice between NumPy and compiled code."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mclcli import cache
from mclcli.errors import AmbiguousResult, InputError, MclError, ThresholdMissed, UsageError, nearest_name
from mclcli.native import backend, machine_code

LENGTH = str(2.0 + math.sqrt(2.0) - 1.0 + math.sqrt(2.0))
KERNELS = Path(backend.__file__).parents[1] / "kernels"


def test_the_choice_is_a_function_of_the_jobs_size() -> None:
    assert [backend.worth_compiling(steps) for steps in (0.0, 1e6, 1e9, 1e12)] == [False, False, True, True]


def test_kernels_are_loaded_once_and_kept_where_the_cache_is() -> None:
    assert backend.load("brushfire") is backend.load("brushfire")
    folder = backend.kernel_folder()
    assert folder.parent == cache.cache_root()
    assert folder.name.startswith("kernels-")
    assert (folder / "brushfire.kernels").stat().st_mode & 0o777 == 0o600


def in_a_process(code: str, folder: Path) -> subprocess.Popen[str]:
    """A Python process with a cache of its own, or of this test."""
    environment = os.environ | {"MCL_CACHE_DIR": str(folder)}
    command, pipe = [sys.executable, "-W", "error", "-c", code], subprocess.PIPE
    return subprocess.Popen(command, env=environment, text=True, stdout=pipe, stderr=pipe)


USE = """
import logging, sys
import numpy as np
from mclcli.native import backend
logging.basicConfig(level=logging.INFO, format="%(message)s")
distance = np.full((3, 4), np.inf)
distance[0, 0] = 0.0
backend.load("brushfire").two_pass_chamfer(distance)
print(distance[2, 3], "numba" in sys.modules)
"""


def test_the_first_process_compiles_and_says_so_and_later_ones_never_load_the_compiler(tmp_path: Path) -> None:
    first, second = (in_a_process(USE, tmp_path).communicate(timeout=120) for _ in range(2))
    assert first == (f"{LENGTH} True\n", "compiling the inner loops 'brushfire' (once; some seconds)\n")
    assert second == (f"{LENGTH} False\n", "")


def test_processes_that_start_at_once_all_get_their_kernels(tmp_path: Path) -> None:
    processes = [in_a_process(USE, tmp_path) for _ in range(3)]
    said = [process.communicate(timeout=120) for process in processes]
    assert [out.split()[0] for out, _ in said] == [LENGTH] * 3, said
    assert not list(tmp_path.rglob(".new-*"))


def test_a_damaged_file_is_read_as_none_and_compiled_again(tmp_path: Path) -> None:
    in_a_process(USE, tmp_path).communicate(timeout=120)
    (path,) = tmp_path.rglob("*.kernels")
    whole = path.read_bytes()
    assert machine_code.read(path)
    start = whole.index(b"\n", whole.index(b"\n") + 1)
    for position in (*range(start + 1), *range(start, len(whole), 997), len(whole) - 1):
        for change in (0x01, 0x40):
            damaged = bytearray(whole)
            damaged[position] ^= change
            path.write_bytes(damaged)
            assert machine_code.read(path) is None, (position, change)
    path.write_bytes(whole[:-1])
    out, said = in_a_process(USE, tmp_path).communicate(timeout=120)
    assert out.split()[0] == LENGTH
    assert "compiling" in said
    assert machine_code.read(path)


def test_a_folder_that_cannot_be_written_costs_a_warning(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    out, said = in_a_process(USE, tmp_path / "file").communicate(timeout=120)
    assert out.split()[0] == LENGTH
    assert "cannot keep compiled code" in said


@pytest.mark.parametrize("name", sorted(p.stem for p in KERNELS.glob("*.py") if not p.stem.startswith("_")))
def test_every_kernel_runs_without_the_compiler(name: str) -> None:
    assert vars(backend.load(name))


def test_a_kernel_takes_what_it_was_compiled_for_and_nothing_else() -> None:
    chamfer = backend.load("brushfire").two_pass_chamfer
    read_only = np.zeros((3, 3))
    read_only.flags.writeable = False
    unaligned = np.zeros(73, np.uint8)[1:].view(np.float64).reshape(3, 3)
    wrong = [np.zeros((3, 3), np.float32), np.zeros(9), np.zeros((3, 6))[:, ::2], read_only, unaligned]
    swapped, integers = np.zeros((3, 3), np.dtype(np.float64).newbyteorder()), np.zeros((3, 3), np.int64)
    for argument in (*wrong, swapped, integers, np.zeros((3, 3)).T[:2], [[0.0]], None, 1.0, np.float64(1.0)):
        with pytest.raises(TypeError, match="two_pass_chamfer"):
            chamfer(argument)
    for arguments in ((), (np.zeros((3, 3)), 1.0)):
        with pytest.raises(TypeError, match="expected 1 arguments"):
            chamfer(*arguments)


@pytest.mark.parametrize("code", ["l", "q"])
def test_a_kernel_takes_every_name_of_its_type(code: str) -> None:
    counts = np.zeros(2, code)
    if counts.dtype.str != np.dtype(np.int64).str:
        pytest.skip("another type here")
    backend.load("likelihood_field").count_below(np.array([[1, 2, 3], [5, 6, 7]], np.uint16), 3, counts)
    assert counts.tolist() == [2, 0]


def test_a_kernel_takes_arrays_without_elements() -> None:
    backend.load("trigonometry").cos_sin(np.empty(0), np.empty(0), np.empty(0))


def test_the_environment_names_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "here"))
    assert cache.cache_root() == tmp_path / "here"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="XDG is the custom of Linux")
def test_else_the_desktop_says_where_caches_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("MCL_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_root() == tmp_path / "mcl"


def test_exit_codes_are_a_contract() -> None:
    codes = {InputError: 1, UsageError: 2, ThresholdMissed: 4, AmbiguousResult: 5}
    assert {kind: kind.exit_code for kind in codes} == codes
    assert all(issubclass(kind, MclError) for kind in codes)


def test_only_a_name_that_is_near_is_suggested() -> None:
    assert nearest_name("sigma_hitt", ["sigma_hit", "z_hit"]) == "; did you mean 'sigma_hit'?"
    assert nearest_name("zzzzzz", ["sigma_hit", "z_hit"]) == ""
