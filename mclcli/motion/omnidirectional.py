"""Omnidirectional drive: a motion is a move in any direction and a turn, with noise along, across and in yaw.

The variances are those of nav2_amcl's OmniMotionModel:

    σ_along² = α3·d² + α4·φ²,    σ_across² = α5·d² + α4·φ²,    σ_yaw² = α1·φ² + α2·d²

with the distance d and the turn φ of the odometry's increment (their squares with ``noise_scaling`` = step, else what
``mclcli.motion.noise`` puts in place of them). With ``noise_expression`` = deviation σ is that of ROS 1's
``omni``: the same sums without the root, with α1 and α4 exchanged. Without noise the increment is reproduced exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.motion import noise
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


@final
@dataclass(frozen=True, slots=True)
class OmnidirectionalParameters:
    """Noise of the omnidirectional drive."""

    alpha1: float = parameter(0.1, "turning noise from turning", low=0.0, in_nav2=True)
    alpha2: float = parameter(0.1, "turning noise from moving", unit="rad²/m²", low=0.0, in_nav2=True)
    alpha3: float = parameter(0.1, "moving noise from moving", low=0.0, in_nav2=True)
    alpha4: float = parameter(0.1, "moving noise from turning", unit="m²/rad²", low=0.0, in_nav2=True)
    alpha5: float = parameter(0.1, "sideways noise from moving (omnidirectional only)", low=0.0, in_nav2=True)
    noise_scaling: noise.Scaling = noise.scaling_parameter()
    noise_expression: noise.Expression = noise.expression_parameter()

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True)
class OmnidirectionalMotion:
    """The omnidirectional drive as a motion model."""

    parameters: OmnidirectionalParameters

    def sample(self, poses: FloatArray, increment: FloatArray, normals: FloatArray) -> FloatArray:
        """Move poses (N, 3) by the odometry's increment (3,), in the base frame, plus noise from normals (N, 3).

        The normals are for the noise along the move, in yaw, and across the move (to its right), as nav2 draws them.
        """
        along, turn, across = (normals * self.noise_std(increment)).T
        ux, uy = _direction(increment)
        shift = np.stack([along * ux + across * uy, along * uy - across * ux, turn], axis=-1)
        return se2.compose(poses, increment + shift)

    def noise_std(self, increment: FloatArray) -> FloatArray:
        """Standard deviations (3,) along the move [m], in yaw [rad] and across the move [m]."""
        p = self.parameters
        moved = noise.square(float(np.hypot(increment[0], increment[1])), noise.MOVE, p.noise_scaling)
        turned = noise.square(float(se2.wrap(increment[2])), noise.TURN, p.noise_scaling)
        of_turns, of_moves = p.alpha1, p.alpha4
        if p.noise_expression == "deviation":  # ROS 1's omni exchanges them
            of_turns, of_moves = of_moves, of_turns
        sums = [
            p.alpha3 * moved + of_moves * turned,
            of_turns * turned + p.alpha2 * moved,
            p.alpha5 * moved + of_moves * turned,
        ]
        return noise.deviations(sums, p.noise_expression)


def _direction(increment: FloatArray) -> tuple[float, float]:
    """Unit vector along the move; ahead where there is none (its noise is then alike in all directions)."""
    distance = float(np.hypot(increment[0], increment[1]))
    return (float(increment[0]) / distance, float(increment[1]) / distance) if distance else (1.0, 0.0)
