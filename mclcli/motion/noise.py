"""How noise grows with motion."""

from __future__ import annotations

from typing import Literal, get_args

from mclcli.parameters import parameter

MOVE, TURN = 0.25, 0.2  # [m], [rad] between updates at which both scalings agree: the default gate
Scaling = Literal["distance", "step"]


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
