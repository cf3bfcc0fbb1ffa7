"""What a smoother makes of beams and of odometry's noise, a number at a time, derivatives by differences."""

from __future__ import annotations

import math

Pose = list[float]
Point = tuple[float, float]
_H = 1e-6


def interpolated(
    cells: list[list[float]], resolution: float, origin: Pose, furthest: float, x: float, y: float
) -> float:
    """Distance at a point of the map, between the centres of the four nearest cells; those at the border repeat."""
    c, s = math.cos(origin[2]), math.sin(origin[2])
    dx, dy = x - origin[0], y - origin[1]
    column, row = (c * dx + s * dy) / resolution, (-s * dx + c * dy) / resolution
    height, width = len(cells), len(cells[0])
    if not (0.0 <= column < width and 0.0 <= row < height):
        return furthest
    left, below = math.floor(column - 0.5), math.floor(row - 0.5)
    u, v = column - 0.5 - left, row - 0.5 - below

    def at(i: int, j: int) -> float:
        return cells[min(max(i, 0), height - 1)][min(max(j, 0), width - 1)]

    lower = (1.0 - u) * at(below, left) + u * at(below, left + 1)
    upper = (1.0 - u) * at(below + 1, left) + u * at(below + 1, left + 1)
    return (1.0 - v) * lower + v * upper


def density(distance: float, sigma: float, z: float, furthest: float) -> float:
    """p(d): a half normal distribution, or anywhere."""
    return z * 2.0 / (sigma * math.sqrt(math.tau)) * math.exp(-(distance**2) / (2.0 * sigma**2)) + (1.0 - z) / furthest


def hit_share(distance: float, sigma: float, z: float, furthest: float) -> float:
    """How much of p(d) is of a hit."""
    whole = density(distance, sigma, z, furthest)
    return (whole - (1.0 - z) / furthest) / whole


def endpoint(pose: Pose, end: Point, ahead: Point, offset: float) -> Point:
    """Where a beam ends in the map, ``offset`` beyond what was measured."""
    x, y = end[0] + offset * ahead[0], end[1] + offset * ahead[1]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + c * x - s * y, pose[1] + s * x + c * y


def godambe(scores: list[list[list[float]]], inverse_curvatures: list[list[list[float]]], lags: int) -> float:
    """α = 3 / mean tr(H⁻¹J) of scans whose beams have these scores, sums over lags weighted by Bartlett."""
    total = 0.0
    for beams, inverse in zip(scores, inverse_curvatures, strict=True):
        for a, first in enumerate(beams):
            for b, second in enumerate(beams):
                weight = max(0.0, 1.0 - abs(a - b) / (lags + 1))
                for i in range(3):
                    for j in range(3):
                        total += weight * inverse[i][j] * first[j] * second[i]
    return min(1.0, 3.0 * len(scores) / total)


def tau(scores: list[list[list[float]]], tiles: list[list[int]], most: int) -> float:
    """τ₁ of scans with curvature 1 from their beams' scores, by tile; the sum ends before what is not positive."""
    n = len(scores)

    def summed(k: int, tile: int) -> list[float]:
        return [sum(s[i] for s, t in zip(scores[k], tiles[k], strict=True) if t == tile) for i in range(3)]

    total = 0.0
    for lag in range(min(most, n - 1) + 1):
        c = 0.0
        for k in range(n - lag):
            for tile in set(tiles[k]) & set(tiles[k + lag]) - {-1}:
                c += sum(p * q for p, q in zip(summed(k, tile), summed(k + lag, tile), strict=True)) / (3.0 * n)
        if c <= 0.0:
            return total
        total += c if lag == 0 else 2.0 * c
    return total
