"""The best pose of a scan by trying them all. Lengths are in cells, angles in radians."""

from __future__ import annotations

import math

Cells = list[list[bool]]
Point = tuple[float, float]


def distances(occupied: Cells, clamp: float) -> list[list[float]]:
    """Distance of every cell's centre to that of the nearest occupied cell, at most ``clamp``."""
    walls = [(r, c) for r, row in enumerate(occupied) for c, wall in enumerate(row) if wall]
    return [
        [min([clamp, *(math.hypot(r - i, c - j) for i, j in walls)]) for c in range(len(occupied[0]))]
        for r in range(len(occupied))
    ]


def log_p(distance: float, sigma: float, z_hit: float, z_rand: float, r_max: float) -> float:
    """Likelihood field of one beam."""
    return math.log(z_hit * math.exp(-(distance**2) / (2.0 * sigma**2)) + z_rand / r_max)


def score(field: list[list[float]], off: float, ends: list[Point], angle: float, row: int, column: int) -> float:
    """Sum over beams of the field where they end, from the centre of a cell; ``off`` is what lies off the map."""
    c, s = math.cos(angle), math.sin(angle)
    total = 0.0
    for x, y in ends:
        j, i = column + math.floor(0.5 + (c * x - s * y)), row + math.floor(0.5 + (s * x + c * y))
        inside = 0 <= i < len(field) and 0 <= j < len(field[0])
        total += field[i][j] if inside else off
    return total


def every_score(
    field: list[list[float]], off: float, ends: list[Point], angles: list[float], allowed: Cells
) -> list[tuple[float, int, int, int]]:
    """Score, angle's number, row and column of every pose, in the order (angle, row, column)."""
    return [
        (score(field, off, ends, angle, row, column), k, row, column)
        for k, angle in enumerate(angles)
        for row in range(len(field))
        for column in range(len(field[0]))
        if allowed[row][column]
    ]


def best(scores: list[tuple[float, int, int, int]]) -> tuple[float, int, int, int]:
    """The greatest score; of equals the first in the order (angle, row, column)."""
    return min(scores, key=lambda one: (-one[0], one[1:]))
