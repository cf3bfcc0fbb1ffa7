"""The best track of a drive: every scan and every increment of odometry, and what they say of themselves.

Scans a quarter of a metre or a fifth of a radian apart, the *keys*, say how the robot measures (``learning``). With
what was learned all scans are smoothed; those of the same place share one's temperature, for they see the same errors
of the map's cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.smooth import chain, learning, map_errors, noise
from mclcli.smooth.learning import trust
from mclcli.smooth.scans import ScanFactors

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.smooth.learning import Learned
    from mclcli.smooth.scans import Drive
    from mclcli.smooth.surface import Surface

_STEPS = 12
_ROUNDS = 2
_ENOUGH = 3e-4  # nats a key: a step that gains less is the last
_PLACES = 2.0  # in a unit of way


@final
@dataclass(frozen=True, slots=True, eq=False)
class BestTrack:
    """Poses (n, 3) and covariances (n, 3, 3) of all scans, and what was learned on the way.

    ``reliability`` (n,) is that of the filter: about the share of a scan's beams that the map explains.
    ``scan_costs`` (n,) and ``odometry_costs`` (n − 1,) [nats] are what is left of −α log p, of beams above that of
    beams which all end at walls; ``converged`` is False where the steps did not come to an end.
    """

    poses: FloatArray
    covariances: FloatArray
    reliability: FloatArray
    scan_costs: FloatArray
    odometry_costs: FloatArray
    converged: bool
    learned: Learned
    keys: IntArray


def smooth(drive: Drive, start: FloatArray, surface: Surface) -> BestTrack:
    """The most probable track near ``start`` (n, 3), over the distances to the walls' faces."""
    along = np.concatenate([[0.0], np.cumsum(np.where(drive.breaks[1:], 1.0, noise.way(drive.increments)))])
    keys = _keys(along, drive.breaks)
    learned = learning.learn(drive.some(keys), start[keys], surface)
    poses = _carried(learned.poses, drive.odometry, keys)
    _, place, crowd = np.unique(np.floor(_PLACES * along), return_inverse=True, return_counts=True)
    factors = ScanFactors(surface, drive.scans, learned.law, learned.alpha / crowd[place])
    between, enough = learning.joined(drive, learned.drift), _ENOUGH * len(keys)
    for _ in range(_ROUNDS):
        trusted = ScanFactors(surface, drive.scans, learned.law, factors.alphas * trust(factors.explained(poses)))
        found = chain.minimise(poses[np.newaxis], trusted, between, steps=_STEPS, enough=enough)
        poses = found.poses[0]
    covariances = found.covariances()[0] + _of_sweeps(drive, poses, learned)
    if learned.evidence.doubtful:
        covariances += map_errors.covariances(factors, poses, learned.evidence.misfit)
    return BestTrack(
        poses,
        covariances,
        factors.reliability(poses),
        found.unary_costs[0] - trusted.least_costs(),
        found.odometry_costs[0],
        bool(found.converged[0]),
        learned,
        keys,
    )


def _keys(along: FloatArray, breaks: BoolArray) -> IntArray:
    """The first scan of every unit of way, and after every break."""
    return np.flatnonzero(np.concatenate([[True], np.diff(np.floor(along)) > 0.0]) | breaks)


def _carried(poses: FloatArray, odometry: FloatArray, keys: IntArray) -> FloatArray:
    """Poses (n, 3) of all scans: those of the keys before them, carried on by odometry (n, 3)."""
    before = np.searchsorted(keys, np.arange(len(odometry)), side="right") - 1
    return se2.compose(poses[before], se2.between(odometry[keys[before]], odometry))


def _of_sweeps(drive: Drive, poses: FloatArray, learned: Learned) -> FloatArray:
    """What odometry within a scan adds (n, 3, 3): the scan tells the pose at its middle, not that at its stamp."""
    moving = (drive.sweeps != 0.0).any(axis=1)
    found = np.zeros((len(poses), 3, 3))
    c, s = np.cos(poses[moving, 2]), np.sin(poses[moving, 2])
    turned = np.zeros((len(c), 3, 3))
    turned[:, 0, 0], turned[:, 0, 1], turned[:, 1, 0], turned[:, 1, 1], turned[:, 2, 2] = c, -s, s, c, 1.0
    own = learned.drift.covariances(drive.sweeps[moving])
    found[moving] = turned @ own @ turned.transpose(0, 2, 1)
    return found
