"""Particles as the rows of messages."""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels.trigonometry import _cos_sin

_ROW = nb.types.Array(nb.float64, 1, "C", readonly=True)
_POSES = nb.types.Array(nb.float64, 2, "C", readonly=True)
_TABLE = nb.float64[:, ::1]
_BLOCK = 512


@nb.njit([nb.void(_POSES, _ROW, nb.float64, nb.float64, _TABLE, _TABLE, _TABLE)], **OPTIONS)
def rounded_rows(poses, weights, places, turns, rows, particles, scratch):  # type: ignore[no-untyped-def]
    """Fill ``rows`` (N, 7) with x, y, z and quaternion of ``poses`` (N, 3), ``particles`` (N, 8) with weights as well.

    Positions are rounded to multiples of 1/``places``, quaternions to multiples of 1/``turns``. Scratch: (3, 512).
    """
    for start in range(0, poses.shape[0], _BLOCK):
        size = min(_BLOCK, poses.shape[0] - start)
        half, cos, sin = scratch[0, :size], scratch[1, :size], scratch[2, :size]
        for i in range(size):
            half[i] = 0.5 * poses[start + i, 2]
        _cos_sin(half, cos, sin)
        for i in range(size):
            cos[i] = np.rint(cos[i] * turns) / turns
            sin[i] = np.rint(sin[i] * turns) / turns
        for i in range(size):
            n = start + i
            x, y = np.rint(poses[n, 0] * places) / places, np.rint(poses[n, 1] * places) / places
            for out in (rows, particles):
                out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4] = x, y, 0.0, 0.0, 0.0
                out[n, 5], out[n, 6] = sin[i], cos[i]
            particles[n, 7] = weights[n]
