"""Where poses stand among the cells of a map, and how far they are from its border: inlined into other kernels."""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels.trigonometry import _cos_sin

_FAR = 1e9  # cells; beyond, whole numbers of 32 bits would not do


@nb.njit(**OPTIONS)
def _place(poses, origin_x, origin_y, cos, sin, yaw, resolution, shift, block):  # type: ignore[no-untyped-def]
    """Columns, rows, cosines and sines of poses in the frame of the map's cells; see ``endpoints.Anchoring``."""
    angles = block[4]
    for i in range(poses.shape[0]):
        dx, dy = poses[i, 0] - origin_x, poses[i, 1] - origin_y
        block[0, i] = (cos * dx + sin * dy) / resolution + shift
        block[1, i] = (cos * dy - sin * dx) / resolution + shift
        angles[i] = poses[i, 2] - yaw
    _cos_sin(angles[: poses.shape[0]], block[2], block[3])


@nb.njit(**OPTIONS)
def _clearance(x, y, cos, sin, width, height):  # type: ignore[no-untyped-def]
    """How long a beam may be for every particle's endpoint to be on the map; below 0 if one is no proper pose.

    In whole cells, rounded down: minima of whole numbers are found in vectors.
    """
    wide, high, least = nb.float64(width), nb.float64(height), np.int32(_FAR)
    for i in range(x.size):
        room = min(min(x[i], wide - x[i]), min(y[i], high - y[i]))
        length = cos[i] * cos[i] + sin[i] * sin[i]
        proper = (abs(x[i]) < _FAR) & (abs(y[i]) < _FAR) & (length < 1.001)
        cells = np.int32(room) if proper else np.int32(0)
        least = min(least, cells)
    return least / 1.001 - 0.001


@nb.njit(**OPTIONS)
def _stay_within(end_x, end_y, clearance):  # type: ignore[no-untyped-def]
    """Whether all endpoints are nearer than ``clearance`` [cells]; those that are not finite are not."""
    within, square = clearance > 0.0, clearance * clearance
    for k in range(end_x.size):
        within &= end_x[k] * end_x[k] + end_y[k] * end_y[k] < square
    return within
