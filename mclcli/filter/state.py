"""What the filter carries from one step to the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.arrays import FloatArray
    from mclcli.filter.recovery import Averages
    from mclcli.filter.temperature import Correlation


@final
@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """Particles (N, 3) and their normalised log-weights (N,) between two steps.

    ``correlations`` are what temperature ``auto`` measured, by sensor; ``way`` is how far the robot has moved [m] and
    turned [rad] since the particles were resampled; ``averages`` tell how well readings have fitted.
    """

    step: int
    poses: FloatArray
    log_weights: FloatArray
    correlations: Mapping[str, Correlation] = field(default_factory=dict)
    way: tuple[float, float] = (0.0, 0.0)
    averages: Averages | None = None


def initial_state(poses: FloatArray, step: int = 0) -> FilterState:
    """Equally weighted particles."""
    return FilterState(step, poses, uniform_log_weights(poses.shape[0]))


def uniform_log_weights(n: int) -> FloatArray:
    """log(1/n), n times."""
    return np.full(n, -np.log(n))
