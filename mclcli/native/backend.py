"""NumPy or compiled kernels: a job's choice, which it hands on to wherever loops run, and where machine code is kept.

It is kept in a folder named by the digest of all kernels, the versions of the compiler and the processor, and is called
from there without importing the compiler (see ``mclcli.native.machine_code``).
"""

from __future__ import annotations

import functools
import hashlib
import logging
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final, Literal, final

from mclcli import cache

if TYPE_CHECKING:
    from types import ModuleType

    from mclcli.native.array_gate import Argument
    from mclcli.native.machine_code import Function

# Compiling takes some seconds, once; linking what is kept takes 0.1 s, LLVM's import included. Either saves about 14 ns
# a step over NumPy. A short log must not wait for the compiler on its first run, so that bound is where NumPy costs
# about a second.
_STEPS_WORTH_COMPILING = 6e7
_STEPS_WORTH_LINKING = 1e7
_STEPS_OF_A_ROUND = 1000  # what starting a dozen operations costs NumPy, however short the arrays
_FOREIGN = ("NRT_MemInfo_alloc", "NRT_Allocate", "numba_", "Py", "_Py")  # what object code cannot find without numba


@final
@dataclass(frozen=True, slots=True)
class Backend:
    """What runs the loops of a job: the NumPy beside every caller, compiled kernels, or those of them that are kept.

    Kernels that have a twin in NumPy have its bits, so ``kept`` comes to the same whatever the cache holds.
    """

    name: Literal["numpy", "kept", "compiled"]

    def kernels(self, module: str) -> SimpleNamespace | None:
        """Kernels of ``mclcli.kernels`` by their module's name; None: use NumPy."""
        if self.name == "numpy":
            return None
        return load(module) if self.name == "compiled" else _load_kept(module)


NUMPY: Final = Backend("numpy")
KEPT: Final = Backend("kept")
COMPILED: Final = Backend("compiled")


def choose(steps: float, rounds: float = 0.0) -> Backend:
    """Backend for a job of so many elementary steps (particle × beam, cell × neighbour).

    ``rounds`` is how often NumPy would start a loop for them (beams × updates): with few particles, that is its work.
    Jobs that are not worth the compiler may still use what an earlier one has left in the cache.
    """
    if steps + _STEPS_OF_A_ROUND * rounds >= _STEPS_WORTH_LINKING and by_size(steps) == NUMPY:
        return KEPT
    return by_size(steps)


def by_size(steps: float) -> Backend:
    """Backend by the size of a job alone: for loops whose twin differs in the last bits."""
    return COMPILED if steps >= _STEPS_WORTH_COMPILING else NUMPY


@functools.cache
def load(name: str) -> SimpleNamespace:
    """Kernels of the module of this name, compiled now or by an earlier process; for what has no loop in NumPy."""
    from mclcli.native import machine_code

    if _untested():
        return _by_numba(name, _untested())
    path = _path(name)
    functions = machine_code.read(path)
    if functions is None:
        logging.getLogger("mclcli").info("compiling the inner loops '%s' (once; some seconds)", name)
        functions = compile_kernels(name)
        try:
            machine_code.write(path, functions)
        except OSError as error:
            cache.cannot_keep("compiled code", path, error)
    try:
        return machine_code.link(functions)
    except machine_code.UntrustedGateError as error:
        return _by_numba(name, str(error))


@functools.cache
def _load_kept(name: str) -> SimpleNamespace | None:
    """The same if an earlier process has kept them, and they can be used without the compiler."""
    if not any(cache.cache_root().glob("kernels-*")):  # their digest would cost LLVM's import
        return None
    from mclcli.native import machine_code

    functions = None if _untested() else machine_code.read(_path(name))
    try:
        return None if functions is None else machine_code.link(functions)
    except machine_code.UntrustedGateError:
        return None


@functools.cache
def _untested() -> str:
    from mclcli.native import versions

    return versions.untested()


