"""Compiled or not: when the kernels are worth it, and where their machine code is kept.

It is kept in a folder named by the digest of all kernels, the versions of the compiler and the processor, and is called
from there without importing the compiler (see ``mclcli.native.machine_code``).
"""

from __future__ import annotations

import functools
import hashlib
import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from mclcli import cache

if TYPE_CHECKING:
    from types import SimpleNamespace

    from mclcli.native.array_gate import Argument
    from mclcli.native.machine_code import Function

# Compiling takes some seconds, once, and linking what was compiled 0.05 s; either saves about 14 ns a step over NumPy.
# A short log must not wait for the compiler on its first run, so the bound is where NumPy costs about a second.
_STEPS_WORTH_COMPILING = 6e7
_IN_USE: set[str] = set()
_FOREIGN = ("NRT_MemInfo_alloc", "NRT_Allocate", "numba_", "Py", "_Py")  # what object code cannot find without numba


def worth_compiling(steps: float) -> bool:
    """Whether a job of so many elementary steps (particle × beam, cell × neighbour) should use compiled code.

    A pure function of the job's size, so that the same job always takes the same path.
    """
    return steps >= _STEPS_WORTH_COMPILING


def in_use() -> bool:
    """Whether some job has brought compiled code into this process, so that more of it costs little."""
    return bool(_IN_USE)


@functools.cache
def load(name: str) -> SimpleNamespace:
    """Kernels of the module of this name, compiled now or by an earlier process."""
    from mclcli.native import machine_code

    _IN_USE.add(name)
    path = kernel_folder() / f"{name}.kernels"
    functions = machine_code.read(path)
    if functions is None:
        logging.getLogger("mclcli").info("compiling the inner loops '%s' (once; some seconds)", name)
        functions = compile_kernels(name)
        try:
            machine_code.write(path, functions)
        except OSError as error:
            cache.cannot_keep("compiled code", path, error)
    return machine_code.link(functions)


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
    import importlib

    import numba

    from mclcli.native import array_gate
    from mclcli.native.machine_code import Function

    settings: Any = numba.config
    settings.DISABLE_INTEL_SVML, settings.CPU_FEATURES = True, _processor_features()  # SVML is not in every process
    module = importlib.import_module(f"mclcli.kernels.{name}")
    functions = []
    for kernel, dispatcher in vars(module).items():
        if kernel.startswith("_") or not isinstance(dispatcher, numba.core.dispatcher.Dispatcher):
            continue
        for result in cast("Any", dispatcher).overloads.values():
            arguments = tuple(_argument(kind) for kind in result.signature.args)
            code = _object_code(kernel, result.library)
            gate = array_gate.object_code(arguments)
            functions.append(Function(kernel, result.fndesc.llvm_func_name, arguments, code, gate))
    return functions


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
    from importlib.metadata import version

    import llvmlite.binding as llvm

    cpu = f"{llvm.get_host_cpu_name()} {_processor_features()}"
    digest = hashlib.sha256(f"{sys.version} {version('numba')} {version('llvmlite')} {cpu}".encode())
    here = Path(__file__).parents[1]
    for path in (here / "native/array_gate.py", *sorted((here / "kernels").glob("*.py"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _processor_features() -> str:
    """What LLVM is to use of this processor: also its longest vectors, which early ones that had them ran slowly."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return str(features.flatten()) + (",-prefer-256-bit" if features.get("avx512f") else "")
