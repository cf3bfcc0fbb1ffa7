"""The gate before a kernel: takes NumPy's arrays as they are, tests them, and hands the kernel their parts.

Asking NumPy for an array's address, shape and strides from Python costs 1.3 µs an array, and passing them on in pieces
as much again. A gate is machine code made for a kernel's arguments that reads them where they lie: in the array's
header, whose layout every extension module relies on; ``mclcli.native.self_test`` looks whether it is as stated here.
Source: NumPy, ``ndarraytypes.h``, ``PyArrayObject_fields`` and ``PyArray_Descr``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


@final
@dataclass(frozen=True, slots=True)
class Header:
    """Where an array's header, and its dtype's, keep things [bytes from the object's address]."""

    type: int
    data: int
    dimensions: int
    shape: int
    strides: int
    dtype: int
    flags: int
    byte_order: int
    type_number: int


_HEAD = object.__basicsize__  # bytes; every object begins with it, and it ends with the address of its type
HEADER: Final = Header(
    type=_HEAD - 8,
    data=_HEAD,
    dimensions=_HEAD + 8,
    shape=_HEAD + 16,
    strides=_HEAD + 24,
    dtype=_HEAD + 40,
    flags=_HEAD + 48,
    byte_order=_HEAD + 10,
    type_number=_HEAD + 12,
)
SYMBOL: Final = "gate"
REFUSED: Final = -100  # none of numba's return codes
_IN_C_ORDER, _ALIGNED, _WRITABLE = 0x1, 0x100, 0x400


@final
@dataclass(frozen=True, slots=True)
class Argument:
    """What a kernel takes: a scalar (``dimensions`` −1) or a C-contiguous array of a type, writable or not."""

    type: str
    dimensions: int = -1
    writable: bool = False


def object_code(arguments: Sequence[Argument]) -> bytes:
    """Machine code of the gate for these arguments, on this processor; it refers to nothing outside.

    It takes the kernel's address, that of the type ``numpy.ndarray``, then the arguments, arrays as objects. It returns
    what the kernel returns, or ``REFUSED`` if an array is not what the kernel takes.
    """
    import llvmlite.binding as llvm
    from llvmlite import ir

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module, scalars = ir.Module(), _scalars()
    takes = [scalars[argument.type] if argument.dimensions < 0 else ir.IntType(64) for argument in arguments]
    function = ir.Function(module, ir.FunctionType(ir.IntType(32), [ir.IntType(64), ir.IntType(64), *takes]), SYMBOL)
    _Writer(function).write(arguments)
    machine = llvm.Target.from_default_triple().create_target_machine()
    return bytes(machine.emit_object(llvm.parse_assembly(str(module))))


def _scalars() -> dict[str, Any]:
    from llvmlite import ir

    return {"float64": ir.DoubleType(), "int64": ir.IntType(64), "bool": ir.IntType(8)}


class _Writer:
    """Writes a gate's instructions; addresses are whole numbers."""

    def __init__(self, function: Any) -> None:  # noqa: ANN401
        from llvmlite import ir

        self.ir, self.function = ir, function
        self.at = ir.IRBuilder(function.append_basic_block())
        self.refused = function.append_basic_block()
        ir.IRBuilder(self.refused).ret(ir.Constant(ir.IntType(32), REFUSED))

    def write(self, arguments: Sequence[Argument]) -> None:
        """The whole gate."""
        kernel, array_type, *given = self.function.args
        unused = self.at.ptrtoint(self.at.alloca(self.ir.IntType(64)), self.ir.IntType(64))
        pieces = [unused, unused]  # the kernel's result and error: it has neither
        for argument, value in zip(arguments, given, strict=True):
            if argument.dimensions < 0:
                pieces.append(value)
            else:
                self._test_array(argument, value, array_type)
                pieces += self._parts(argument, value)
        signature = self.ir.FunctionType(self.ir.IntType(32), [piece.type for piece in pieces])
        self.at.ret(self.at.call(self.at.inttoptr(kernel, signature.as_pointer()), pieces))

    def _test_array(self, argument: Argument, array: Any, array_type: Any) -> None:  # noqa: ANN401
        self._require(self._is(self._load(array, HEADER.type), array_type))
        flags = _IN_C_ORDER | _ALIGNED | (_WRITABLE if argument.writable else 0)
        there = self.at.and_(self._load(array, HEADER.flags, 32), self._number(flags, 32))
        self._require(self._is(there, self._number(flags, 32)))
        self._require(self._is(self._load(array, HEADER.dimensions, 32), self._number(argument.dimensions, 32)))
        dtype = self._load(array, HEADER.dtype)
        self._require(self._is_any(self._load(dtype, HEADER.byte_order, 8), [ord("="), ord("|")]))
        self._require(self._is_any(self._load(dtype, HEADER.type_number, 32), _type_numbers(argument.type)))

    def _parts(self, argument: Argument, array: Any) -> list[Any]:  # noqa: ANN401
        """As numba lays an array out: owner, parent, size, bytes an element, data, shape, strides."""
        at_shape, at_strides, axes = (
            self._load(array, HEADER.shape),
            self._load(array, HEADER.strides),
            range(argument.dimensions),
        )
        shape, strides = ([self._load(at, 8 * axis) for axis in axes] for at in (at_shape, at_strides))
        size = self._number(1)
        for side in shape:
            size = self.at.mul(size, side)
        nobody, bytes_each = self._number(0), self._number(np.dtype(argument.type).itemsize)
        return [nobody, nobody, size, bytes_each, self._load(array, HEADER.data), *shape, *strides]

    def _number(self, value: int, bits: int = 64) -> Any:  # noqa: ANN401
        return self.ir.Constant(self.ir.IntType(bits), value)

    def _load(self, address: Any, offset: int, bits: int = 64) -> Any:  # noqa: ANN401
        there = self.at.add(address, self._number(offset))
        return self.at.load(self.at.inttoptr(there, self.ir.IntType(bits).as_pointer()))

    def _is(self, value: Any, other: Any) -> Any:  # noqa: ANN401
        return self.at.icmp_unsigned("==", value, other)

    def _is_any(self, value: Any, numbers: Sequence[int]) -> Any:  # noqa: ANN401
        found = self._number(0, 1)
        for number in numbers:
            found = self.at.or_(found, self._is(value, self._number(number, value.type.width)))
        return found

    def _require(self, condition: Any) -> None:  # noqa: ANN401
        going_on = self.function.append_basic_block()
        self.at.cbranch(condition, going_on, self.refused)
        self.at.position_at_end(going_on)


def _type_numbers(typestr: str) -> list[int]:
    """NumPy's numbers of the types that look like this: C has two names for some."""
    return [np.dtype(code).num for code in np.typecodes["AllInteger"] + "?fd" if np.dtype(code).str == typestr]
