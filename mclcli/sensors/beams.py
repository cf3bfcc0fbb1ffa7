"""From a laser scan to the beams that are scored: which readings count, and where they point from the base."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.records import LaserScan


@final
@dataclass(frozen=True, slots=True)
class BeamSelection:
    """Which readings of a scan are scored."""

    max_beams: int = parameter(60, "beams scored per scan, evenly chosen; 0 takes all", low=0, in_nav2=True)
    laser_min_range: float = parameter(
        -1.0,
        "readings up to this are invalid; the larger of it and the scan's own; ≤ 0: the scan's",
        unit="m",
        in_nav2=True,
    )
    laser_max_range: float = parameter(
        -1.0, "no return from here on; the smaller of it and the scan's own; ≤ 0: the scan's", unit="m", in_nav2=True
    )
    max_range: str = parameter(
        "skip",
        "readings ≥ the maximum range or ≤ the minimum: left out, or clamped to [0, maximum] and scored",
        choices=("skip", "score"),
    )

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """B beams seen from the base at the scan's stamp.

    ``origins`` (B, 2) [m] and ``directions`` (B, 2) in the base frame: beam i of range r ends at
    ``origins + r·directions`` on the ground plane (a tilted lidar's directions are shorter than 1).
    ``ranges`` (B,) [m]; ``r_max`` [m] the range from which on nothing was seen.
    """

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]
    ranges: NDArray[np.float64]
    r_max: float

    @property
    def endpoints(self) -> NDArray[np.float64]:
        """Endpoints (B, 2) [m] in the base frame."""
        return self.origins + self.ranges[:, np.newaxis] * self.directions


def maximum_range(scan: LaserScan, selection: BeamSelection) -> float:
    """r_max [m]: the smaller of the scan's range_max and ``laser_max_range``, where set.

    Raises
    ------
    InputError
        If neither is a positive finite number.

    """
    limits = [r for r in (scan.range_max, selection.laser_max_range) if math.isfinite(r) and r > 0.0]
    if not limits:
        raise InputError(
            f"scan of frame '{scan.frame_id}': range_max is {scan.range_max:g} and laser_max_range is not set; "
            "give --set laser_max_range=METRES"
        )
    return min(limits)


def select(scan: LaserScan, base_from_sensor: NDArray[np.float64], selection: BeamSelection) -> Beams:
    """Beams of a scan to score, through the sensor's mount (4, 4) with its full 3-D rotation.

    Invalid readings are dropped first, then ``max_beams`` are chosen evenly: indices ⌈i(n−1)/(K−1)⌉.
    """
    r_max = maximum_range(scan, selection)
    valid = np.flatnonzero(_is_valid(scan, selection, r_max))
    chosen = valid[_evenly(valid.size, selection.max_beams)]
    ranges = np.clip(scan.ranges[chosen], 0.0, r_max)
    angles = scan.angle_min + chosen * scan.angle_increment
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    directions = rays @ base_from_sensor[:2, :2].T
    return Beams(np.broadcast_to(base_from_sensor[:2, 3], directions.shape), directions, ranges, r_max)


def _is_valid(scan: LaserScan, selection: BeamSelection, r_max: float) -> NDArray[np.bool_]:
    if selection.max_range == "score":
        return ~np.isnan(scan.ranges)
    r_min = max(scan.range_min, selection.laser_min_range)
    return (scan.ranges > r_min) & (scan.ranges < r_max)  # false for NaN


def _evenly(n: int, k: int) -> NDArray[np.int64]:
    """k of n indices, the first and the last among them; all where k is 0 or at least n."""
    if k in {0, n} or k > n:
        return np.arange(n)
    if k == 1:
        return np.zeros(1, np.int64)
    return -(-np.arange(k) * (n - 1) // (k - 1))
