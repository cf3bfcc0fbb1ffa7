"""Symmetric 3 × 3 matrices as six numbers: for one of them, NumPy's functions take longer than the arithmetic."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


@final
class Symmetric(NamedTuple):
    """The upper triangle of a symmetric matrix, row by row."""

    xx: float
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float

    @classmethod
    def of(cls, matrix: FloatArray) -> Symmetric:
        """Of the upper triangle of a matrix (3, 3)."""
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrix.tolist()
        return cls(xx, xy, xz, yy, yz, zz)

    def matrix(self) -> FloatArray:
        """The whole matrix (3, 3)."""
        xx, xy, xz, yy, yz, zz = self
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def plus(a: Symmetric, b: Symmetric, factor: float = 1.0) -> Symmetric:
    """A + factor · b."""
    return Symmetric(
        a.xx + factor * b.xx,
        a.xy + factor * b.xy,
        a.xz + factor * b.xz,
        a.yy + factor * b.yy,
        a.yz + factor * b.yz,
        a.zz + factor * b.zz,
    )


def inverse(a: Symmetric) -> Symmetric:
    """Of a matrix with a determinant that is not 0."""
    xx, xy, xz, yy, yz, zz = a
    first, second, third = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    scale = 1.0 / (xx * first + xy * second + xz * third)
    return Symmetric(
        first * scale,
        second * scale,
        third * scale,
        (xx * zz - xz * xz) * scale,
        (xy * xz - xx * yz) * scale,
        (xx * yy - xy * xy) * scale,
    )


def correlation_determinant(a: Symmetric) -> float:
    """Determinant of the correlation matrix of a covariance: 1 of what is uncorrelated, 0 of what lies in a plane."""
    xx, xy, xz, yy, yz, zz = a
    product = xx * yy * zz
    if not (min(xx, yy, zz) > 0.0 and product > 0.0):
        return 0.0
    return (xx * (yy * zz - yz * yz) + xy * (xz * yz - xy * zz) + xz * (xy * yz - xz * yy)) / product


def between(a: Symmetric, m: Symmetric) -> Symmetric:
    """The product a m a."""
    axx, axy, axz, ayy, ayz, azz = a
    mxx, mxy, mxz, myy, myz, mzz = m
    p, q, r = axx * mxx + axy * mxy + axz * mxz, axx * mxy + axy * myy + axz * myz, axx * mxz + axy * myz + axz * mzz
    s, t, u = axy * mxx + ayy * mxy + ayz * mxz, axy * mxy + ayy * myy + ayz * myz, axy * mxz + ayy * myz + ayz * mzz
    v, w, x = axz * mxx + ayz * mxy + azz * mxz, axz * mxy + ayz * myy + azz * myz, axz * mxz + ayz * myz + azz * mzz
    return Symmetric(
        p * axx + q * axy + r * axz,
        p * axy + q * ayy + r * ayz,
        p * axz + q * ayz + r * azz,
        s * axy + t * ayy + u * ayz,
        s * axz + t * ayz + u * azz,
        v * axz + w * ayz + x * azz,
    )


def positive(a: Symmetric) -> Symmetric:
    """The nearest matrix without a negative direction: the same, if it has none."""
    xx, xy, xz, yy, yz, zz = a
    minor = xx * yy - xy * xy
    if xx > 0.0 and minor > 0.0 and minor * zz - xx * yz * yz + xz * (2.0 * xy * yz - xz * yy) > 0.0:
        return a
    values, vectors = np.linalg.eigh(a.matrix())
    return Symmetric.of(np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T, np.float64))


def moved(a: Symmetric, dx: float, dy: float) -> Symmetric:
    """Covariance of poses with covariance a, after the base moved by dx, dy [m] in map: turned by the error of yaw."""
    xx, xy, xz, yy, yz, zz = a
    xz_moved, yz_moved = xz - dy * zz, yz + dx * zz
    return Symmetric(
        xx - dy * (xz + xz_moved), xy + dx * xz - dy * yz_moved, xz_moved, yy + dx * (yz + yz_moved), yz_moved, zz
    )
