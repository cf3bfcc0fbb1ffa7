"""A simulated run as the filter takes it, without a file between: decoded messages, map, frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.filter.localizer import Localizer
from mclcli.filter.recovery import FromAnywhere
from mclcli.filter.start import AroundPose
from mclcli.geometry import se3
from mclcli.geometry.frames import TransformTree
from mclcli.motion import build as build_motion
from mclcli.native.backend import COMPILED
from mclcli.records import LaserScan, Odometry, Transform
from mclcli.replay.intake import Setup
from mclcli.sensors.instruments import Lidar
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.settings.profiles import build as build_settings
from mclcli.world import distance_field
from mclcli.world.occupancy import OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.sensors import Temperature
    from mclcli.settings.profiles import Settings
    from samples.sim.building import Building
    from samples.sim.recording import Recording

    Event = tuple[str, object]

BASE, LASER = "base_link", "laser"
SPREAD = np.diag(np.square([0.15, 0.15, 0.07]))  # as an operator's click


def grid_of(building: Building) -> OccupancyGrid:
    """The building's map."""
    return OccupancyGrid(building.grid, building.resolution, np.array(building.origin))


def events(recording: Recording) -> list[Event]:
    """Odometry and scans in the order of their stamps, the odometry first where they are equal."""
    lidar = recording.scenario.lidar
    odometry: list[Event] = [
        ("/odom", Odometry(int(stamp), "odom", BASE, pose))
        for stamp, pose in zip(recording.odom.stamps_ns, recording.odom.poses, strict=True)
    ]
    geometry: dict[str, Any] = {
        "frame_id": LASER,
        "angle_min": float(lidar.angles[0]),
        "angle_increment": float(np.float32(lidar.angle_increment)),
        "range_min": lidar.range_min,
        "range_max": lidar.range_max,
        "time_increment": lidar.sweep / lidar.beams,
    }
    scans: list[Event] = [
        ("/scan", LaserScan(stamp_ns=int(stamp), ranges=ranges.astype(np.float64), **geometry))
        for stamp, ranges in zip(recording.scan_stamps_ns, recording.ranges, strict=True)
    ]
    return sorted([*odometry, *scans], key=lambda event: event[1].stamp_ns)  # type: ignore[attr-defined]


def frames(recording: Recording) -> TransformTree:
    """The lidar's mount."""
    mount = recording.scenario.lidar.mount
    roll = np.pi if mount.upside_down else 0.0
    base_from_laser = se3.from_rpy([mount.x, mount.y, mount.z], roll, 0.0, mount.yaw)
    tree = TransformTree()
    tree.add(Transform(0, BASE, LASER, base_from_laser, static=True))
    return tree


def setup(
    recording: Recording,
    settings: Settings | None = None,
    *,
    seed: int = 0,
    alpha: Temperature = 0.5,
    **changes: Any,  # noqa: ANN401 - fields of a Setup
) -> Setup:
    """Setup that tracks the robot from where the operator said it was."""
    settings = settings or build_settings({})
    grid = grid_of(recording.scenario.mapped)
    parameters = settings.lidars["likelihood_field"]
    field = distance_field.compute(grid, "exact", parameters.laser_likelihood_max_dist)
    fields: Mapping[str, Any] = {
        "localizer": Localizer(
            build_motion(settings.motion, COMPILED), settings.filter, seed, settings.kld, settings.recovery, COMPILED
        ),
        "instruments": {"/scan": Lidar("lidar", LikelihoodField(field, parameters, COMPILED), settings.beams, alpha)},
        "start": AroundPose(recording.initial, SPREAD),
        "odometry": "/odom",
        "odom_frame": "odom",
        "base_frame": BASE,
        "frames": frames(recording),
        "odometry_limits": settings.odometry,
        "proposal": FromAnywhere(grid) if settings.recovery.enabled else None,
    }
    return Setup(**{**fields, **changes})
