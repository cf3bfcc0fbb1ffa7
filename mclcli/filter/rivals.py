"""Places where a robot that seems lost may be instead, and how long they have held out beside what the filter believes.

A single reading fits somewhere on every map. So a pose that was drawn anew does not become a particle at once: it moves
with the robot, and has to fit update after update.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.filter import fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.sensors import Measurement

HELD_OUT = 3  # updates that a rival drawn at random has to fit before it may become a particle
HELD_OUT_IF_FOUND = 5  # one that a search has found, but is not sure of: it was chosen because it fits
SURE = 0.9  # probability of its place from which on a rival need not wait; hardly any is surer than 0.93
_AS_USUAL = 0.93  # of how well readings have fitted on the whole, that a rival has to fit
_REMEMBERED = 5  # updates in a row at which the robot seems right, after which its rivals are forgotten


@final
@dataclass(frozen=True, slots=True, eq=False)
class Rivals:
    """Poses (K, 3), at how many updates in a row each has fitted (K,), and how probable its place was (K,).

    ``right`` counts the updates in a row at which the robot did not seem lost.
    """

    poses: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    ages: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    probabilities: FloatArray = field(default_factory=lambda: np.empty(0))
    right: int = 0

    def moved_to(self, poses: FloatArray, *, lost: bool) -> Rivals:
        """These at an update to which they moved; none once the robot has seemed right for long."""
        right = 0 if lost else self.right + 1
        return Rivals(poses, self.ages, self.probabilities, right) if right <= _REMEMBERED else Rivals()

    def joined_by(self, poses: FloatArray, probabilities: FloatArray) -> Rivals:
        """These and new ones (L, 3), whose places are so probable (L,)."""
        return Rivals(
            np.concatenate([self.poses, poses]),
            np.concatenate([self.ages, np.zeros(len(poses), np.int64)]),
            np.concatenate([self.probabilities, probabilities]),
            self.right,
        )

    def judged(self, measurements: Sequence[Measurement], usual: float, most: int) -> Rivals:
        """Those that fit this update too, about as well as is ``usual``, each by one older; the oldest, so many."""
        fits = fit.of_poses(measurements, self.poses) >= max(fit.PROBABLY_LOST, _AS_USUAL * usual)
        kept = np.flatnonzero(fits)
        kept = kept[np.argsort(-self.ages[kept], kind="stable")][:most]
        return Rivals(self.poses[kept], self.ages[kept] + 1, self.probabilities[kept], self.right)

    @property
    def proven(self) -> FloatArray:
        """Poses (M, 3) that have held out long enough, or whose place is sure."""
        needed = np.where(self.probabilities > 0.0, HELD_OUT_IF_FOUND, HELD_OUT)
        return self.poses[(self.ages >= needed) | (self.probabilities >= SURE)]
