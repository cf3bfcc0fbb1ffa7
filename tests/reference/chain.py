"""A chain of poses joined by odometry, one factor at a time, every derivative by differences.

A pose is [x, y, yaw]. ``known`` holds for every pose a list of (point [3], square root of information 3×3): what is
known of it costs half the square of root·(pose − point), the yaw wrapped.
"""

from __future__ import annotations

import math

Vector = list[float]
Matrix = list[list[float]]
Known = list[list[tuple[Vector, Matrix]]]
_H = 1e-6


def wrap(angle: float) -> float:
    """Angle in [−π, π)."""
    return (angle + math.pi) % math.tau - math.pi


def times(matrix: Matrix, vector: Vector) -> Vector:
    """Matrix times vector."""
    return [sum(a * b for a, b in zip(row, vector, strict=True)) for row in matrix]


def odometry_error(a: Vector, b: Vector, increment: Vector) -> Vector:
    """How b, seen from a, differs from an increment."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return [c * dx + s * dy - increment[0], -s * dx + c * dy - increment[1], wrap(b[2] - a[2] - increment[2])]


def robust_cost(square: float, share: float, scale: float) -> float:
    """−log of a mixture of two Gaussians of three dimensions, up to their common constant."""
    return -math.log((1.0 - share) * math.exp(-square / 2.0) + share / scale**3 * math.exp(-square / (2.0 * scale**2)))


def robust_weight(square: float, share: float, scale: float) -> float:
    """Twice the derivative of ``robust_cost`` by the square, by differences."""
    h = 1e-5 * max(square, 1.0)
    return (robust_cost(square + h, share, scale) - robust_cost(square - h, share, scale)) / h


def residuals(poses: list[Vector], known: Known, increments: Matrix, roots: list[Matrix]) -> Vector:
    """All residuals: half their squares is the cost; ``roots`` are those of the increments' information."""
    found: Vector = []
    for pose, facts in zip(poses, known, strict=True):
        for point, root in facts:
            found += times(root, [pose[0] - point[0], pose[1] - point[1], wrap(pose[2] - point[2])])
    for k, (increment, root) in enumerate(zip(increments, roots, strict=True)):
        found += times(root, odometry_error(poses[k], poses[k + 1], increment))
    return found


def jacobian(poses: list[Vector], known: Known, increments: Matrix, roots: list[Matrix]) -> Matrix:
    """Derivative of every residual by every number of every pose."""
    columns = []
    for k in range(len(poses)):
        for i in range(3):
            sides = []
            for sign in (1.0, -1.0):
                moved = [list(pose) for pose in poses]
                moved[k][i] += sign * _H
                sides.append(residuals(moved, known, increments, roots))
            columns.append([(p - m) / (2.0 * _H) for p, m in zip(*sides, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def normal_equations(
    poses: list[Vector], known: Known, increments: Matrix, roots: list[Matrix]
) -> tuple[Matrix, Vector]:
    """H = JᵀJ and the gradient Jᵀr of half the sum of squares, dense."""
    j, r = jacobian(poses, known, increments, roots), residuals(poses, known, increments, roots)
    size = range(3 * len(poses))
    return (
        [[sum(row[a] * row[b] for row in j) for b in size] for a in size],
        [sum(row[a] * value for row, value in zip(j, r, strict=True)) for a in size],
    )
