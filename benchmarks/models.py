"""Cost of every observation model against the same formula in plain NumPy: ``python -m benchmarks.models``.

Run from the repository's root. The plain versions hold all poses × beams at once, as one would write them first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.special import ndtr

from benchmarks.measure import alternate, table, timed
from mclcli.io.maps.map_yaml import load_map
from mclcli.native.backend import COMPILED, load
from mclcli.sensors.beams import Beams
from mclcli.sensors.bearing import BearingModel, BearingParameters, Bearings
from mclcli.sensors.models import lidar_entry
from mclcli.settings import profiles
from mclcli.world import distance_field

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.world.occupancy import OccupancyGrid

    Score = Callable[[np.ndarray], np.ndarray]

R_MAX = 12.0


@dataclass(frozen=True)
class Scene:
    """A map, a scan of it, and poses nearby."""

    grid: OccupancyGrid
    beams: Beams
    poses: np.ndarray

    @property
    def metres(self) -> np.ndarray:
        """Distances (H, W) [m], up to 2 m."""
        return distance_field.compute(self.grid, "exact", 2.0).metres()


def scene(particles: int = 2000, count: int = 60) -> Scene:
    """The office of maps/, seen from its middle."""
    grid = load_map(Path("maps/office.yaml"))
    rng = np.random.default_rng(0)
    angles = np.linspace(-3.0, 3.0, count)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    beams = Beams(np.zeros((count, 2)), directions, rng.uniform(0.5, 8.0, count), R_MAX)
    poses = np.column_stack([rng.normal([-2.0, 4.0], 0.1, (particles, 2)), rng.normal(0, 0.1, particles)])
    return Scene(grid, beams, poses)


def _cells(grid: OccupancyGrid, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns, clipped to the map, and whether they were on it."""
    column = np.floor((x - grid.origin[0]) / grid.resolution).astype(int)
    row = np.floor((y - grid.origin[1]) / grid.resolution).astype(int)
    inside = (column >= 0) & (column < grid.width) & (row >= 0) & (row < grid.height)
    return row.clip(0, grid.height - 1), column.clip(0, grid.width - 1), inside


