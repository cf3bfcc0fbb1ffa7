"""Likelihood field: how near to an obstacle each beam ends.

    p(r_i | x) = z_hit · exp(−d² / 2σ²) + z_rand / r_max,    log p(z | x) = Σ_i log p(r_i | x)

with d the distance of the endpoint's cell to the nearest occupied cell. Unnormalised on purpose: not a density in r.
Source: Thrun, Burgard, Fox 2005, *Probabilistic Robotics*, table 6.3.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import compiled
from mclcli.parameters import parameter, validate
from mclcli.sensors import Measurement, floored_log

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mclcli.sensors.beams import Beams
    from mclcli.world.distance_field import DistanceField

FLOOR = 1e-12
_BLOCK = 4096  # poses whose temporaries stay in the second-level cache


@final
@dataclass(frozen=True, slots=True)
class LikelihoodFieldParameters:
    """Parameters of the likelihood field."""

    z_hit: float = parameter(0.5, "weight of the hit component", low=0.0, in_nav2=True)
    z_rand: float = parameter(0.5, "weight of the uniform component over [0, r_max]", low=0.0, in_nav2=True)
    sigma_hit: float = parameter(0.2, "standard deviation of the hit component", unit="m", above=0.0, in_nav2=True)
    laser_likelihood_max_dist: float = parameter(
        2.0, "distances to obstacles are clamped here", unit="m", above=0.0, in_nav2=True
    )
    field_method: str = parameter(
        "exact", "Euclidean distances, or shortest 8-neighbour paths", choices=("exact", "brushfire")
    )

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True, eq=False)
class LikelihoodField:
    """The model over one distance field.

    ``job_size`` hints how many pose·beam pairs will be scored in all; ``threads`` share one scoring.
    """

    field: DistanceField
    parameters: LikelihoodFieldParameters
    job_size: float = 0.0
    threads: int = 1

    def measure(self, sensor: str, beams: Beams, alpha: float = 1.0) -> Measurement:
        """Measurement that scores poses against these beams."""
        table = self.log_p(beams.r_max)
        score = functools.partial(self._score, beams.endpoints, table)
        return Measurement(sensor, score, beams.ranges.size, beams.ranges.size * float(table[0]), alpha)

    def log_p(self, r_max: float) -> NDArray[np.float64]:
        """Log-likelihood (L,) of a reading that ends at each level of the field."""
        p = self.parameters
        hit = p.z_hit * np.exp(-0.5 * (self.field.levels / p.sigma_hit) ** 2)
        return floored_log(hit + p.z_rand / r_max, FLOOR)

    def _score(
        self, endpoints: NDArray[np.float64], table: NDArray[np.float64], poses: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Σ log p (N,) over the endpoints (B, 2), given in the base frame, for poses (N, 3) of the base in map."""
        ends = endpoints / self.field.resolution
        end_x, end_y = np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1])
        steps = max(self.job_size, poses.shape[0] * end_x.size)
        add = compiled.load("likelihood_field").sum_log_p if compiled.worth_compiling(steps) else add_log_p
        out = np.zeros(poses.shape[0])

        def score_block(start: int) -> None:
            x, y, yaw = to_cells(self.field, poses[start : start + _BLOCK])
            part = out[start : start + _BLOCK]
            add(self.field.codes, table, x, y, np.cos(yaw), np.sin(yaw), end_x, end_y, part)

        _for_each(score_block, range(0, poses.shape[0], _BLOCK), self.threads)
        return out


def _for_each(task: Callable[[int], None], starts: range, threads: int) -> None:
    """Run independent blocks; the result is the same for any number of threads."""
    if threads == 1 or len(starts) == 1:
        for start in starts:
            task(start)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(task, starts))


def to_cells(
    field: DistanceField, poses: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Poses (N, 3) in map as column, row [cells, continuous] and yaw [rad] in the field's own frame."""
    origin_x, origin_y, origin_yaw = field.origin
    dx, dy = poses[:, 0] - origin_x, poses[:, 1] - origin_y
    if origin_yaw == 0.0:
        return dx / field.resolution, dy / field.resolution, poses[:, 2].copy()
    c, s = math.cos(origin_yaw), math.sin(origin_yaw)
    return (c * dx + s * dy) / field.resolution, (c * dy - s * dx) / field.resolution, poses[:, 2] - origin_yaw


def add_log_p(
    codes: NDArray[np.uint16] | NDArray[np.uint32],
    log_p: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    cos: NDArray[np.float64],
    sin: NDArray[np.float64],
    end_x: NDArray[np.float64],
    end_y: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """The formula in NumPy; equal to the bit to the kernel ``likelihood_field.sum_log_p``, which see."""
    height, width = codes.shape
    for bx, by in zip(end_x, end_y, strict=True):
        column = np.floor(x + (cos * bx - sin * by))
        row = np.floor(y + (sin * bx + cos * by))
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        cell = np.where(inside, row * width + column, 0).astype(np.intp)
        out += np.where(inside, log_p[codes.ravel()[cell]], log_p[-1])
