"""Shortest 8-neighbour paths from a set of cells, in two raster passes."""

from __future__ import annotations

import math

import numba as nb

from mclcli.kernels import OPTIONS

_DIAGONAL = math.sqrt(2.0)


@nb.njit([nb.void(nb.float64[:, ::1])], **OPTIONS)
def two_pass_chamfer(distance):  # type: ignore[no-untyped-def]
    """Relax ``distance`` (H, W), 0 at the seeds and +inf elsewhere, to path lengths in cells, in place.

    With steps 1 and √2 two passes reach the shortest path. Source: Borgefors 1986.
    """
    height, width = distance.shape
    for row in range(height):
        for column in range(width):
            best = distance[row, column]
            if column > 0:
                best = min(best, distance[row, column - 1] + 1.0)
            if row > 0:
                best = min(best, distance[row - 1, column] + 1.0)
                if column > 0:
                    best = min(best, distance[row - 1, column - 1] + _DIAGONAL)
                if column + 1 < width:
                    best = min(best, distance[row - 1, column + 1] + _DIAGONAL)
            distance[row, column] = best
    for row in range(height - 1, -1, -1):
        for column in range(width - 1, -1, -1):
            best = distance[row, column]
            if column + 1 < width:
                best = min(best, distance[row, column + 1] + 1.0)
            if row + 1 < height:
                best = min(best, distance[row + 1, column] + 1.0)
                if column + 1 < width:
                    best = min(best, distance[row + 1, column + 1] + _DIAGONAL)
                if column > 0:
                    best = min(best, distance[row + 1, column - 1] + _DIAGONAL)
            distance[row, column] = best
