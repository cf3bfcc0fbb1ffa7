"""Whether gates read arrays right, found out before a kernel runs.

A gate (``mclcli.native.array_gate``) reads NumPy's header at fixed offsets, and hands a kernel an array in pieces, as
numba lays it out. Here it gets arrays of known shape, and a function in the kernel's place that notes the pieces. The
header is looked at from Python first, so that no gate follows an address that is none. A gate takes 0.1 ms.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mclcli.native.array_gate import HEADER, REFUSED

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.native.array_gate import Argument

    Gate = Callable[..., int]
    Pieces = list[int | float]

SCALARS: Final[dict[str, Any]] = {"float64": ctypes.c_double, "int64": ctypes.c_int64, "bool": ctypes.c_uint8}
_VALUES: Final[dict[str, Any]] = {"float64": -0.75, "int64": -(2**40) - 3, "bool": 1}
_NO_KERNEL = 7  # what the function in the kernel's place returns


def header_is_known() -> bool:
    """Whether an array's header has its fields where gates read them."""
    array = np.zeros((3, 5), np.uint16)
    at, kind, whole = id(array), id(array.dtype), ctypes.c_int64.from_address
    half = ctypes.c_int32.from_address
    known = (
        HEADER.flags + 4 <= np.ndarray.__basicsize__
        and HEADER.type_number + 4 <= np.dtype.__basicsize__
        and whole(at + HEADER.type).value == id(np.ndarray)
        and whole(at + HEADER.data).value == array.ctypes.data
        and half(at + HEADER.dimensions).value == array.ndim
        and half(at + HEADER.flags).value == array.flags.num
        and whole(at + HEADER.dtype).value == kind
        and half(kind + HEADER.type_number).value == array.dtype.num
        and ctypes.c_char.from_address(kind + HEADER.byte_order).value == b"="
    )
    at_shape, at_strides = whole(at + HEADER.shape).value, whole(at + HEADER.strides).value
    if not (known and at_strides - at_shape == 8 * array.ndim):  # they stand one behind the other
        return False
    sides = (ctypes.c_int64 * 4).from_address(at_shape)
    return tuple(sides) == array.shape + array.strides


def gate_is_right(gate: Callable[..., Gate], arguments: Sequence[Argument]) -> bool:
    """Whether a gate passes arrays and numbers on as they are, and refuses those that are not what it takes.

    ``gate`` makes the gate for a kernel's address.
    """
    given, expected = _examples(arguments)
    pieces: list[Pieces] = []

    def note(_: int, __: int, *got: float) -> int:
        pieces.append(list(got))
        return _NO_KERNEL

    takes = [kind for argument in arguments for kind in _types(argument)]
    kernel = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_int64, *takes)(note)
    call = gate(ctypes.cast(kernel, ctypes.c_void_p).value)
    if call(*given) != _NO_KERNEL or pieces != [expected]:
        return False
    wrong = [(k, array) for k, a in enumerate(arguments) if a.dimensions >= 0 for array in _refused(a, given[k])]
    return all(call(*given[:k], array, *given[k + 1 :]) == REFUSED for k, array in wrong) and len(pieces) == 1


def _types(argument: Argument) -> list[Any]:
    """C types of an argument's pieces."""
    if argument.dimensions < 0:
        return [SCALARS[argument.type]]
    return [ctypes.c_int64] * (5 + 2 * argument.dimensions)


def _examples(arguments: Sequence[Argument]) -> tuple[list[Any], Pieces]:
    """What to hand to a gate, and the pieces that a kernel is to get."""
    given: list[Any] = []
    expected: Pieces = []
    for number, argument in enumerate(arguments):
        if argument.dimensions < 0:
            given.append(_VALUES[argument.type])
            expected.append(_VALUES[argument.type])
            continue
        array = np.zeros(tuple(range(2 + number, 2 + number + argument.dimensions)), argument.type)
        array.flags.writeable = argument.writable
        given.append(array)
        expected += [0, 0, array.size, array.itemsize, array.ctypes.data, *array.shape, *array.strides]
    return given, expected


def _refused(argument: Argument, array: Any) -> list[Any]:  # noqa: ANN401
    """Nothing, another type, another order of bytes, one dimension more, no C order, and read-only where it writes."""
    other = np.zeros(array.shape, np.complex64)
    swapped = array.astype(array.dtype.newbyteorder()) if array.itemsize > 1 else other
    apart = np.zeros((2 * array.shape[0], *array.shape[1:]), array.dtype)[::2]
    locked = array.copy()
    locked.flags.writeable = False
    return [None, other, swapped, array[np.newaxis], apart, *([locked] if argument.writable else [])]
