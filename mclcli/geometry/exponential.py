"""Powers of two and logarithms from IEEE arithmetic alone: the same bits from NumPy and from compiled code.

Libraries differ in the last bit. These are the formulas of ``mclcli.kernels._exponential``, operation by operation;
within two units in the last place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

LOG2_E = 1.44269504088896338700
_WHOLE = 1.5 * 2.0**52


def exp2(x: FloatArray) -> FloatArray:
    """2^x of x ≤ 0, 2^−1010 below −1010; any shape. NaN stays NaN.

    2^x = 2^k + 2^k·q with k the nearest whole number, q = 2^f − 1 a polynomial of the rest f (minimax, error 7e-18).
    """
    x = np.maximum(x, -1010.0)
    shifted = x + _WHOLE
    f = x - (shifted - _WHOLE)
    z = f * f
    zz = z * z
    low = (0.6931471805599453 + f * 0.24022650695910097) + z * (0.0555041086648216 + f * 0.009618129107606888)
    high = 0.0013333558146416936 + f * 0.0001540353044173605
    high += z * (1.525273382983612e-05 + f * 1.321544258792169e-06)
    top = (1.0178062445845774e-07 + f * 7.072585949269223e-09) + z * 4.4549605981865186e-10
    q = f * (low + zz * (high + zz * top))
    power = ((shifted.view(np.int64) + 1023) << 52).view(np.float64)
    return np.asarray(power + power * q)


def log(x: FloatArray) -> FloatArray:
    """Logarithm of x from 1e-300 to 1e300, any shape; NaN and what is infinite come back as they are.

    x = 2^k·(1 + f) with 1 + f from √½ to √2, log(1 + f) from s = f/(2 + f). Source: fdlibm 5.3, e_log.c.
    """
    bits = x.view(np.int64)
    k = (bits - 0x3FE6A09E667F3BCD) >> 52
    f = (bits - (k << 52)).view(np.float64) - 1.0
    s = f / (2.0 + f)
    z = s * s
    zz = z * z
    even = zz * (3.999999999940941908e-01 + zz * (2.222219843214978396e-01 + zz * 1.531383769920937332e-01))
    odd = 6.666666666666735130e-01 + zz * (
        2.857142874366239149e-01 + zz * (1.818357216161805012e-01 + zz * 1.479819860511658591e-01)
    )
    half, whole = 0.5 * f * f, k.astype(np.float64)
    near = f - (half - (s * (half + (even + z * odd)) + whole * 1.90821492927058770002e-10))
    return np.where(np.abs(x) < np.inf, whole * 6.93147180369123816490e-01 + near, x)
