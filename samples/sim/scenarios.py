"""The samples that are shipped, by name."""

from __future__ import annotations

import math

from samples.sim.changes import move_boxes
from samples.sim.layouts import hall, office_floor
from samples.sim.recording import Scenario
from samples.sim.robot import Drive, OdometryNoise
from samples.sim.sensors import Camera, Lidar, Mount


def office() -> Scenario:
    """Drive through an office floor: rooms, a loop, people walking by, odometry that goes astray."""
    floor = office_floor(seed=4, origin=(-9.6, -6.4, 0.0))
    return Scenario(
        name="office",
        mapped=floor,
        today=move_boxes(floor, seed=1, count=2),
        tours=(("lobby", "south2", "south5", "passage", "north4", "core1", "lobby"),),
        lidar=Lidar(Mount(0.14, -0.04, 0.21, yaw=0.35)),
        camera=Camera(Mount(0.1, 0.0, 0.55), fov=1.6, reach=9.0),
        drive=Drive(speed=0.85),
        noise=OdometryNoise(pull=0.002),
        walks=(("west", "passage"), ("passage", "north2"), ("south3", "south4"), ("lobby", "north1")),
        seed=11,
        chain=("base_footprint", "base_link"),
    )


def warehouse() -> Scenario:
    """Drive along the aisles of a warehouse: a lidar hung upside down, a map turned against its frame."""
    floor = hall(seed=3, origin=(4.0, -7.5, 0.3))
    return Scenario(
        name="warehouse",
        mapped=floor,
        tours=(("dock", "south1", "aisle1", "north1", "north2", "aisle2", "south2", "south3", "gate"),),
        lidar=Lidar(
            Mount(0.25, 0.05, 0.32, yaw=-0.1, upside_down=True),
            beams=271,
            angle_min=-math.radians(135),
            angle_increment=math.radians(1),
            range_max=15.0,
            rate=6.0,
            sweep=0.08,
            sigma=0.02,
        ),
        camera=Camera(Mount(0.3, 0.0, 0.9, yaw=0.25), fov=1.4, reach=12.0, rate=5.0),
        drive=Drive(speed=0.9, lookahead=0.6),
        walks=(("north1", "north4"), ("south2", "gate")),
        seed=12,
    )


SCENARIOS = {"office": office, "warehouse": warehouse}
