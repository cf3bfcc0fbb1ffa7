"""Projection of a direction to a pixel, scalar by scalar from the formulas of OpenCV's manual (calib3d, fisheye)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def project(
    ray: Sequence[float], kind: str, d: Sequence[float], focal: tuple[float, float], centre: tuple[float, float]
) -> tuple[float, float]:
    """Pixel of a direction in front of a camera: x right, y down, z forward."""
    x, y = ray[0] / ray[2], ray[1] / ray[2]
    if kind in {"equidistant", "fisheye"}:
        theta = math.acos(ray[2] / math.dist((0.0, 0.0, 0.0), ray))
        k = [1.0, *d, *(0.0,) * (4 - len(d))]
        bent = sum(k[i] * theta ** (2 * i + 1) for i in range(5))
        length = math.hypot(ray[0], ray[1])
        x, y = (bent * ray[0] / length, bent * ray[1] / length) if length else (0.0, 0.0)
    elif d:
        k1, k2, p1, p2, k3, k4, k5, k6 = (*d, *(0.0,) * (8 - len(d)))
        r = math.hypot(x, y)
        radial = (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) / (1 + k4 * r**2 + k5 * r**4 + k6 * r**6)
        x, y = (
            x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2),
            y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y,
        )
    return focal[0] * x + centre[0], focal[1] * y + centre[1]
