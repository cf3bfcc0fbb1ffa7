"""Exponential, logarithm and error function with fused operations, for kernels that have no twin in NumPy.

Polynomials are minimax ones (Remez), evaluated with fused multiplications and additions that are written out: what a
number becomes does not depend on its place in a vector. They take three quarters of the time of separate ones
(``_exponential``), which NumPy can repeat. Processors before 2013 lack the instruction and take the C library's
function, slowly. Tests state how near these are to the library's.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numba.extending import intrinsic

from mclcli.kernels import OPTIONS

_WHOLE = 1.5 * 2.0**52


def _fused(context, a, b, c):  # type: ignore[no-untyped-def]
    """a·b + c, rounded once."""
    del context, a, b, c
    number = nb.float64
    return number(number, number, number), lambda _, builder, __, arguments: builder.fma(*arguments)


_fma: Any = intrinsic(_fused)


@nb.njit(**OPTIONS)
def _exp_in_parts(x):  # type: ignore[no-untyped-def]
    """2^k and q with e^x = 2^k + 2^k·q for x ≤ 0; 2^k is 1 and q is e^x − 1 itself where x is near 0.

    x − k·log 2 in two parts, then a polynomial whose error is below 4e-18. k is rounded by adding 1.5·2^52, where
    doubles are whole numbers whose last bits are k's: not every processor converts vectors to whole numbers.
    """
    x = max(x, -708.0)
    shifted = _fma(x, 1.44269504088896338700, _WHOLE)
    k = shifted - _WHOLE
    r = _fma(k, -1.90821492927058770002e-10, _fma(k, -6.93147180369123816490e-01, x))
    q = _fma(r, 2.5117503704849524e-08, 2.7630837714798423e-07)
    q = _fma(r, q, 2.7557217516495798e-06)
    q = _fma(r, q, 2.4801491310011194e-05)
    q = _fma(r, q, 1.9841269915895103e-04)
    q = _fma(r, q, 1.3888888945528767e-03)
    q = _fma(r, q, 8.333333333307975e-03)
    q = _fma(r, q, 4.166666666652201e-02)
    q = _fma(r, q, 0.166666666666667)
    q = _fma(r, q, 0.5000000000000012)
    return np.int64((np.float64(shifted).view(np.int64) + 1023) << 52).view(np.float64), _fma(r * r, q, r)


@nb.njit(**OPTIONS)
def _exp(x):  # type: ignore[no-untyped-def]
    """e^x for x ≤ 0, e^−708 below −708."""
    power, q = _exp_in_parts(x)
    return _fma(power, q, power)


@nb.njit(**OPTIONS)
def _log(x):  # type: ignore[no-untyped-def]
    """Logarithm of x from 1e-300 to 1e300; NaN and what is infinite come back as they are.

    x = 2^k·(1 + f) with 1 + f from √½ to √2, log(1 + f) from s = f/(2 + f). Source: fdlibm 5.3, e_log.c.
    """
    bits = np.float64(x).view(np.int64)
    k = (bits - 0x3FE6A09E667F3BCD) >> 52
    f = np.int64(bits - (k << 52)).view(np.float64) - 1.0
    s = f / (2.0 + f)
    z = s * s
    r = _fma(z, 1.479819860511658591e-01, 1.531383769920937332e-01)
    r = _fma(z, r, 1.818357216161805012e-01)
    r = _fma(z, r, 2.222219843214978396e-01)
    r = _fma(z, r, 2.857142874366239149e-01)
    r = _fma(z, r, 3.999999999940941908e-01)
    r = z * _fma(z, r, 6.666666666666735130e-01)
    half, whole = 0.5 * f * f, np.float64(k)
    near = f - (half - _fma(s, half + r, whole * 1.90821492927058770002e-10))
    return _fma(whole, 6.93147180369123816490e-01, near) if abs(x) < np.inf else x


@nb.njit(**OPTIONS)
def _erfc(x):  # type: ignore[no-untyped-def]
    """What the error function of x ≥ 0 lacks to 1, with an error below 6e-16.

    e^(x²)·erfc(x) is a polynomial of (x − 3)/(x + 3), as in Shepherd and Laframboise 1981, Math. Comp. 36.
    """
    x = min(x, 5.9)
    t = (x - 3.0) / (x + 3.0)
    p = _fma(t, -5.654708518778327e-07, -6.196664275656342e-06)
    p = _fma(t, p, -2.5950410700790922e-05)
    p = _fma(t, p, -3.8009832317893766e-05)
    p = _fma(t, p, 3.9172571178652997e-05)
    p = _fma(t, p, 2.722545226881237e-05)
    p = _fma(t, p, -6.067497681965105e-04)
    p = _fma(t, p, 7.038911765076771e-04)
    p = _fma(t, p, 4.268015370489634e-03)
    p = _fma(t, p, -2.4392730833971324e-02)
    p = _fma(t, p, 7.166580493230303e-02)
    p = _fma(t, p, -1.501159392480772e-01)
    p = _fma(t, p, 2.4560380160163794e-01)
    p = _fma(t, p, -3.2623356004277815e-01)
    p = _fma(t, p, 1.7900115118149615e-01)
    return p * _exp(-(x * x))
