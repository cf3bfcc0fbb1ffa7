"""Compiled kernels as files: written once with the compiler at hand, called later without importing it.

Importing numba takes longer than most jobs of the compiled loops. A kernel needs nothing of it at run time: its machine
code is linked by LLVM, and called through a gate that takes NumPy arrays (``mclcli.native.array_gate``). A file is a
magic line, one line of JSON (names, symbols and arguments of the functions, the processor they are for, SHA-256 of all
that) and the payload: object code.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import json
from dataclasses import asdict, dataclass
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from mclcli import cache
from mclcli.native import array_gate, self_test
from mclcli.native.array_gate import Argument

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

_MAGIC = b"mcl machine code\n"
_DONE = (0, -2)  # numba's return codes for a value and for None
_ENGINES: list[object] = []  # what owns the code must outlive it


@final
class UntrustedGateError(Exception):
    """A gate that does not read arrays right: its kernel must not run."""


@final
@dataclass(frozen=True, slots=True)
class Function:
    """One signature of a kernel: its name, its symbol within the object code, what it takes, and its gate's code."""

    name: str
    symbol: str
    arguments: tuple[Argument, ...]
    code: bytes
    gate: bytes


def write(path: Path, functions: Sequence[Function]) -> None:
    """Keep functions for this processor in a file of the user's own, moved into place whole.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    payload = b"".join(function.code + function.gate for function in functions)
    described = [asdict(f) | {"code": len(f.code), "gate": len(f.gate)} for f in functions]
    header = {"sha256": _digest(described, payload), "processor": _processor(), "functions": described}
    cache.write_whole(path, [_MAGIC, json.dumps(header).encode(), b"\n", payload])


def read(path: Path) -> list[Function] | None:
    """Functions of a file; None if there is none, it is for another processor, not ours, or not as it was written."""
    try:
        with cache.open_kept(path) as file:
            magic, line, payload = file.readall().split(b"\n", 2)
        if magic + b"\n" != _MAGIC:
            return None
        header = json.loads(line)
        if header["processor"] != _processor():  # files are copied from machine to machine
            return None
        if header["sha256"] != _digest(header["functions"], payload):
            return None
        return _split(header["functions"], payload)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _digest(described: Sequence[dict[str, Any]], payload: bytes) -> str:
    """SHA-256 of all that a file must hold here: a wrong name or argument is as bad as wrong code."""
    digest = hashlib.sha256(json.dumps([_processor(), described], sort_keys=True).encode())
    digest.update(payload)
    return digest.hexdigest()


def _processor() -> str:
    """Name and features of this processor, without which machine code may end in an illegal instruction."""
    import llvmlite.binding as llvm

    return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


def _split(described: Sequence[dict[str, Any]], payload: bytes) -> list[Function]:
    functions, start = [], 0
    for entry in described:
        arguments = tuple(Argument(**argument) for argument in entry["arguments"])
        between = start + entry["code"]
        end = between + entry["gate"]
        code, gate = payload[start:between], payload[between:end]
        functions.append(Function(entry["name"], entry["symbol"], arguments, code, gate))
        start = end
    return functions


def link(functions: Sequence[Function]) -> SimpleNamespace:
    """Callables by name. Each takes arrays and scalars as its kernel does, and fills the arrays.

    A call with other types, shapes in another order, or a read-only array to write to raises TypeError.

    Raises
    ------
    UntrustedGateError
        If a gate does not read arrays right.

    """
    if not self_test.header_is_known():
        raise UntrustedGateError("NumPy's arrays are laid out otherwise")
    overloads: dict[str, list[_Entry]] = {}
    for function in functions:
        engine = engine_of(function.code, function.gate)
        kernel, gate = (engine.get_function_address(symbol) for symbol in (function.symbol, array_gate.SYMBOL))
        through = _prototype(function)(gate)
        if not self_test.gate_is_right(
            lambda other, call=through: partial(call, other, id(np.ndarray)), function.arguments
        ):
            raise UntrustedGateError(f"the gate of kernel {function.name} does not pass arrays on as they are")
        entry = _Entry(partial(through, kernel, id(np.ndarray)), len(function.arguments))
        overloads.setdefault(function.name, []).append(entry)
    return SimpleNamespace(**{name: _callable(name, entries) for name, entries in overloads.items()})


def engine_of(*codes: bytes) -> Any:  # noqa: ANN401 - llvmlite's
    """LLVM's engine that has linked these object codes."""
    import llvmlite.binding as llvm

    with contextlib.suppress(RuntimeError):  # needed up to llvmlite 0.44, refused from then on
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if llvm.address_of_symbol("NRT_MemInfo_call_dtor") is None:  # named by all code, reached by none: nobody allocates
        llvm.add_symbol("NRT_MemInfo_call_dtor", _address(ctypes.pythonapi.Py_IncRef))
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    for code in codes:
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _ENGINES.append(engine)
    return engine


@final
@dataclass(frozen=True, slots=True)
class _Entry:
    """A kernel behind its gate, and how many arguments it takes."""

    call: Callable[..., int]
    count: int


def _address(function: object) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0  # type: ignore[arg-type]


def _prototype(function: Function) -> Callable[[int], Callable[..., int]]:
    """The C type of a function's gate, which releases the interpreter's lock while it runs."""
    takes: list[Any] = [
        ctypes.py_object if a.dimensions >= 0 else self_test.SCALARS[a.type] for a in function.arguments
    ]
    return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_int64, *takes)


def _callable(name: str, overloads: Sequence[_Entry]) -> Callable[..., None]:
    calls, count = [entry.call for entry in overloads], overloads[0].count

    def call(*arguments: Any) -> None:  # noqa: ANN401
        if len(arguments) != count:  # C would not notice
            raise TypeError(f"{name}: expected {count} arguments, got {len(arguments)}")
        for overload in calls:
            code = overload(*arguments)
            if code in _DONE:
                return
            if code != array_gate.REFUSED:
                raise RuntimeError(f"{name}: the kernel failed")
        raise TypeError(f"{name}: expected other types, or aligned arrays in C order, writable where it writes")

    return call
