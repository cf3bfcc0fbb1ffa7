"""Errors of a track against a reference, without alignment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import se2
from mclcli.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.evaluate.trajectory import Trajectory

_MAX_GAP_NS = 15_000_000_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Absolute pose errors at the M stamps of a track that the reference covers, of ``total`` in all.

    ``translation`` (M,) [m], Euclidean; ``yaw`` (M,) [rad], signed.
    """

    stamps_ns: NDArray[np.int64]
    translation: NDArray[np.float64]
    yaw: NDArray[np.float64]
    total: int

    @property
    def translation_rmse(self) -> float:
        """Root mean square of the translation errors [m]."""
        return float(np.sqrt(np.mean(self.translation**2)))

    @property
    def yaw_rmse(self) -> float:
        """Root mean square of the yaw errors [rad]."""
        return float(np.sqrt(np.mean(self.yaw**2)))


def absolute_pose_errors(track: Trajectory, reference: Trajectory, max_gap_ns: int = _MAX_GAP_NS) -> PoseErrors:
    """Errors of each pose of the track against the reference interpolated at its stamp.

    Raises
    ------
    InputError
        If the reference covers no pose of the track.

    """
    expected, covered = reference.at(track.stamps_ns, max_gap_ns)
    if not covered.any():
        raise InputError("the reference covers no stamp of the track; are both of the same log and clock?")
    error = track.poses[covered] - expected[covered]
    translation = np.hypot(error[:, 0], error[:, 1])
    return PoseErrors(track.stamps_ns[covered], translation, se2.wrap(error[:, 2]), covered.size)
