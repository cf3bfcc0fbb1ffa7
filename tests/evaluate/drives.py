"""Drives for the tests of evaluation: a reference, and tracks with errors laid out by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2
from mclcli.geometry.trajectory import Trajectory
from tests.support import SECOND

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mclcli.arrays import FloatArray

EPOCH = 1_700_000_000 * SECOND


def drive(at: ArrayLike, speed: float = 0.5, turn: float = 0.1) -> Trajectory:
    """A reference that drives an arc, at seconds since EPOCH."""
    seconds = np.asarray(at, dtype=np.float64)
    poses = se2.exp(np.stack([speed * seconds, np.zeros(seconds.size), turn * seconds], axis=-1))
    return Trajectory(EPOCH + np.round(seconds * SECOND).astype(np.int64), poses)


def shifted(reference: Trajectory, dx: FloatArray | float, dyaw: FloatArray | float = 0.0) -> Trajectory:
    """The reference with errors along the map's x, and in yaw."""
    size = reference.stamps_ns.size
    error = np.stack([np.broadcast_to(dx, size), np.zeros(size), np.broadcast_to(dyaw, size)], axis=-1)
    poses = reference.poses + error
    poses[:, 2] = se2.wrap(poses[:, 2])
    return Trajectory(reference.stamps_ns, poses)


def noisy(seed: int, count: int = 80, sigma: float = 0.05) -> tuple[Trajectory, Trajectory]:
    """A reference, and a track with independent noise and random stamps within it."""
    draws = np.random.default_rng(seed)
    reference = drive(np.arange(count) * 0.25)
    seconds = np.sort(draws.choice(np.arange(1, 250 * (count - 1)), count // 2, replace=False)) * 1e-3
    exact = drive(seconds)
    poses = exact.poses + draws.normal(0.0, sigma, exact.poses.shape)
    return Trajectory(exact.stamps_ns, poses), reference


def as_tum(trajectory: Trajectory) -> str:
    """Text of a TUM file with comments and an empty line."""
    lines = ["# made by a test", ""]
    for stamp, (x, y, yaw) in zip(trajectory.stamps_ns.tolist(), trajectory.poses.tolist(), strict=True):
        seconds, rest = divmod(stamp, SECOND)
        lines.append(f"{seconds}.{rest:09d} {x:.12f} {y:.12f} 0 0 0 {np.sin(yaw / 2):.12f} {np.cos(yaw / 2):.12f}")
    return "\n".join(lines) + "\n"
