"""Parameters of the search for a robot that may be anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, final, get_args

from mclcli.parameters import parameter, validate

BaseCells = Literal["free", "open", "any"]


@final
@dataclass(frozen=True, slots=True)
class SearchParameters:
    """What is searched, how closely, and when two places count as two."""

    base_cells: BaseCells = parameter(
        "free",
        "cells that may hold the robot's base: free ones; all but occupied ones; any",
        choices=get_args(BaseCells),
    )
    locate_beams: int = parameter(90, "beams of a single scan", low=1)
    window_beams: int = parameter(240, "beams of all scans of a window together", low=1)
    window_scans: int = parameter(12, "scans of a window, chosen evenly along the way", low=1)
    mode_distance: float = parameter(
        0.5, "places nearer than this, at similar angles, count as one", unit="m", above=0.0
    )
    mode_angle: float = parameter(math.radians(15.0), "angles nearer than this count as similar", unit="rad", above=0.0)
    leaf_nats: float = parameter(
        8.0, "all poses are enumerated whose tempered log-likelihood is within this of the best", above=0.0, high=40.0
    )
    off_map_prior: float = parameter(
        0.05, "probability, before looking, that the robot is not on this map", low=0.0, high=0.99
    )

    def __post_init__(self) -> None:
        validate(self)
