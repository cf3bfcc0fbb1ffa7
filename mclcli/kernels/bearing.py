"""Sum of log-likelihoods of bearings to landmarks: the loop of ``mclcli.sensors.bearing``, which see.

What bounds it: arithmetic in vectors, 80 instructions for a vector of particles and a landmark, one of them a division.
A bearing's error is one arc tangent: the offset to the landmark is turned by the heading and by the bearing as seen, so
that nothing is left to subtract and to wrap. The caller has the same operations in NumPy, and the same bits.
"""

from __future__ import annotations

import numba as nb

from mclcli.kernels import OPTIONS
from mclcli.kernels._exponential import _exp2, _log
from mclcli.kernels.trigonometry import _cos_sin, _unsigned_angle

_BLOCK = 256  # particles whose products stay in the first-level cache while all landmarks pass over them
_POSES = nb.types.Array(nb.float64, 2, "C", readonly=True)


@nb.njit(**OPTIONS)
def _place(poses, origin_x, origin_y, block):  # type: ignore[no-untyped-def]
    """Camera's x and y, cosine and sine of the heading."""
    size, yaw, cos, sin = poses.shape[0], block[0], block[2], block[3]
    for i in range(size):
        yaw[i] = poses[i, 2]
    _cos_sin(yaw[:size], cos, sin)
    for i in range(size):
        block[0, i] = poses[i, 0] + cos[i] * origin_x - sin[i] * origin_y
        block[1, i] = poses[i, 1] + sin[i] * origin_x + cos[i] * origin_y


@nb.njit(**OPTIONS)
def _multiply(block, size, landmark_x, landmark_y, along, across, factor, peak, rest, floor, product):  # type: ignore[no-untyped-def]
    """Multiply ``product`` by p of one bearing with cosine ``along`` and sine ``across``."""
    camera_x, camera_y, cos, sin = block[0, :size], block[1, :size], block[2, :size], block[3, :size]
    for i in range(size):
        dx, dy = landmark_x - camera_x[i], landmark_y - camera_y[i]
        dx = 1.0 if (dx == 0.0) & (dy == 0.0) else dx  # as the arc tangent of 0/0 has it
        ahead, left = cos[i] * dx + sin[i] * dy, cos[i] * dy - sin[i] * dx
        error = _unsigned_angle(along * ahead + across * left, across * ahead - along * left)
        p = peak * _exp2(factor * (error * error)) + rest
        product[i] *= max(p, floor)


@nb.njit([nb.void(_POSES, _POSES, *(nb.float64,) * 6, nb.int64, nb.float64[::1], nb.float64[:, ::1])], **OPTIONS)
def sum_log_p(  # type: ignore[no-untyped-def]
    poses, sightings, origin_x, origin_y, factor, peak, rest, floor, factors, out, block
):
    """Add to ``out`` (N,) the sum over bearings of log max(p, ``floor``) for ``poses`` (N, 3) of the base in map.

    ``sightings`` (4, M): the landmarks' x and y in map, cosine and sine of the bearings; ``origin`` is the camera's in
    the base frame. p = peak·2^(factor·e²) + rest of a bearing's error e [rad]; ``factors`` of them are multiplied
    before a logarithm is taken. Scratch: ``block`` (5, 256).
    """
    x, y, along, across = sightings[0], sightings[1], sightings[2], sightings[3]
    for start in range(0, poses.shape[0], _BLOCK):
        size, total = min(_BLOCK, poses.shape[0] - start), out[start : start + _BLOCK]
        product = block[4, :size]
        _place(poses[start : start + size], origin_x, origin_y, block)
        for first in range(0, x.size, max(factors, 1)):
            product[:] = 1.0
            for m in range(first, min(first + max(factors, 1), x.size)):
                _multiply(block, size, x[m], y[m], along[m], across[m], factor, peak, rest, floor, product)
            for i in range(size):
                total[i] += _log(product[i])
