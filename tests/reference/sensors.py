"""The sensor models, one pose and one reading at a time, and the distance fields, one cell at a time."""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING

from tests.reference.filter import compose, wrap

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Cells = Sequence[Sequence[bool]]
    Field = Sequence[Sequence[float]]


def exact_distances(occupied: Cells, resolution: float, max_dist: float) -> list[list[float]]:
    """Every cell against every occupied cell."""
    seeds = [(r, c) for r, line in enumerate(occupied) for c, full in enumerate(line) if full]
    return [
        [
            min([max_dist, *(resolution * math.sqrt((r - sr) ** 2 + (c - sc) ** 2) for sr, sc in seeds)])
            for c in range(len(line))
        ]
        for r, line in enumerate(occupied)
    ]


def brushfire_distances(occupied: Cells, resolution: float, max_dist: float) -> list[list[float]]:
    """Dijkstra's algorithm from all occupied cells at once; steps 1 and √2 to the eight neighbours."""
    height, width = len(occupied), len(occupied[0])
    best = {(r, c): 0.0 for r in range(height) for c in range(width) if occupied[r][c]}
    queue = [(0.0, cell) for cell in best]
    while queue:
        length, (r, c) = heapq.heappop(queue)
        if length > best[r, c]:
            continue
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                cell, total = (r + dr, c + dc), length + math.hypot(dr, dc)
                inside = 0 <= cell[0] < height and 0 <= cell[1] < width
                if inside and total < best.get(cell, math.inf):
                    best[cell] = total
                    heapq.heappush(queue, (total, cell))
    return [[min(max_dist, resolution * best.get((r, c), math.inf)) for c in range(width)] for r in range(height)]


def field_log_p(
    distances: Field,
    resolution: float,
    origin: Sequence[float],
    max_dist: float,
    pose: Sequence[float],
    endpoints: Sequence[Sequence[float]],
    *,
    z_hit: float,
    z_rand: float,
    sigma: float,
    r_max: float,
) -> float:
    """Likelihood field: Σ log max(1e-12, z_hit·exp(−d²/2σ²) + z_rand/r_max) over endpoints in the base frame."""
    total = 0.0
    for endpoint in endpoints:
        x, y, _ = compose(pose, (*endpoint, 0.0))
        dx, dy = x - origin[0], y - origin[1]
        c, s = math.cos(origin[2]), math.sin(origin[2])
        column, row = math.floor((c * dx + s * dy) / resolution), math.floor((c * dy - s * dx) / resolution)
        inside = 0 <= row < len(distances) and 0 <= column < len(distances[0])
        d = distances[row][column] if inside else max_dist
        total += math.log(max(1e-12, z_hit * math.exp(-(d**2) / (2 * sigma**2)) + z_rand / r_max))
    return total


def endpoints_of(
    ranges: Sequence[float], angle_min: float, increment: float, mount: Sequence[float], r_max: float
) -> list[tuple[float, float]]:
    """Endpoints in the base frame of beams of a level lidar at (x, y, yaw); readings clamped to [0, r_max]."""
    ends = []
    for i, reading in enumerate(ranges):
        r, angle = min(max(reading, 0.0), r_max), angle_min + i * increment
        x, y, _ = compose(mount, (r * math.cos(angle), r * math.sin(angle), 0.0))
        ends.append((x, y))
    return ends


def bearings_log_p(
    pose: Sequence[float],
    mount: Sequence[float],
    seen: Sequence[tuple[str, float]],
    landmarks: Mapping[str, tuple[float, float]],
    *,
    sigma: float,
    eps: float,
) -> float:
    """Bearing mixture: (1−ε)·N(e; 0, σ²) + ε/2π for known ids, 1/2π for others, floored at 1e-15."""
    camera = compose(pose, mount)
    total = 0.0
    for name, bearing in seen:
        p = 1.0 / math.tau
        if name in landmarks:
            lx, ly = landmarks[name]
            e = wrap(bearing - wrap(math.atan2(ly - camera[1], lx - camera[0]) - camera[2]))
            density = math.exp(-(e**2) / (2 * sigma**2)) / (sigma * math.sqrt(math.tau))
            p = (1.0 - eps) * density + eps / math.tau
        total += math.log(max(p, 1e-15))
    return total
