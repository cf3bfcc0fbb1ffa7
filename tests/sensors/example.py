"""The worked example of the documentation: a map, three sets of readings and poses, and their log-weights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se3
from mclcli.sensors import beams
from mclcli.sensors.beams import BeamSelection
from mclcli.sensors.bearing import BearingModel, BearingParameters, observe
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world import distance_field
from mclcli.world.landmarks import Landmarks
from tests.support import grid_of, level, scan_of, sightings

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors import Measurement
    from mclcli.sensors.beams import MaxRange
    from mclcli.world import FieldMethod
    from mclcli.world.occupancy import OccupancyGrid

LANDMARKS = Landmarks(("1", "2", "3"), np.array([[-1.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.0, -1.0, 0.0]]))
PARAMETERS = LikelihoodFieldParameters(z_hit=0.95, z_rand=0.05, sigma_hit=0.15)
BEARING = BearingModel(BearingParameters(sigma_bearing=math.radians(3.0), eps_outlier=0.1))
NO_MOUNT = np.eye(4)


def poses(*rows: tuple[float, float, float]) -> FloatArray:
    """Poses (N, 3) from x, y [m] and yaw in degrees."""
    return np.array([(x, y, math.radians(yaw)) for x, y, yaw in rows])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """Readings, poses, and what they must weigh: ``lidar`` by method; bearings in degrees by id."""

    ranges: tuple[float, ...]
    poses: FloatArray
    lidar: dict[FieldMethod, tuple[float, ...]]
    bearings: tuple[tuple[str, float], ...] = ()
    vision: tuple[float, ...] = ()
    max_range: MaxRange = "skip"

    def lidar_measurement(self, method: FieldMethod, grid: OccupancyGrid | None = None) -> Measurement:
        """The scan over the example's map, or over another."""
        field = distance_field.compute(grid or example_map(), method, 2.0)
        selected = beams.select(scan_of(self.ranges), NO_MOUNT, BeamSelection(max_range=self.max_range))
        return LikelihoodField(field, PARAMETERS).measure("lidar", selected)

    def vision_measurement(self) -> Measurement:
        """The bearings."""
        rays = level(*(math.radians(degrees) for _, degrees in self.bearings))
        seen = sightings(0, [name for name, _ in self.bearings], rays)
        return BEARING.measure("vision", observe(seen, se3.from_planar([0, 0, 0]), LANDMARKS))


def example_map() -> OccupancyGrid:
    """A wall and a box in 6 m × 6 m."""
    occupied = np.zeros((120, 120), dtype=bool)
    occupied[60, 10:110] = True
    occupied[20:30, 85:95] = True
    return grid_of(occupied, 0.05, (-3.0, -3.0, 0.0))


SET1 = Example(
    ranges=(2.8, 3.0, 3.2, 3.1, 3.0, 3.2, 2.9, 2.7, 2.6),
    poses=poses((-0.5, -0.8, 90.0), (-0.2, -0.6, 88.0), (0.8, 0.1, 30.0)),
    lidar={},
    bearings=(("1", 70.0), ("2", 20.0), ("3", -95.0)),
)
SET1_TOTAL = (-58.09788422066158, -58.09596021851833, -58.07910227140370)
SET1_WEIGHTS = (0.33102878883484416, 0.3316663020257507, 0.33730490913940503)

SET2 = Example(
    ranges=(1.05, 0.95, 0.86, 9.0, 0.80, -0.5, 0.87, 0.93, 2.9),
    poses=poses((-0.5, -0.8, 90.0), (-0.45, -0.78, 95.0), (0.8, -1.1, -40.0), (0.85, -1.0, -37.0)),
    lidar={
        "brushfire": (-15.49383560677658, -15.714564571949802, -20.708357111059797, -21.69195677610226),
        "exact": (-15.49383560677658, -15.714564571949722, -20.322874163746285, -21.30248252410169),
    },
    bearings=(("1", 35.0), ("2", -50.0), ("3", -130.0), ("99", 0.0)),
    vision=(-2.6661197675024013, -2.306220471001957, -14.259227357457316, -14.223857278586806),
    max_range="score",
)
SET2_WEIGHTS = (0.4652634498777476, 0.534736517729467, 2.3347391568735746e-08, 9.045394033541194e-09)

SET3 = Example(
    ranges=(0.91, 0.86, 0.86, 0.80, 0.78, 0.82, 0.99, 1.14, 1.21),
    poses=poses((0.91, -0.81, -65.0), (0.96, -0.77, -63.0), (-2.21, 0.93, -100.0)),
    lidar={
        "brushfire": (-15.417167898002397, -15.028881888128133, -11.991725681847718),
        "exact": (-15.049353224268536, -14.74528777092102, -11.692274262121142),
    },
)
