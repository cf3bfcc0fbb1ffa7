"""Where a run began and ended, how sure that is, and how well the readings fitted on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.cli.run.beginnings import pose_text

if TYPE_CHECKING:
    from mclcli.records import Estimate, TrackPoint


@final
@dataclass(slots=True)
class Ends:
    """The first update and the last one so far, and the reliability of all of them: its sum and its least."""

    first_ns: int = 0
    first: Estimate | None = None
    last_ns: int = 0
    last: Estimate | None = None
    last_reliability: float = 0.0
    ends_lost: bool = False
    converged: bool = True
    updates: int = 0
    reliability_sum: float = 0.0
    least: float = math.inf

    def take(self, point: TrackPoint) -> None:
        """Note a point; only updates count."""
        step = point.step
        if step is None:
            return
        if self.first is None:
            self.first_ns, self.first = step.stamp_ns, step.estimate
        self.last_ns, self.last = step.stamp_ns, step.estimate
        self.last_reliability, self.ends_lost, self.converged = step.reliability, step.lost, step.converged
        self.updates += 1
        self.reliability_sum += step.reliability
        self.least = min(self.least, step.reliability)

    @property
    def reliability(self) -> float:
        """Mean reliability of the updates, NaN of none."""
        return self.reliability_sum / self.updates if self.updates else math.nan

    def lines(self, first_ns: int) -> list[str]:
        """First and last pose with their standard deviations, at seconds since ``first_ns``, and the reliability."""
        if self.first is None or self.last is None:
            return []
        began, ended = ((stamp_ns - first_ns) * 1e-9 for stamp_ns in (self.first_ns, self.last_ns))
        return [
            f"first update: {place_text(self.first)} at {began:.1f} s of the log",
            f"last update: {place_text(self.last)} at {ended:.1f} s of the log",
            f"reliability: {self.reliability:.2f} on average, {self.least:.2f} at the least",
        ]

    def doubts(self) -> list[str]:
        """Why the last pose is not to be relied on."""
        if self.ends_lost:
            return [
                f"probably lost at the last update (reliability {self.last_reliability:.2f}): do not rely on its pose"
            ]
        if not self.converged:
            return ["the particles are not in one place at the last update: do not rely on its pose"]
        return []


def deviations(estimate: Estimate) -> tuple[float, float]:
    """Standard deviations: of the position along its longest axis [m], and of yaw [rad]."""
    covariance = estimate.covariance
    along = float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return math.sqrt(max(along, 0.0)), math.sqrt(max(float(covariance[2, 2]), 0.0))


def place_text(estimate: Estimate) -> str:
    """A pose as --init takes it, with its standard deviations."""
    position, yaw = deviations(estimate)
    return f"{pose_text(estimate.pose)} ± {position:.2f} m, {math.degrees(yaw):.1f}°"
