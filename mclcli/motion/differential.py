"""Differential drive: a motion is a turn, a straight move and another turn, each with its own noise.

Source: Thrun, Burgard, Fox 2005, table 5.6, with three repairs: reverse driving is a negative move instead of two
half turns (so that a noisy half turn cannot flip the heading), sub-centimetre motions have no meaningful first turn to
derive noise from, and without noise the odometry's increment is reproduced exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final, get_args

import numpy as np

from mclcli.geometry import se2
from mclcli.geometry.trigonometry import cos_sin
from mclcli.motion import noise
from mclcli.native.backend import NUMPY, Backend
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

_SMALL_MOVE = 0.01  # [m] below this the direction of a move is odometry noise (as in nav2_amcl)


TurnNoise = Literal["full", "folded"]


@final
@dataclass(frozen=True, slots=True)
class DifferentialParameters:
    """Noise of the differential drive."""

    alpha1: float = parameter(0.1, "turning noise from turning", low=0.0, in_nav2=True)
    alpha2: float = parameter(0.1, "turning noise from moving", unit="rad²/m²", low=0.0, in_nav2=True)
    alpha3: float = parameter(0.1, "moving noise from moving", low=0.0, in_nav2=True)
    alpha4: float = parameter(0.1, "moving noise from turning", unit="m²/rad²", low=0.0, in_nav2=True)
    turn_noise: TurnNoise = parameter(
        "full",
        "noise of a turn beyond 90° between updates: that of the full turn, or folded as if driving backwards",
        choices=get_args(TurnNoise),
        source="folded: nav2_amcl, Beluga",
    )
    noise_scaling: noise.Scaling = noise.scaling_parameter()
    noise_expression: noise.Expression = noise.expression_parameter()

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True)
class DifferentialMotion:
    """The differential drive as a motion model."""

    parameters: DifferentialParameters
    backend: Backend = NUMPY

    def sample(self, poses: FloatArray, increment: FloatArray, normals: FloatArray) -> FloatArray:
        """Move poses (N, 3) by the odometry's increment (3,), in the base frame, plus noise from normals (N, 3)."""
        turns_and_move = decompose(increment)
        motion, std = np.array(turns_and_move), self.noise_std(*turns_and_move)
        kernels = self.backend.kernels("particles")
        if kernels is not None:
            moved, scratch = np.empty_like(poses), np.empty((3, 512))
            kernels.turn_move_turn(poses, normals, motion, std, moved, scratch)
            return moved
        noisy = motion + normals * std
        heading = poses[:, 2] + noisy[:, 0]
        c, s = cos_sin(heading)
        moved = np.empty_like(poses)
        moved[:, 0] = poses[:, 0] + noisy[:, 1] * c
        moved[:, 1] = poses[:, 1] + noisy[:, 1] * s
        moved[:, 2] = se2.wrap(heading + noisy[:, 2])
        return moved

    def noise_std(self, rot1: float, trans: float, rot2: float) -> FloatArray:
        """Standard deviations (3,) of first turn [rad], move [m] and second turn [rad]."""
        p = self.parameters
        if abs(trans) < _SMALL_MOVE:
            rot1, rot2 = 0.0, se2.wrap_one(rot1 + rot2)
        if p.turn_noise == "folded":
            rot1, rot2 = folded(rot1), folded(rot2)
        turn1, turn2 = (noise.square(turn, noise.TURN, p.noise_scaling) for turn in (rot1, rot2))
        move = noise.square(trans, noise.MOVE, p.noise_scaling)
        sums = [
            p.alpha1 * turn1 + p.alpha2 * move,
            p.alpha3 * move + p.alpha4 * (turn1 + turn2),
            p.alpha1 * turn2 + p.alpha2 * move,
        ]
        return noise.deviations(sums, p.noise_expression)


def folded(turn: float) -> float:
    """Size of a turn [rad], or of what is missing to half a turn if that is less: at most π/2."""
    return min(abs(turn), np.pi - abs(turn))


def decompose(increment: FloatArray) -> tuple[float, float, float]:
    """First turn, signed move and second turn of an increment (3,); |first turn| ≤ π/2, backwards moves negative."""
    dx, dy, dyaw = increment.tolist()
    forward = dx >= 0.0
    trans = float(np.hypot(dx, dy)) * (1.0 if forward else -1.0)
    rot1 = float(np.arctan2(dy, dx) if forward else np.arctan2(-dy, -dx)) if trans else 0.0
    return rot1, trans, se2.wrap_one(dyaw - rot1)
