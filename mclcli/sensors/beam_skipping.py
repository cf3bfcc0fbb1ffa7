"""Beam skipping of nav2_amcl's likelihood_field_prob: beams that most particles find no obstacle for do not count.

It applies to a set that has converged only, and keeps one quirk: the verdicts stand in max_beams slots, of which those
that no valid beam filled count as skipped; when so many are skipped that all beams count again, the empty slots are
likelihoods of 0, and no pose remains possible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.native.backend import NUMPY, Backend
from mclcli.sensors import endpoints

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.endpoints import Anchoring
    from mclcli.world.distance_field import Codes, DistanceField

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
    poses: FloatArray,
    anchoring: Anchoring = endpoints.CORNER,
    found: Codes | None = None,
    backend: Backend = NUMPY,
) -> BoolArray | None:
    """Which beams (B,) count for these poses (N, 3); None if no pose can have a likelihood other than 0.

    ``found`` (B, N) are the codes of the cells where the beams end, if somebody has looked them up already.
    """
    if not (rule.always or has_converged(poses)):
        return np.ones(beams.ranges.size, dtype=np.bool_)
    shares = _agreeing(rule, field, beams, poses, anchoring, found, backend) / poses.shape[0]
    kept = np.asarray(shares > rule.threshold, np.bool_)
    slots = max(beams.slots, kept.size)
    if slots - int(kept.sum()) >= slots * rule.error_threshold:
        return np.ones(kept.size, dtype=np.bool_) if kept.size == slots else None
    return kept


def _agreeing(
    rule: BeamSkipping,
    field: DistanceField,
    beams: Beams,
    poses: FloatArray,
    anchoring: Anchoring,
    found: Codes | None,
    backend: Backend,
) -> IntArray:
    """How many poses find an obstacle near each beam's end (B,)."""
    near = int(np.count_nonzero(field.levels < rule.distance))  # levels ascend, and codes with them
    if found is not None:
        return endpoints.count_below(found, near, backend)
    count = np.zeros(beams.ranges.size, np.int64)
    for start in range(0, poses.shape[0], endpoints.BLOCK):
        some = poses[start : start + endpoints.BLOCK]
        looked_up = endpoints.look_up(field, beams.endpoints, some, anchoring=anchoring, backend=backend)
        count += endpoints.count_below(looked_up, near, backend)
    return count


def has_converged(poses: FloatArray) -> bool:
    """nav2_amcl's test: every particle within 0.5 m of the unweighted mean, in x and in y."""
    x, y = np.ascontiguousarray(poses[:, :2].T)
    farthest = max(np.abs(x - x.mean()).max(), np.abs(y - y.mean()).max())
    return bool(farthest <= _CONVERGED_RADIUS)
