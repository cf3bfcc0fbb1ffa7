"""Rooms with scans cast into them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2, se3
from mclcli.records import LaserScan
from mclcli.replay import finder
from mclcli.search import scene as scenes
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.sensors.observation import Observation
from mclcli.settings import profiles
from mclcli.world import distance_field, pyramid
from mclcli.world.occupancy import OCCUPIED, OccupancyGrid
from mclcli.world.raycast import make_caster

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.replay.finder import GlobalSearch, Limits
    from mclcli.search.parameters import BaseCells
    from mclcli.sensors import Temperature
    from mclcli.settings.profiles import Settings
    from mclcli.world.landmarks import Landmarks

MOUNT = se3.from_rpy([0.1, -0.05, 0.2], 0.0, 0.0, 0.3)


def hall(origin: tuple[float, float, float] = (-1.0, -0.5, 0.0), *, twin: bool = False) -> OccupancyGrid:
    """Hall of 6 × 4 m with pillars that fit in one way only; with ``twin`` two equal halls side by side."""
    one = np.zeros((80, 120), np.int8)
    one[[0, -1], :] = OCCUPIED
    one[:, [0, -1]] = OCCUPIED
    one[20:30, 80:88] = OCCUPIED
    one[55:79, 20:24] = OCCUPIED
    one[60:64, 95:105] = OCCUPIED
    return OccupancyGrid(np.hstack([one, one]) if twin else one, 0.05, np.array(origin))


def scan_at(
    grid: OccupancyGrid,
    pose: FloatArray,
    *,
    mount: FloatArray = MOUNT,
    fov: float = math.tau,
    range_max: float = 8.0,
    stamp_ns: int = 0,
) -> LaserScan:
    """What a lidar sees from a pose (3,) of the base, without noise."""
    angles = -fov / 2.0 + np.arange(120) * fov / 120
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ mount[:2, :2].T
    origins = np.broadcast_to(mount[:2, 3], directions.shape)
    ranges = make_caster(grid, ray_unknown="free").ranges(pose[np.newaxis], origins, directions, range_max)[0]
    ranges = np.where(ranges < range_max, ranges, np.inf)
    return LaserScan(stamp_ns, "laser", float(angles[0]), fov / 120, 0.05, range_max, ranges)


def seen_from(grid: OccupancyGrid, *poses: tuple[float, float, float], **how: object) -> list[Observation]:
    """Scans from poses of the base in map, one a second; odometry calls the first one (5, −3, 1)."""
    first, mount = np.array(poses[0]), how.get("mount", MOUNT)
    assert isinstance(mount, np.ndarray)
    observations = []
    for i, pose in enumerate(poses):
        scan = scan_at(grid, np.array(pose), stamp_ns=i * 10**9, **how)  # type: ignore[arg-type]
        odom = se2.compose([5.0, -3.0, 1.0], se2.between(first, np.array(pose)))
        observations.append(Observation("/scan", scan, odom, mount))
    return observations


def finder_for(
    grid: OccupancyGrid,
    settings: Settings | None = None,
    limits: Limits | None = None,
    landmarks: Landmarks | None = None,
    alpha: Temperature = "auto",
) -> GlobalSearch:
    """The search over a map."""
    settings = settings or profiles.build({})
    model = LikelihoodField(distance_field.compute(grid, "exact", 2.0), settings.lidars["likelihood_field"])
    return finder.make_global_search(
        grid, model, settings, pyramid.build, limits=limits, landmarks=landmarks, alpha=alpha
    )


def cells_allowed(grid: OccupancyGrid, policy: BaseCells) -> BoolArray:
    """Cells that may hold the base."""
    return scenes.allowed_cells(grid, policy)
