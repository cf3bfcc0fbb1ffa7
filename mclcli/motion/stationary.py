"""A robot that stands still: the same small noise at every update, whatever the odometry says.

As Beluga's StationaryModel, whose standard deviation is 0.02 in x, y [m] and yaw [rad]; the noise keeps particles from
collapsing onto copies of a few ancestors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


@final
@dataclass(frozen=True, slots=True)
class StationaryParameters:
    """Noise of a robot that stands still, per update."""

    stationary_sigma_xy: float = parameter(
        0.02, "noise in x and in y at every update (stationary only)", unit="m", low=0.0
    )
    stationary_sigma_yaw: float = parameter(0.02, "noise in yaw at every update (stationary only)", unit="rad", low=0.0)

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True)
class StationaryMotion:
    """Standing still as a motion model."""

    parameters: StationaryParameters

    def sample(self, poses: FloatArray, increment: FloatArray, normals: FloatArray) -> FloatArray:
        """Shake poses (N, 3) in the base frame by normals (N, 3) for x, y and yaw; the increment (3,) is ignored."""
        del increment
        p = self.parameters
        noise = normals * np.array([p.stationary_sigma_xy, p.stationary_sigma_xy, p.stationary_sigma_yaw])
        return se2.compose(poses, noise)
