"""Numbers as text, the same as Python's: fixed with nine decimals, or with nine significant digits.

A number times a power of ten is computed as an exact sum of two floats (Dekker 1971), so that the digits are those of
correct rounding. Where it lies within 1e-9 of the middle between two texts, or is out of range, ``done`` says so and
the caller formats those rows in Python.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS

_BYTES = nb.types.Array(nb.uint8, 1, "C", readonly=True)
_ROWS = nb.types.Array(nb.float64, 2, "C", readonly=True)
_DOT, _COMMA, _MINUS, _ZERO, _LINE, _E = 46, 44, 45, 48, 10, 101
_ROOM = 32  # bytes that no number with its comma fills
_LEAST = 1e-280  # below, products would lose bits


@nb.njit(**OPTIONS)
def _product(hi, lo, factor):  # type: ignore[no-untyped-def]
    """(hi + lo) · factor as a sum of two floats; exact where lo is 0."""
    product = hi * factor
    a, b = 134217729.0 * hi, 134217729.0 * factor  # 2²⁷ + 1: halves of 26 bits
    a, b = a - (a - hi), b - (b - factor)
    error = ((a * b - product) + a * (factor - b) + (hi - a) * b) + (hi - a) * (factor - b)
    return product, error + lo * factor


@nb.njit(**OPTIONS)
def _rounded(hi, lo):  # type: ignore[no-untyped-def]
    """Nearest whole number of hi + lo ≥ 0, −1 where that is too close to call."""
    whole = np.floor(hi)
    rest = (hi - whole) + lo
    if abs(rest - 0.5) < 1e-9 or abs(rest + 0.5) < 1e-9 or abs(rest - 1.5) < 1e-9:
        return nb.int64(-1)
    return nb.int64(whole) + nb.int64(np.floor(rest + 0.5))


@nb.njit(**OPTIONS)
def _put_whole(number, least, out, at):  # type: ignore[no-untyped-def]
    """Write a whole number ≥ 0 with at least so many digits; returns where it ends."""
    digits, rest = 1, number // 10
    while rest > 0:
        digits += 1
        rest //= 10
    digits = max(digits, least)
    for k in range(digits - 1, -1, -1):
        out[at + k] = _ZERO + number % 10
        number //= 10
    return at + digits


@nb.njit(**OPTIONS)
def _put_fixed(value, out, at):  # type: ignore[no-untyped-def]
    """Write as ``%.9f``: nothing for NaN and +inf, ``-inf`` for −inf; returns where it ends, −1 if it cannot."""
    if value == -math.inf:
        out[at], out[at + 1], out[at + 2], out[at + 3] = _MINUS, 105, 110, 102
        return at + 4
    if not math.isfinite(value):
        return at
    if abs(value) >= 8e6:
        return -1
    hi, lo = _product(abs(value), 0.0, 1e9)
    number = _rounded(hi, lo)
    if number < 0:
        return -1
    if math.copysign(1.0, value) < 0.0:
        out[at] = _MINUS
        at += 1
    at = _put_whole(number // 1000000000, 1, out, at)
    out[at] = _DOT
    return _put_whole(number % 1000000000, 9, out, at + 1)


@nb.njit(**OPTIONS)
def _scaled(value, power):  # type: ignore[no-untyped-def]
    """Nearest whole number of value · 10^power for 0 ≤ power, −1 where that is too close to call."""
    hi, lo = value, 0.0
    while power > 22:
        hi, lo = _product(hi, lo, 1e22)
        power -= 22
    factor = 1.0
    for _ in range(power):
        factor *= 10.0  # exact up to 10²²
    hi, lo = _product(hi, lo, factor)
    return _rounded(hi, lo)


@nb.njit(**OPTIONS)
def _put_general(value, out, at):  # type: ignore[no-untyped-def]
    """Write 0 ≤ value ≤ 1 as ``%.9g``; returns where it ends, −1 if it cannot."""
    if value == 0.0 and math.copysign(1.0, value) > 0.0:
        out[at] = _ZERO
        return at + 1
    if not _LEAST < value <= 1.0:
        return -1
    exponent = int(np.floor(math.log10(value)))
    number = _scaled(value, 8 - exponent)
    if 0 <= number < 100000000 or number >= 1000000000:  # the logarithm, or rounding up, was one off
        exponent += 1 if number >= 1000000000 else -1
        number = _scaled(value, 8 - exponent)
    if not 100000000 <= number < 1000000000:
        return -1
    digits = 9
    while number % 10 == 0:
        number //= 10
        digits -= 1
    if exponent < -4:
        leading = number
        for _ in range(digits - 1):
            leading //= 10
        out[at] = _ZERO + leading
        at += 1
        if digits > 1:
            out[at] = _DOT
            rest = number
            for _ in range(digits - 1):
                leading *= 10
            at = _put_whole(rest - leading, digits - 1, out, at + 1)
        out[at], out[at + 1] = _E, _MINUS
        return _put_whole(-exponent, 2, out, at + 2)
    if exponent == 0:  # 1 is the only number left
        out[at] = _ZERO + number
        return at + 1
    out[at], out[at + 1] = _ZERO, _DOT
    return _put_whole(number, digits - exponent - 1, out, at + 2)


@nb.njit([nb.void(_ROWS, nb.int64, _BYTES, nb.uint8[::1], nb.int64[::1])], **OPTIONS)
def put_rows(rows, first, prefix, out, done):  # type: ignore[no-untyped-def]
    """Write ``rows`` (n, C): each as prefix, its number from ``first`` on, C − 1 fixed numbers and a general one.

    ``out`` is to have room for 32 bytes a number, and for the prefixes. ``done`` (2,): how many rows were written
    before one that cannot be, or for which there is no room, and where they end.
    """
    at, longest = 0, prefix.size + _ROOM * (rows.shape[1] + 1)
    for n in range(rows.shape[0]):
        done[0], done[1] = n, at
        if out.size - at < longest:
            return
        for k in range(prefix.size):
            out[at + k] = prefix[k]
        at = _put_whole(first + n, 1, out, at + prefix.size)
        for column in range(rows.shape[1]):
            out[at] = _COMMA
            last = column == rows.shape[1] - 1
            at = _put_general(rows[n, column], out, at + 1) if last else _put_fixed(rows[n, column], out, at + 1)
            if at < 0:
                return
        out[at] = _LINE
        at += 1
    done[0], done[1] = rows.shape[0], at
