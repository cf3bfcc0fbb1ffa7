"""Compiled kernels as files: written once with the compiler at hand, called later without importing it.

Importing numba takes longer than most jobs of the compiled loops. A kernel needs nothing of it at run time: its machine
code is linked by LLVM and called with the addresses of NumPy arrays. A file is a magic line, one line of JSON (each
function's name, symbol and arguments, SHA-256 of the payload) and the payload: object code.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import json
import os
from dataclasses import asdict, dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, final

from mclcli import cache

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

_MAGIC = b"mcl machine code\n"
_MAX_HEADER = 1 << 20
_SCALARS = {"float64": ctypes.c_double, "int64": ctypes.c_int64, "bool": ctypes.c_uint8}
_DONE = (0, -2)  # numba's return codes for a value and for None
_ENGINES: list[object] = []  # what owns the code must outlive it


@final
@dataclass(frozen=True, slots=True)
class Argument:
    """What a kernel takes: a scalar (``dimensions`` −1) or a C-contiguous array of a type, writable or not."""

    type: str
    dimensions: int = -1
    writable: bool = False


@final
@dataclass(frozen=True, slots=True)
class Function:
    """One signature of a kernel: its name, its symbol within the object code, and what it takes."""

    name: str
    symbol: str
    arguments: tuple[Argument, ...]
    code: bytes


def write(path: Path, functions: Sequence[Function]) -> None:
    """Keep functions in a file of the user's own, moved into place whole.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    payload = b"".join(function.code for function in functions)
    described = [asdict(function) | {"code": len(function.code)} for function in functions]
    header = json.dumps({"sha256": hashlib.sha256(payload).hexdigest(), "functions": described})
    cache.write_whole(path, [_MAGIC, header.encode(), b"\n", payload])


def read(path: Path) -> list[Function] | None:
    """Functions of a file; None if there is none, it is not ours, or it is not as it was written."""
    try:
        with path.open("rb") as file:
            if not cache.is_ours(os.fstat(file.fileno())) or file.readline(len(_MAGIC)) != _MAGIC:
                return None
            header = json.loads(file.readline(_MAX_HEADER))
            payload = file.read()
        if header["sha256"] != hashlib.sha256(payload).hexdigest():
            return None
        return _split(header["functions"], payload)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _split(described: Sequence[dict[str, Any]], payload: bytes) -> list[Function]:
    functions, start = [], 0
    for entry in described:
        arguments = tuple(Argument(**argument) for argument in entry["arguments"])
        code = payload[start : start + entry["code"]]
        functions.append(Function(entry["name"], entry["symbol"], arguments, code))
        start += len(code)
    return functions


def link(functions: Sequence[Function]) -> SimpleNamespace:
    """Callables by name. Each takes arrays and scalars as its kernel does, and fills the arrays.

    A call with other types, shapes in another order, or a read-only array to write to raises TypeError.
    """
    import llvmlite.binding as llvm

    with contextlib.suppress(RuntimeError):  # needed up to llvmlite 0.44, refused from then on
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if llvm.address_of_symbol("NRT_MemInfo_call_dtor") is None:  # named by all code, reached by none: nobody allocates
        llvm.add_symbol("NRT_MemInfo_call_dtor", _address(ctypes.pythonapi.Py_IncRef))
    overloads: dict[str, list[_Entry]] = {}
    for function in functions:
        machine = llvm.Target.from_default_triple().create_target_machine()
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(function.code))
        engine.finalize_object()
        _ENGINES.append(engine)
        entry = _Entry(_prototype(function)(engine.get_function_address(function.symbol)), function.arguments)
        overloads.setdefault(function.name, []).append(entry)
    return SimpleNamespace(**{name: _callable(name, entries) for name, entries in overloads.items()})


@final
@dataclass(frozen=True, slots=True)
class _Entry:
    """Where a function begins, and what it takes."""

    call: Callable[..., int]
    arguments: tuple[Argument, ...]


def _address(function: object) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0  # type: ignore[arg-type]


def _prototype(function: Function) -> Callable[[int], Callable[..., int]]:
    """The C type of a function as numba lays it out: result, error, then each argument in pieces."""
    pieces: list[Any] = [ctypes.c_void_p, ctypes.c_void_p]
    for argument in function.arguments:
        if argument.dimensions < 0:
            pieces.append(_SCALARS[argument.type])
        else:  # owner, parent, size, bytes an element, data, shape, strides
            pieces += [ctypes.c_void_p] * 2 + [ctypes.c_int64] * 2 + [ctypes.c_void_p]
            pieces += [ctypes.c_int64] * (2 * argument.dimensions)
    return ctypes.CFUNCTYPE(ctypes.c_int32, *pieces)  # releases the interpreter's lock while it runs


def _callable(name: str, overloads: Sequence[_Entry]) -> Callable[..., None]:
    def call(*arguments: Any) -> None:  # noqa: ANN401
        for entry in overloads:
            pieces = _pieces(entry.arguments, arguments)
            if pieces is not None:
                break
        else:
            raise TypeError(f"{name}: expected other types, or aligned arrays in C order, writable where it writes")
        if entry.call(ctypes.byref(ctypes.c_void_p()), ctypes.byref(ctypes.c_void_p()), *pieces) not in _DONE:
            raise RuntimeError(f"{name}: the kernel failed")

    return call


def _pieces(expected: tuple[Argument, ...], arguments: tuple[Any, ...]) -> list[Any] | None:
    """Arguments as numba passes them, arrays taken to pieces; None if they are not what the kernel takes."""
    pieces: list[Any] = []
    for wanted, given in zip(expected, arguments, strict=True):
        if wanted.dimensions < 0:
            pieces.append(given)
            continue
        about = given.__array_interface__
        address, read_only = about["data"]
        shape, bytes_each = about["shape"], given.itemsize
        fits = about["typestr"] == wanted.type and len(shape) == wanted.dimensions and address % bytes_each == 0
        if not fits or about["strides"] is not None or (read_only and wanted.writable):  # no strides: in C order
            return None
        pieces += (None, None, given.size, bytes_each, address, *shape, *given.strides)
    return pieces
