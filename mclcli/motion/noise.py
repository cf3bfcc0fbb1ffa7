"""How noise grows with motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from mclcli.parameters import parameter

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

MOVE, TURN = 0.25, 0.2  # [m], [rad] between updates at which both scalings agree: the default gate
Scaling = Literal["distance", "step"]
Expression = Literal["variance", "deviation"]


def scaling_parameter() -> Scaling:
    """The field ``noise_scaling``, the same for every motion model that has it."""
    default: Scaling = parameter(
        "distance",
        "variances are proportional to the motion between two updates, as of a random walk, or to its square",
        choices=get_args(Scaling),
        source="step: Thrun, Burgard, Fox 2005, table 5.6",
    )
    return default


def square(motion: float, at: float, scaling: Scaling) -> float:
    """What a variance is proportional to, for a move [m] or turn [rad] and where both scalings agree.

    With ``step`` the noise of one motion depends on how many updates it is cut into: twice as many halve the variance.
    """
    return motion * motion if scaling == "step" else abs(motion) * at


def expression_parameter() -> Expression:
    """The field ``noise_expression``, the same for every motion model that has it."""
    default: Expression = parameter(
        "variance",
        "what the sum of alphas times squares is: the noise's variance, or, as in ROS 1's `diff` and `omni`, taken for "
        "its standard deviation (`omni` exchanges alpha1 and alpha4 as well)",
        choices=get_args(Expression),
        source="deviation: ROS 1's amcl; variance: its `-corrected` models",
    )
    return default


def deviations(sums: list[float], expression: Expression) -> FloatArray:
    """Standard deviations (3,) from the three sums of alphas times squares."""
    return np.array(sums) if expression == "deviation" else np.sqrt(sums)
