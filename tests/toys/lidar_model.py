"""A lidar model that only looks at where the robot is: log p = −stiffness · |(x, y)| for every beam."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.parameters import parameter, validate
from mclcli.sensors import Measurement
from mclcli.sensors.explain import Explanation
from mclcli.sensors.models import Entry

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.native.backend import Backend
    from mclcli.sensors import Temperature
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.models import FieldMaker
    from mclcli.world.occupancy import OccupancyGrid


@final
@dataclass(frozen=True, slots=True)
class ToyParameters:
    """Parameters of the toy."""

    stiffness: float = parameter(0.25, "how much a metre from the origin costs a beam", low=0.0)

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True)
class Toy:
    """The model over any map."""

    parameters: ToyParameters

    def measure(self, sensor: str, beams: Beams, alpha: Temperature = 1.0) -> Measurement:
        """Measurement that scores poses by how far they are from the origin."""
        count = beams.ranges.size

        def log_likelihood(poses: FloatArray) -> FloatArray:
            return -self.parameters.stiffness * count * np.hypot(poses[:, 0], poses[:, 1])

        return Measurement(sensor, log_likelihood, count, 0.0, alpha)


def make(grid: OccupancyGrid, parameters: ToyParameters, make_field: FieldMaker, backend: Backend, threads: int) -> Toy:
    """The toy, which needs nothing of this but its parameters."""
    del grid, make_field, backend, threads
    return Toy(parameters)


def explain(model: Toy, beams: Beams, pose: FloatArray) -> list[Explanation]:
    """A row per beam."""
    cost = -model.parameters.stiffness * float(np.hypot(*pose[:2]))
    return [
        Explanation(str(i), 0.0, float(r), None, None, {}, cost)
        for i, r in zip(beams.indices, beams.ranges, strict=True)
    ]


TOY = Entry("toy", ToyParameters, "none", make, explain, profiles={"nav2": {"stiffness": 0.5}})
