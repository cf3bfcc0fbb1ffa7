"""Rows of small numbers added side by side: what vector registers are made for.

Loops over such rows are not turned into vector instructions reliably (whether arrays overlap is tested anew for every
row, and the least of the lanes is found one by one), so the loop is given to the compiler in its own terms.
"""

from __future__ import annotations

from typing import Any

import numba as nb
from llvmlite import ir
from numba.core import cgutils as _cgutils
from numba.extending import intrinsic

LANES = 32  # of a row
SIDE = 8  # rows and lanes of a block
cgutils: Any = _cgutils  # without types of its own


def _add(rows: int, lanes: int, context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401
    """Code that adds, and returns the least of the sums: arguments as those of ``_rows``."""

    def data(number: int) -> Any:  # noqa: ANN401
        return context.make_array(signature.args[number])(context, builder, arguments[number]).data

    def part(row: int) -> Any:  # noqa: ANN401
        return builder.bitcast(builder.gep(data(6), [word(row * lanes)]), wide.as_pointer())

    word, small = ir.IntType(64), ir.IntType(16)
    narrow, wide = ir.VectorType(ir.IntType(8), lanes), ir.VectorType(small, lanes)
    _, _, first, last, at, stride, _ = arguments
    totals = [cgutils.alloca_once_value(builder, builder.load(part(row), align=2)) for row in range(rows)]
    with cgutils.for_range_slice(builder, first, last, word(1)) as (beam, _):
        place = builder.add(builder.sext(builder.load(builder.gep(data(1), [beam])), word), at)
        for total in totals:
            cells = builder.bitcast(builder.gep(data(0), [place]), narrow.as_pointer())
            more = builder.zext(builder.load(cells, align=1), wide)
            builder.store(builder.add(builder.load(total), more), total)
            place = builder.add(place, stride)
    least = builder.load(totals[0])
    for row, total in enumerate(totals):
        builder.store(builder.load(total), part(row), align=2)
        least = builder.select(builder.icmp_unsigned("<", builder.load(total), least), builder.load(total), least)
    kind = ir.FunctionType(small, [wide])
    name = f"llvm.vector.reduce.umin.v{lanes}i16"
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), [least])


def _signature(cells: Any, starts: Any, sums: Any) -> Any:  # noqa: ANN401
    return nb.uint16(cells, starts, nb.int64, nb.int64, nb.int64, nb.int64, sums)


def _rows(_: Any, cells: Any, starts: Any, first: Any, last: Any, at: Any, stride: Any, sums: Any) -> Any:  # noqa: ANN401, ARG001
    """Add ``cells[starts[b] + at : … + 32]`` (uint8) for b from ``first`` to ``last`` to ``sums`` (32,) uint16.

    Returns the least of the sums. ``starts`` are int32, ``stride`` is of no use here; nothing is checked.
    """
    return _signature(cells, starts, sums), lambda *code: _add(1, LANES, *code)


def _blocks(_: Any, cells: Any, starts: Any, first: Any, last: Any, at: Any, stride: Any, sums: Any) -> Any:  # noqa: ANN401, ARG001
    """Add 8 × 8 cells, rows ``stride`` apart, to ``sums`` (64,), else as ``_rows``."""
    return _signature(cells, starts, sums), lambda *code: _add(SIDE, SIDE, *code)


add_rows: Any = intrinsic(_rows)
add_blocks: Any = intrinsic(_blocks)