def _ends(seen: Scene, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x and y (N, B) of the endpoints in map."""
    ends = seen.beams.endpoints
    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    return (
        poses[:, 0, None] + c * ends[:, 0] - s * ends[:, 1],
        poses[:, 1, None] + s * ends[:, 0] + c * ends[:, 1],
    )


def _field_p(seen: Scene, metres: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """p (N, B) of the likelihood field."""
    row, column, inside = _cells(seen.grid, *_ends(seen, poses))
    d = np.where(inside, metres[row, column], 2.0)
    return np.asarray(0.5 * np.exp(-0.5 * (d / 0.2) ** 2) + 0.5 / R_MAX)


def plain_field(seen: Scene, metres: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Σ log p."""
    return np.asarray(np.log(_field_p(seen, metres, poses)).sum(axis=1))


def plain_cubes(seen: Scene, metres: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """log(1 + Σ p³)."""
    return np.asarray(np.log1p((_field_p(seen, metres, poses) ** 3).sum(axis=1)))


def plain_skipping(seen: Scene, metres: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Σ log p of the beams that end near an obstacle from more than 30 % of the poses."""
    row, column, inside = _cells(seen.grid, *_ends(seen, poses))
    kept = (inside & (metres[row, column] < 0.5)).mean(axis=0) > 0.3
    return np.asarray(np.log(_field_p(seen, metres, poses)[:, kept]).sum(axis=1))


def plain_bilinear(seen: Scene, metres: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Σ log p of distances interpolated by SciPy."""
    x, y = _ends(seen, poses)
    at = np.stack([(y - seen.grid.origin[1]), (x - seen.grid.origin[0])]) / seen.grid.resolution - 0.5
    d = map_coordinates(metres, at, order=1, mode="nearest")
    return np.asarray(np.log(0.5 * np.exp(-0.5 * (d / 0.2) ** 2) + 0.5 / R_MAX).sum(axis=1))


def plain_beam(seen: Scene, metres: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """The mixture, its rays sampled every half cell until the first blocked one: may slip through corners."""
    del metres
    blocked = ~seen.grid.free
    angle = poses[:, 2, None] + np.arctan2(seen.beams.directions[:, 1], seen.beams.directions[:, 0])
    c, s = np.cos(angle), np.sin(angle)
    expected = np.full(angle.shape, R_MAX)
    for r in np.arange(R_MAX, 0.0, -0.5 * seen.grid.resolution):
        row, column, inside = _cells(seen.grid, poses[:, 0, None] + r * c, poses[:, 1, None] + r * s)
        expected[inside & blocked[row, column]] = r
    r, sigma, rate = seen.beams.ranges, 0.2, 0.1
    share = ndtr((R_MAX - expected) / sigma) - ndtr(-expected / sigma)
    hit = np.exp(-0.5 * ((r - expected) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi) * share)
    short = np.where(r < expected, rate * np.exp(-rate * r) / -np.expm1(-rate * expected), 0.0)
    return np.asarray(np.log(0.75 * hit + 0.1 * short + 0.1 / R_MAX).sum(axis=1))


def plain_bearing(landmarks: np.ndarray, angles: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Σ log of the bearing mixture."""
    offset = landmarks - poses[:, None, :2]
    error = angles - (np.arctan2(offset[..., 1], offset[..., 0]) - poses[:, 2, None])
    error = np.arctan2(np.sin(error), np.cos(error))
    sigma = math.radians(3.0)
    density = np.exp(-0.5 * (error / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
    return np.asarray(np.log(0.9 * density + 0.1 / (2.0 * math.pi)).sum(axis=1))


CASES: dict[str, tuple[str, dict[str, object], Callable[..., np.ndarray]]] = {
    "likelihood field, Σ log p": ("likelihood_field", {}, plain_field),
    "likelihood field, log(1 + Σ p³)": ("likelihood_field", {"combination": "one_plus_cubes"}, plain_cubes),
    "likelihood field, bilinear": ("likelihood_field", {"field_lookup": "bilinear"}, plain_bilinear),
    "likelihood field, beam skipping": ("likelihood_field_prob", {"do_beamskip": True}, plain_skipping),
    "beam mixture, exact rays": ("beam", {}, plain_beam),
    "beam mixture, approximate rays": ("beam", {"raycast": "approximate"}, plain_beam),
    "beam mixture, nav2's rays": ("beam", {"raycast": "bresenham_nav2"}, plain_beam),
}


def row(name: str, score: Score, plain: Score, poses: np.ndarray, count: int) -> tuple[str, str, str]:
    """Nanoseconds per particle·beam, and how many times as fast as the plain version."""
    pair = alternate(timed(partial(score, poses), 3), timed(partial(plain, poses)), 5)
    steps = len(poses) * count * 1e-9
    return name, f"{pair.a / steps:.1f} ns", f"{pair.b / steps:.0f} ns: {1 / pair.ratio:.1f} × as fast"


def rows() -> list[tuple[str, str, str]]:
    """Every model."""
    seen = scene()
    metres, count = seen.metres, seen.beams.ranges.size
    found = []
    for name, (model, changes, plain) in CASES.items():
        settings = profiles.build(changes, model=model)
        entry = lidar_entry(model)
        lidar = entry.make(seen.grid, settings.lidars[entry.group], distance_field.compute, COMPILED, 1)
        score = lidar.measure("lidar", seen.beams).log_likelihood
        found.append(row(name, score, partial(plain, seen, metres), seen.poses, count))
    rng = np.random.default_rng(1)
    landmarks, angles = rng.uniform(-8, 8, (count, 2)), rng.uniform(-3, 3, count)
    bearings = Bearings(np.zeros(2), angles, landmarks, 0)
    score = BearingModel(BearingParameters(), COMPILED).measure("vision", bearings).log_likelihood
    found.append(row("bearings", score, partial(plain_bearing, landmarks, angles), seen.poses, count))
    return found


if __name__ == "__main__":
    load("likelihood_field")
    print(table(rows()))
