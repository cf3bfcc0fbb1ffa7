"""Beam skipping of nav2_amcl's likelihood_field_prob: beams that most particles find no obstacle for do not count.

It applies to a set that has converged only, and keeps one quirk: the verdicts stand in max_beams slots, of which those
that no valid beam filled count as skipped; when so many are skipped that all beams count again, the empty slots are
likelihoods of 0, and no pose remains possible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.sensors import endpoints

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.sensors.beams import Beams
    from mclcli.sensors.endpoints import Anchoring
    from mclcli.world.distance_field import DistanceField

_CONVERGED_RADIUS = 0.5  # [m] nav2_amcl's dist_threshold


@final
@dataclass(frozen=True, slots=True)
class BeamSkipping:
    """nav2's three figures: distance [m], share of particles, share of beams. ``always`` takes any set as converged."""

    distance: float
    threshold: float
    error_threshold: float
    always: bool = False


def kept_beams(
    rule: BeamSkipping,
    field: DistanceField,
    beams: Beams,
    poses: NDArray[np.float64],
    anchoring: Anchoring = endpoints.CORNER,
) -> NDArray[np.bool_] | None:
    """Which beams (B,) count for these poses (N, 3); None if no pose can have a likelihood other than 0."""
    if not (rule.always or has_converged(poses)):
        return np.ones(beams.ranges.size, dtype=np.bool_)
    agree = np.append(field.levels < rule.distance, False).astype(np.float64)
    shares = [
        endpoints.sum_table(field, agree, end[np.newaxis], poses, anchoring=anchoring).mean() for end in beams.endpoints
    ]
    kept = np.array(shares) > rule.threshold
    slots = max(beams.slots, kept.size)
    if slots - int(kept.sum()) >= slots * rule.error_threshold:
        return np.ones(kept.size, dtype=np.bool_) if kept.size == slots else None
    return kept


def has_converged(poses: NDArray[np.float64]) -> bool:
    """nav2_amcl's test: every particle within 0.5 m of the unweighted mean, in x and in y."""
    xy = poses[:, :2]
    return bool(np.abs(xy - xy.mean(axis=0)).max() <= _CONVERGED_RADIUS)
