"""Caches in the user's own folder, and the choice between NumPy and compiled code."""

from __future__ import annotations

import ctypes
import dataclasses
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli import cache
from mclcli.errors import InputError, MclError, UsageError, nearest_name
from mclcli.native import array_gate, backend, machine_code, self_test, versions
from mclcli.native.array_gate import Argument
from tests import processes

if TYPE_CHECKING:
    from collections.abc import Callable

LENGTH = str(2.0 + math.sqrt(2.0) - 1.0 + math.sqrt(2.0))
KERNELS = Path(backend.__file__).parents[1] / "kernels"


@pytest.mark.parametrize(
    ("steps", "rounds", "chosen"),
    [
        (0, 0, "numpy"),
        (1e6, 0, "numpy"),
        (3e7, 0, "kept"),
        (2e6, 2e4, "kept"),
        (2e5, 60, "numpy"),
        (1e9, 0, "compiled"),
    ],
)
def test_the_choice_is_a_function_of_the_jobs_size(steps: float, rounds: float, chosen: str) -> None:
    assert backend.choose(steps, rounds).name == chosen
    assert backend.by_size(steps).name == ("compiled" if chosen == "compiled" else "numpy")


KEPT = """
import sys
from mclcli.native import backend
for name in ("brushfire", "trigonometry"):
    print(backend.KEPT.kernels(name) is not None, "llvmlite" in sys.modules, "numba" in sys.modules)
"""


def test_what_is_kept_is_used_and_nothing_is_compiled_for_it(tmp_path: Path) -> None:
    assert in_a_process(KEPT, tmp_path).communicate(timeout=120)[0].split() == ["False"] * 6
    in_a_process(USE, tmp_path).communicate(timeout=120)
    expected = "True True False\nFalse True False\n"
    assert in_a_process(KEPT, tmp_path).communicate(timeout=120)[0] == expected


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
    first, second = (processes.finish(in_a_process(USE, tmp_path)) for _ in range(2))
    assert first == (f"{LENGTH} True\n", "compiling the inner loops 'brushfire' (once; some seconds)\n")
    assert second == (f"{LENGTH} False\n", "")


def test_processes_that_start_at_once_all_get_their_kernels(tmp_path: Path) -> None:
    started = [in_a_process(USE, tmp_path) for _ in range(3)]
    said = [processes.finish(process) for process in started]
    assert [out.split()[0] for out, _ in said] == [LENGTH] * 3, said
    assert not list(tmp_path.rglob(".new-*"))


def test_a_damaged_file_is_read_as_none_and_compiled_again(tmp_path: Path) -> None:
    backend.load("brushfire")
    path = Path(shutil.copytree(backend.kernel_folder(), tmp_path / backend.kernel_folder().name)) / "brushfire.kernels"
    whole = path.read_bytes()
    assert machine_code.read(path)
    start = whole.index(b"\n", whole.index(b"\n") + 1)
    for position in (*range(start + 1), *range(start, len(whole), 997), len(whole) - 1):
        damaged = bytearray(whole)
        damaged[position] ^= 0x40 if position % 2 else 0x01
        path.write_bytes(damaged)
        assert machine_code.read(path) is None, position
    path.write_bytes(whole[:-1])
    out, said = processes.finish(in_a_process(USE, tmp_path))
    assert out.split()[0] == LENGTH
    assert "compiling" in said
    assert machine_code.read(path)


