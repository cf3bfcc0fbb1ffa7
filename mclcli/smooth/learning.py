"""How the robot of a drive measures, learned from the drive itself: of beams σ, z and offset, of odometry its noise.

Poses and parameters are found in turn, as in EM: the poses by the chain, σ and z by the beams' hit shares, the offset
by a Newton step along the beams, odometry's noise from the smoothed increments. The first rounds see the map blurred:
a wall has two faces, and the wrong one may be nearer. Sources: Dempster, Laird and Rubin 1977; Kümmerle et al. 2012.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.smooth import aside, chain, evidence, mounting, noise
from mclcli.smooth.noise import Drift
from mclcli.smooth.odometry import Jumps, Odometry
from mclcli.smooth.scans import Law, ScanFactors

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.smooth.evidence import Evidence
    from mclcli.smooth.mounting import Mounting
    from mclcli.smooth.scans import Drive, Residuals
    from mclcli.smooth.surface import Surface

_ROUNDS, _STEPS = 8, 8
_BLURRED = (0.3, 0.2, 0.1)  # [m] least σ of the first rounds
_LOOKED_ASIDE = (4, 6)  # rounds
_JUMPS = Jumps(0.001, 10.0)
_LEAST_SIGMA, _MOST_SIGMA = 0.24, 0.5  # cells (that of their quantisation is 0.29), [m]
_MOST_Z = 0.99
_FIRST, _FIRST_ALPHA = Law(0.1, 0.9), 0.5
_TRUSTED, _LEAST_TRUST = 0.6, 0.05
_EM_STEPS = 10  # of σ and z in a round, which begins where the last one ended
_TOLD = 2000  # scans that tell α, which is a mean over them
_FEW_INCREMENTS = 10
_ENOUGH = 0.003  # nats a scan: a step that gains less ends a round
_APART = 1e4  # [m², rad²] of poses that do not follow each other
_OFFSET_STEP, _MOST_OFFSET = 0.03, 0.2  # [m]
_OFFSET_PRIOR = 1.0 / 0.05**2  # [1/m²]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """What a drive says of its robot: ``law`` of its beams, ``drift`` of its odometry, ``alpha`` of its scans.

    ``poses`` (n, 3) are those of the scans it was learned from, ``evidence`` says whether the map is right,
    ``mounting`` whether the lidar is where it is said to be.
    """

    poses: FloatArray
    law: Law
    drift: Drift
    alpha: float
    evidence: Evidence
    mounting: Mounting


def learn(drive: Drive, start: FloatArray, surface: Surface) -> Learned:
    """From a drive whose scans are some way apart, near poses ``start`` (n, 3)."""
    poses, law, drift, alpha = start, _FIRST, Drift(), _FIRST_ALPHA
    trusted, enough = np.ones(len(poses)), _ENOUGH * len(poses)
    told = np.arange(0, len(poses), -(-len(poses) // _TOLD))
    for turn in range(_ROUNDS):
        blurred = turn < len(_BLURRED)
        seen = dataclasses.replace(law, sigma=max(law.sigma, _BLURRED[turn])) if blurred else law
        factors = ScanFactors(surface, drive.scans, seen, alpha * trusted)
        between = joined(drive, drift, None if blurred else _JUMPS)
        found = chain.minimise(poses[np.newaxis], factors, between, steps=_STEPS, enough=enough)
        if turn in _LOOKED_ASIDE:
            doubted = np.where(drive.breaks[1:], 0.0, found.odometry_costs[0])
            beside = aside.better(found.poses[0], doubted, factors, between)
            found = chain.minimise(beside[np.newaxis], factors, between, steps=_STEPS, enough=enough)
        poses = found.poses[0]
        residuals = factors.residuals(poses)
        if turn >= len(_BLURRED) - 1:
            trusted = trust(factors.explained(poses))
        law = _law(factors, residuals, trusted == 1.0)
        used = ~drive.breaks[1:] & (trusted[1:] == 1.0) & (trusted[:-1] == 1.0)
        if turn and used.sum() >= _FEW_INCREMENTS:
            covariances, crossed = (part[0] for part in found.joint_covariances())
            drift = noise.fit(poses, covariances, crossed, drive.increments, drift, used)
        alpha = evidence.godambe(evidence.scores_of(residuals.some(told), seen.sigma))
    scores = evidence.scores_of(residuals, seen.sigma)
    weighed = evidence.weigh(scores, residuals, evidence.tiles_of(factors, poses), alpha, surface.field.resolution)
    return Learned(poses, law, drift, weighed.alpha, weighed, mounting.estimate(found, factors, residuals, drive))


def joined(drive: Drive, drift: Drift, jumps: Jumps | None = _JUMPS) -> Odometry:
    """What joins the scans of a drive: its odometry, without what all of it is off by."""
    increments = drive.increments
    covariances = drift.covariances(increments)
    covariances[drive.breaks[1:]] = _APART * np.eye(3)
    return Odometry(drift.corrected(increments), covariances, jumps)


def trust(explained: FloatArray) -> FloatArray:
    """Factor (n,) on the temperature of scans, by the share of their beams that the map explains.

    A scan of a wing that the map lacks would else pull the track to whatever wall of the map looks most like it.
    """
    return np.where(explained >= _TRUSTED, 1.0, _LEAST_TRUST)


def _law(factors: ScanFactors, residuals: Residuals, trusted: BoolArray) -> Law:
    """σ and z by EM from the distances of trusted scans (n,), the offset by a step along their beams."""
    before, field = factors.law, factors.surface.field
    real = factors.scans.real() & trusted[:, np.newaxis]
    d = residuals.distances[real]
    if not d.size:
        return before
    clamped, sigma, z = d >= 0.999 * field.max_dist, before.sigma, before.z
    for _ in range(_EM_STEPS):
        hit = z * 2.0 / (sigma * np.sqrt(2.0 * np.pi)) * np.exp(-0.5 * (d / sigma) ** 2)
        share = np.where(clamped, 0.0, hit / (hit + (1.0 - z) / field.max_dist))
        z = min(max(float(share.mean()), 1.0 - _MOST_Z), _MOST_Z)
        sigma = float(np.sqrt((share * d * d).sum() / max(float(share.sum()), 1e-9)))
        sigma = min(max(sigma, _LEAST_SIGMA * field.resolution), _MOST_SIGMA)
    along, weight = residuals.along[real], residuals.shares[real] / before.sigma**2
    step = -float((weight * d * along).sum()) / (float((weight * along**2).sum()) + _OFFSET_PRIOR)
    offset = before.offset + min(max(step, -_OFFSET_STEP), _OFFSET_STEP)
    return Law(sigma, z, min(max(offset, -_MOST_OFFSET), _MOST_OFFSET))
