"""Exponential and logarithm of many numbers, in vectors: inlined into other kernels.

Polynomials are minimax ones, evaluated by pairs of terms so that few steps wait for one another. Every operation is
rounded by itself, none are fused: NumPy gets the same bits (``mclcli.geometry.exponential``), and what a number becomes
does not depend on its place in a vector. Tests state how near these are to the library's.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS

_WHOLE = 1.5 * 2.0**52


@nb.njit(**OPTIONS)
def _exp2(x):  # type: ignore[no-untyped-def]
    """2^x for x ≤ 0, 2^−1010 below −1010.

    2^x = 2^k + 2^k·q with k the nearest whole number; q = 2^f − 1 of the rest f is a polynomial whose error is below
    7e-18. k is rounded by adding 1.5·2^52, where doubles are whole numbers whose last bits are k's: not every processor
    converts vectors to whole numbers.
    """
    x = max(x, -1010.0)
    shifted = x + _WHOLE
    f = x - (shifted - _WHOLE)
    z = f * f
    zz = z * z
    low = (0.6931471805599453 + f * 0.24022650695910097) + z * (0.0555041086648216 + f * 0.009618129107606888)
    high = 0.0013333558146416936 + f * 0.0001540353044173605
    high += z * (1.525273382983612e-05 + f * 1.321544258792169e-06)
    top = (1.0178062445845774e-07 + f * 7.072585949269223e-09) + z * 4.4549605981865186e-10
    q = f * (low + zz * (high + zz * top))
    power = np.int64((np.float64(shifted).view(np.int64) + 1023) << 52).view(np.float64)
    return power + power * q


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
    zz = z * z
    even = zz * (3.999999999940941908e-01 + zz * (2.222219843214978396e-01 + zz * 1.531383769920937332e-01))
    odd = 6.666666666666735130e-01 + zz * (
        2.857142874366239149e-01 + zz * (1.818357216161805012e-01 + zz * 1.479819860511658591e-01)
    )
    half, whole = 0.5 * f * f, np.float64(k)
    near = f - (half - (s * (half + (even + z * odd)) + whole * 1.90821492927058770002e-10))
    return whole * 6.93147180369123816490e-01 + near if abs(x) < np.inf else x