def test_a_folder_that_cannot_be_written_costs_a_warning(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    out, said = processes.finish(in_a_process(USE, tmp_path / "file"))
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


FALLEN_BACK = """
import logging, sys
import numpy as np
from mclcli.native import array_gate, backend, machine_code, self_test, versions
logging.basicConfig(level=logging.WARNING, format="%(message)s")
{change}
poses = np.random.default_rng(1).normal(size=(300, 3))
sums, mean, covariance = backend.load("moments"), np.empty(3), np.empty((3, 3))
sums.mean_and_covariance(poses, np.full(300, 1 / 300), mean, covariance, np.empty((6, 128)), np.empty((65, 6)))
cos, sin = np.empty(300), np.empty(300)
backend.load("trigonometry").cos_sin(np.ascontiguousarray(poses[:, 2]), cos, sin)
print((mean.tobytes() + covariance.tobytes() + cos.tobytes() + sin.tobytes()).hex())
"""


def test_numba_runs_the_kernels_where_gates_cannot_be_trusted(tmp_path: Path) -> None:
    change = "self_test.header_is_known = lambda: False"
    expected, _ = processes.finish(in_a_process(FALLEN_BACK.format(change=""), cache.cache_root()))
    out, said = processes.finish(in_a_process(FALLEN_BACK.format(change=change), tmp_path))
    assert out == expected
    assert said.count("kernels are compiled anew in every process") == 1
    assert len(said.splitlines()) == 1


def test_numba_runs_the_kernels_where_versions_are_untested(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(versions.TESTED, "numpy", ((1, 0), (1, 1)))
    monkeypatch.setattr(backend, "_untested", versions.untested)
    monkeypatch.setattr(backend, "_by_numba", lambda name, why: SimpleNamespace(told=(name, why)))
    name, why = backend.load.__wrapped__("brushfire").told
    assert name == "brushfire"
    assert why.startswith("numpy ")


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(array_gate.Header)])
def test_a_header_with_a_field_elsewhere_is_noticed(monkeypatch: pytest.MonkeyPatch, field: str) -> None:
    assert self_test.header_is_known()
    moved = dataclasses.replace(array_gate.HEADER, **{field: getattr(array_gate.HEADER, field) + 8})
    monkeypatch.setattr(self_test, "HEADER", moved)
    assert not self_test.header_is_known()


GATE = (Argument("<f8", 2, writable=True), Argument("int64"), Argument("<u2", 1), Argument("bool"))


def gate_of(arguments: tuple[Argument, ...]) -> Callable[..., Callable[..., int]]:
    """A gate that passes on what these arguments call for."""
    address = machine_code.engine_of(array_gate.object_code(arguments)).get_function_address(array_gate.SYMBOL)
    kinds: list[Any] = [ctypes.py_object if a.dimensions >= 0 else self_test.SCALARS[a.type] for a in arguments]
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_int64, *kinds)(address)
    return lambda kernel: lambda *given: call(kernel, id(np.ndarray), *given)


def test_a_gate_is_right_for_what_it_was_made_for() -> None:
    assert self_test.gate_is_right(gate_of(GATE), GATE)


@pytest.mark.parametrize(
    "other",
    [
        (Argument("<f8", 1, writable=True), *GATE[1:]),
        (Argument("<f8", 2), *GATE[1:]),
        (Argument("<i8", 2, writable=True), *GATE[1:]),
        (*GATE[:2], Argument("<u4", 1), GATE[3]),
        (*GATE[:2], Argument("<i2", 1), GATE[3]),
    ],
)
def test_a_gate_that_was_made_for_something_else_is_noticed(other: tuple[Argument, ...]) -> None:
    assert not self_test.gate_is_right(gate_of(other), GATE)


@pytest.mark.parametrize("field", ["data", "shape", "strides", "dimensions", "dtype", "flags"])
def test_a_gate_that_reads_elsewhere_is_noticed(monkeypatch: pytest.MonkeyPatch, field: str) -> None:
    other = {"data": "strides", "shape": "strides", "strides": "shape", "dtype": "data"}.get(field, "data")
    wrong = dataclasses.replace(array_gate.HEADER, **{field: getattr(array_gate.HEADER, other)})
    monkeypatch.setattr(array_gate, "HEADER", wrong)
    gate = gate_of(GATE)
    monkeypatch.undo()
    assert not self_test.gate_is_right(gate, GATE)


def test_what_is_here_has_been_tested_and_what_is_not_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert versions.untested() == ""
    monkeypatch.setitem(versions.TESTED, "numba", ((0, 1), (0, 2)))
    assert versions.untested().startswith("numba 0.")
    assert versions.untested().endswith("(tested: 0.1 to 0.2)")


def test_the_environment_names_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "here"))
    assert cache.cache_root() == tmp_path / "here"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="XDG is the custom of Linux")
def test_else_the_desktop_says_where_caches_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("MCL_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_root() == tmp_path / "mcl"


def test_exit_codes_are_a_contract() -> None:
    codes = {InputError: 1, UsageError: 2}
    assert {kind: kind.exit_code for kind in codes} == codes
    assert all(issubclass(kind, MclError) for kind in codes)


def test_only_a_name_that_is_near_is_suggested() -> None:
    assert nearest_name("sigma_hitt", ["sigma_hit", "z_hit"]) == "; did you mean 'sigma_hit'?"
    assert nearest_name("zzzzzz", ["sigma_hit", "z_hit"]) == ""