def _path(name: str) -> Path:
    return kernel_folder() / f"{name}.kernels"


def _by_numba(name: str, why: str) -> SimpleNamespace:
    """The same kernels as numba calls them: the same bits, but nothing is kept for later processes."""
    _warn_of_numba(why)
    import numba

    module = _compiled_module(name)

    options: Any = {
        "nogil": True,
        "error_model": "numpy",
    }  # as kernels.OPTIONS, with a way in from Python
    return SimpleNamespace(
        **{
            kernel: numba.njit(list(dispatcher.overloads), **options)(dispatcher.py_func)
            for kernel, dispatcher in _public_kernels(module)
        }
    )


@functools.cache
def _warn_of_numba(why: str) -> None:
    text = "%s: kernels are compiled anew in every process; the results are the same, the start takes some seconds"
    logging.getLogger("mclcli").warning(text, why)


def kernel_folder() -> Path:
    """Where the machine code of these kernels, this compiler and this processor belongs."""
    return cache.folder(f"kernels-{_digest()}")


def compile_kernels(name: str) -> list[Function]:
    """Machine code of every public kernel of a module, a function for each of its signatures.

    Raises
    ------
    ValueError
        If a kernel allocates memory or calls Python: arrays are to come from outside.

    """
    from mclcli.native import array_gate
    from mclcli.native.machine_code import Function

    functions = []
    for kernel, dispatcher in _public_kernels(_compiled_module(name)):
        for result in dispatcher.overloads.values():
            arguments = tuple(_argument(kind) for kind in result.signature.args)
            code = _object_code(kernel, result.library)
            gate = array_gate.object_code(arguments)
            functions.append(Function(kernel, result.fndesc.llvm_func_name, arguments, code, gate))
    return functions


def _compiled_module(name: str) -> ModuleType:
    """Module of kernels, compiled for this processor as it is imported."""
    import importlib

    import numba

    settings: Any = numba.config
    settings.DISABLE_INTEL_SVML, settings.CPU_FEATURES = True, _processor_features()  # SVML is not in every process
    return importlib.import_module(f"mclcli.kernels.{name}")


def _public_kernels(module: ModuleType) -> list[tuple[str, Any]]:
    """Names and dispatchers of a module's kernels."""
    from numba.core.dispatcher import Dispatcher

    found = vars(module).items()
    return [(name, value) for name, value in found if isinstance(value, Dispatcher) and not name.startswith("_")]


def _argument(kind: object) -> Argument:
    """What a numba type says of an argument."""
    from numba import types
    from numba.np.numpy_support import as_dtype

    from mclcli.native.array_gate import Argument

    if isinstance(kind, types.Array):
        return Argument(as_dtype(kind.dtype).str, kind.ndim, kind.mutable)
    return Argument(str(kind))


def _object_code(kernel: str, library: Any) -> bytes:  # noqa: ANN401
    outside = [f.name for f in library._final_module.functions if f.is_declaration and f.name.startswith(_FOREIGN)]  # noqa: SLF001
    if outside:
        raise ValueError(f"kernel {kernel} needs {', '.join(outside)}: pass it the arrays it works on")
    _, _, (code, _) = library.serialize_using_object_code()
    return bytes(code)


def _digest() -> str:
    import llvmlite.binding as llvm

    return _digest_for(f"{llvm.get_host_cpu_name()} {_processor_features()}")


@functools.cache
def _digest_for(cpu: str) -> str:
    from mclcli.native.versions import installed

    digest = hashlib.sha256(f"{sys.version} {installed('numba')} {installed('llvmlite')} {cpu}".encode())
    here = Path(__file__).parents[1]
    for path in (here / "native/array_gate.py", *sorted((here / "kernels").glob("*.py"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _processor_features() -> str:
    """What LLVM is to use of this processor: also its longest vectors, which early ones that had them ran slowly."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return str(features.flatten()) + (",-prefer-256-bit" if features.get("avx512f") else "")
