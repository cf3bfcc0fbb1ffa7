"""From pixels to rays: the pinhole camera, its lens, and the inverse of what the lens does.

A raw image is the pinhole's, distorted; with x = X/Z, y = Y/Z, r² = x² + y²:

    plumb_bob, rational_polynomial   x' = x·q + 2p₁xy + p₂(r² + 2x²),   y' = y·q + p₁(r² + 2y²) + 2p₂xy,
                                     q = (1 + k₁r² + k₂r⁴ + k₃r⁶) / (1 + k₄r² + k₅r⁴ + k₆r⁶)
    equidistant                      (x', y') = (x, y)·ρ/r,   ρ = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸),   θ = atan r

and (u, v, 1) = K (x', y', 1). Coefficients stand as (k₁, k₂, p₁, p₂, k₃, k₄, k₅, k₆) and (k₁, k₂, k₃, k₄).
Sources: D. C. Brown 1966; Kannala and Brandt 2006, eq. 6; REP-104 and sensor_msgs/CameraInfo for K, D, R, P.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.records import CameraModel

    Jacobian = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    Radial = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

_PINHOLE = frozenset({"plumb_bob", "rational_polynomial"})
_FISHEYE = frozenset({"equidistant", "fisheye", "kannala_brandt"})
_COUNTS = {**dict.fromkeys(_PINHOLE, 8), **dict.fromkeys(_FISHEYE, 4)}
_STEPS = 50  # Newton's method needs about five
_STILL = 1e-15
_CLOSE = 1e-11  # in units of the focal length
_ALONG = np.linspace(0.0, 1.0, 17)  # where the way from the middle of the image outwards is looked at


def problem(camera: CameraModel, *, rectified: bool) -> str:
    """Why a camera gives no rays, empty if it does."""
    intrinsic = camera.p if rectified else camera.k
    if not np.isfinite(intrinsic).all() or not (intrinsic[0, 0] > 0.0 and intrinsic[1, 1] > 0.0):
        return f"not calibrated: {'P' if rectified else 'K'} has no focal length"
    if rectified:
        return ""
    if not _is_rotation(_rotation(camera)):
        return "R is no rotation"
    return _problem_of_lens(camera.distortion_model, camera.distortion)


def rays(camera: CameraModel, pixels: FloatArray, *, rectified: bool) -> FloatArray:
    """Directions (M, 3) in the optical frame (x right, y down, z forward) of pixels (M, 2) of the published image.

    Pixels of a ``rectified`` image go through P alone, those of a raw one through K, the lens and R, so that both
    end in the same frame, as in ROS's image_geometry. The baseline in P's fourth column is left out: a ray says
    nothing of distances. NaN where no direction leads to the pixel. ``problem`` must have found none.
    """
    full = pixels * np.maximum(camera.binning, 1) + np.asarray(camera.offset)
    if rectified:
        return _ahead(*_through(camera.p, full))
    x, y = _through(camera.k, full)
    with np.errstate(all="ignore"):  # what lies beyond the lens's reach ends as NaN
        straight = _straightened(camera, x, y)
    return np.asarray(np.einsum("mi,ji->mj", straight, _rotation(camera)))  # no BLAS: same bits for any number


def _problem_of_lens(model: str, coefficients: FloatArray) -> str:
    if not coefficients.any():
        return ""
    counts = _COUNTS.get(model)
    if counts is None:
        return f"distortion model {model[:40]!r} is not known"
    if not np.isfinite(coefficients).all() or np.flatnonzero(coefficients)[-1] >= counts:
        return f"D is not a distortion of model {model}"
    return ""


def _rotation(camera: CameraModel) -> FloatArray:
    return camera.r if camera.r.any() else np.eye(3)  # many drivers leave it zero


def _is_rotation(matrix: FloatArray) -> bool:
    if not np.isfinite(matrix).all():
        return False
    return bool(np.abs(matrix @ matrix.T - np.eye(3)).max() < 1e-3 and np.linalg.det(matrix) > 0.0)


def _through(matrix: FloatArray, pixels: FloatArray) -> tuple[FloatArray, ...]:
    """Coordinates on the plane one unit ahead, by the upper triangular matrix of a pinhole."""
    y = (pixels[:, 1] - matrix[1, 2]) / matrix[1, 1]
    return (pixels[:, 0] - matrix[0, 2] - matrix[0, 1] * y) / matrix[0, 0], y


def _ahead(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def _straightened(camera: CameraModel, x: FloatArray, y: FloatArray) -> FloatArray:
    if not camera.distortion.any():
        return _fisheye_rays(np.zeros(4), x, y) if camera.distortion_model in _FISHEYE else _ahead(x, y)
    if camera.distortion_model in _FISHEYE:
        return _fisheye_rays(_padded(camera.distortion, 4), x, y)
    return _ahead(*_undistorted(_padded(camera.distortion, 8), x, y))


def _padded(coefficients: FloatArray, count: int) -> FloatArray:
    return np.concatenate([coefficients, np.zeros(count)])[:count]


def _distorted(c: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, Jacobian, FloatArray]:
    """Where the lens puts (x, y), the Jacobian there row by row, and the factor q."""
    k1, k2, p1, p2, k3, k4, k5, k6 = c
    s = x * x + y * y
    above, below = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    q = above / below
    slope = (k1 + s * (2 * k2 + s * 3 * k3) - q * (k4 + s * (2 * k5 + s * 3 * k6))) / below  # dq/ds
    u = x * q + 2 * p1 * x * y + p2 * (s + 2 * x * x)
    v = y * q + p1 * (s + 2 * y * y) + 2 * p2 * x * y
    cross = 2 * (x * y * slope + p1 * x + p2 * y)
    jacobian = (
        q + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x,
        cross,
        cross,
        q + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x,
    )
    return u, v, jacobian, q


def _undistorted(c: FloatArray, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inverse of ``_distorted`` by Newton's method, NaN where it has none.

    A model folds over outside the image it was fitted to: only roots that are reached from the middle without
    crossing a fold (det J > 0 and q > 0 all the way) count.
    """
    x, y = np.array(u), np.array(v)
    for _ in range(_STEPS):
        du, dv, (a, b, _, d), _ = _distorted(c, x, y)
        du, dv, det = du - u, dv - v, a * d - b * b
        step_x, step_y = (d * du - b * dv) / det, (a * dv - b * du) / det
        x, y = x - step_x, y - step_y
        if not (np.hypot(step_x, step_y) > _STILL).any():
            break
    du, dv, *_ = _distorted(c, x, y)
    _, _, (a, b, _, d), q = _distorted(c, np.multiply.outer(_ALONG, x), np.multiply.outer(_ALONG, y))
    good = (np.hypot(du - u, dv - v) < _CLOSE * (1 + np.hypot(u, v))) & ((a * d > b * b) & (q > 0)).all(axis=0)
    return np.where(good, x, np.nan), np.where(good, y, np.nan)


def _fisheye_rays(k: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Unit directions; the angle off the axis may exceed 90°."""
    k1, k2, k3, k4 = k

    def radius(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        s = angle * angle
        return (
            angle * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))),
            1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4))),
        )

    rho = np.hypot(u, v)
    angle = _inverted(radius, rho)
    scale = np.where(rho > 0.0, np.sin(angle) / np.where(rho > 0.0, rho, 1.0), 1.0)
    return np.stack([scale * u, scale * v, np.cos(angle)], axis=-1)


def _inverted(radius: Radial, rho: FloatArray) -> FloatArray:
    """Angle in [0, π] with this radius, by Newton's method; NaN where the radius does not rise up to there."""
    angle = np.array(rho)
    for _ in range(_STEPS):
        value, slope = radius(angle)
        step = (value - rho) / slope
        angle = angle - step
        if not (np.abs(step) > _STILL).any():
            break
    _, slopes = radius(np.multiply.outer(_ALONG, angle))
    good = (np.abs(radius(angle)[0] - rho) < _CLOSE * (1 + rho)) & (slopes > 0).all(axis=0)
    return np.where(good & (angle >= 0.0) & (angle <= np.pi), angle, np.nan)
