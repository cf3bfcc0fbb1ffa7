"""What a scan is scored with: the lidar, and a camera where there are bearings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.errors import InputError, UsageError

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.cli.one_scan import MountedScan
    from mclcli.cli.score.options import ScoreOptions
    from mclcli.sensors.instruments import Camera, Lidar, Reading
    from mclcli.settings.profiles import Settings
    from mclcli.world.occupancy import OccupancyGrid


def instruments(
    options: ScoreOptions, settings: Settings, grid: OccupancyGrid, scan: MountedScan, poses: int
) -> list[tuple[Lidar | Camera, Reading, FloatArray]]:
    """The lidar, and a camera where there are bearings, each with its reading and its mount (4, 4)."""
    import numpy as np

    from mclcli.io.maps.field_cache import cached_field
    from mclcli.io.tables.landmarks_file import read_bearings, read_landmarks
    from mclcli.native.backend import choose
    from mclcli.replay.checking import lidar_temperature
    from mclcli.replay.setup import VISION_TEMPERATURE, alpha_of, lidar_model
    from mclcli.sensors.bearing import BearingModel
    from mclcli.sensors.instruments import Camera, Lidar

    backend = choose(poses * scan.scan.ranges.size, rounds=scan.scan.ranges.size)
    make_field = lambda *what, **how: cached_field(*what, **how)[0]  # noqa: E731
    model = lidar_model(grid, settings, make_field, backend, options.threads)
    lidar_alpha, vision_alpha = (lidar_temperature(settings), VISION_TEMPERATURE) if options.as_run else (1.0, 1.0)
    temperature, mounts = options.sensors.temperature, options.sensors.mounts
    lidar = Lidar("lidar", model, settings.beams, alpha_of(temperature, "lidar", lidar_alpha))
    problem = lidar.problem(scan.scan)
    if problem:
        raise InputError(f"{options.source.scan}: {problem}; it cannot be scored")
    used: list[tuple[Lidar | Camera, Reading, FloatArray]] = [(lidar, scan.scan, scan.base_from_sensor)]
    if (options.landmarks is None) != (options.bearings is None):
        raise UsageError("--landmarks and --bearings go together: where the landmarks are, and what was seen of them")
    if options.landmarks is not None and options.bearings is not None:
        landmarks, alpha = read_landmarks(options.landmarks), alpha_of(temperature, "vision", vision_alpha)
        camera = Camera("vision", BearingModel(settings.bearing, backend), landmarks, alpha)
        used.append((camera, read_bearings(options.bearings), mounts.get("camera", np.eye(4))))
    return used
