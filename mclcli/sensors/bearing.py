"""Bearings to landmarks with an outlier mixture.

    p(β | x) = (1−ε) · N(e; 0, σ_β²) + ε / 2π,    e = wrap(β − β*),    β* = atan2(l_y − c_y, l_x − c_x) − θ

with c the camera's position for the pose x and l the landmark; an id that is not in the map contributes 1 / 2π.
Source: Thrun, Burgard, Fox 2005, sections 6.6.2 (landmark measurement) and 6.3.1 (mixture with a uniform).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.native import backend
from mclcli.parameters import parameter, validate
from mclcli.sensors import Measurement, floored_log

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.records import LandmarkSightings
    from mclcli.sensors import Temperature
    from mclcli.world.landmarks import Landmarks

FLOOR = 1e-15


@final
@dataclass(frozen=True, slots=True)
class BearingParameters:
    """Parameters of the bearing mixture."""

    sigma_bearing: float = parameter(
        math.radians(3.0), "standard deviation of a bearing", unit="rad", above=0.0, high=1.0
    )
    eps_outlier: float = parameter(
        0.1, "share of sightings that mean nothing (wrong id, reflection)", low=0.0, high=1.0
    )

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Bearings:
    """M bearings in the camera's level frame, which stands on the base at the camera's position.

    ``origin`` (2,) [m]: the camera in the base frame; ``angles`` (M,) [rad] relative to the base's heading;
    ``landmarks`` (M, 2) [m]: where the sighted ids stand in map; ``unknown`` further sightings named no known id.
    ``ids`` (M,) and ``unknown_ids`` say which is which.
    """

    origin: FloatArray
    angles: FloatArray
    landmarks: FloatArray
    unknown: int
    ids: tuple[str, ...] = ()
    unknown_ids: tuple[str, ...] = ()


def observe(sightings: LandmarkSightings, base_from_sensor: FloatArray, landmarks: Landmarks) -> Bearings:
    """Bearings from rays in the sensor's frame, through its mount (4, 4): the rays are rotated level first.

    A ray straight up or down has no bearing; it counts as unknown.
    """
    rays = np.einsum("mi,ji->mj", sightings.rays, base_from_sensor[:3, :3])  # no BLAS: same bits for any number
    index = landmarks.lookup(sightings.ids)
    level = np.hypot(rays[:, 0], rays[:, 1]) > 1e-9 * np.linalg.norm(rays, axis=1)
    known = (index >= 0) & level
    angles = np.arctan2(rays[known, 1], rays[known, 0])
    ids = tuple(name for name, is_known in zip(sightings.ids, known, strict=True) if is_known)
    others = tuple(name for name, is_known in zip(sightings.ids, known, strict=True) if not is_known)
    return Bearings(base_from_sensor[:2, 3], angles, landmarks.positions[index[known], :2], len(others), ids, others)


def expected_angles(bearings: Bearings, pose: FloatArray) -> FloatArray:
    """Bearings (M,) [rad] relative to the base's heading that the map expects at a pose (3,)."""
    camera = se2.compose(pose, [*bearings.origin, 0.0])
    offset = bearings.landmarks - camera[:2]
    return se2.wrap(np.arctan2(offset[:, 1], offset[:, 0]) - pose[2])


@final
@dataclass(frozen=True, slots=True)
class BearingModel:
    """The mixture; ``job_size`` hints how many pose·bearing pairs will be scored in all."""

    parameters: BearingParameters
    job_size: float = 0.0

    def measure(self, sensor: str, bearings: Bearings, alpha: Temperature = 1.0) -> Measurement:
        """Measurement that scores poses against these bearings."""
        count = bearings.angles.size + bearings.unknown
        peak, floor = self.log_p(np.array([0.0, math.pi])) * bearings.angles.size - math.log(se2.TAU) * bearings.unknown
        score, unknown = functools.partial(self._score, bearings), bearings.unknown
        return Measurement(sensor, score, count, float(peak), alpha, unknown=unknown, log_floor=float(floor))

    def log_p(self, error: FloatArray) -> FloatArray:
        """Log-likelihood of bearing errors [rad] in (−π, π], any shape."""
        sigma, eps = self.parameters.sigma_bearing, self.parameters.eps_outlier
        density = np.exp(-0.5 * (error / sigma) ** 2) / (sigma * math.sqrt(se2.TAU))
        return floored_log((1.0 - eps) * density + eps / se2.TAU, FLOOR)

    def _score(self, bearings: Bearings, poses: FloatArray) -> FloatArray:
        """Log-likelihood (N,) of poses (N, 3) of the base in map."""
        total = np.full(poses.shape[0], -math.log(se2.TAU) * bearings.unknown)
        pairs = poses.shape[0] * bearings.angles.size
        is_compiled = backend.worth_compiling(max(self.job_size, pairs))
        (self._add_compiled if is_compiled else self._add)(bearings, poses, total)
        return total

    def _add(self, bearings: Bearings, poses: FloatArray, total: FloatArray) -> None:
        """Add each known bearing's log-likelihood to ``total`` (N,)."""
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        camera_x = poses[:, 0] + c * bearings.origin[0] - s * bearings.origin[1]
        camera_y = poses[:, 1] + s * bearings.origin[0] + c * bearings.origin[1]
        for angle, landmark in zip(bearings.angles, bearings.landmarks, strict=True):
            expected = np.arctan2(landmark[1] - camera_y, landmark[0] - camera_x) - poses[:, 2]
            total += self.log_p(se2.wrap(angle - expected))

    def _add_compiled(self, bearings: Bearings, poses: FloatArray, total: FloatArray) -> None:
        """``_add`` by the kernel ``bearing.sum_log_p``, which rounds otherwise."""
        sigma, eps = self.parameters.sigma_bearing, self.parameters.eps_outlier
        sightings = np.stack([*bearings.landmarks.T, np.cos(bearings.angles), np.sin(bearings.angles)])
        poses, scratch = np.ascontiguousarray(poses), np.empty((5, 256))
        kernel = backend.load("bearing").sum_log_p
        kernel(poses, sightings, *map(float, bearings.origin), sigma, eps, FLOOR, total, scratch)
