"""What is left of beams at the smoothed poses: how much the scans know, and whether the map is right.

s = −w d J are the scores of the beams and H = Σ w J Jᵀ the curvature of a scan. Independent beams would have
E Σ s sᵀ = H. Neighbouring beams, and scans that see the same wall, are not independent where the map is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.smooth.scans import Residuals, ScanFactors

_FEW_BEAMS = 12
_ARM = 0.3  # [m]: what an angle is worth where a curvature is said to be flat
_TILE = 2.0  # [m]
_LAGS = 60
_LEAST_LAG = 4
_FEW_HITS = 30.0  # in a tile whose misfit counts
MOST_TAU = 13.0
_MOST_MISFIT, _LEAST_LIMIT = 0.12, 0.004  # cells, [m]
FEW_SCANS = 50


class Scores(NamedTuple):
    """Scores (n, K, 3) and curvatures (n, 3, 3) of n scans, untempered; ``sharp`` (n,) tells those that know a pose."""

    scores: FloatArray
    curvatures: FloatArray
    sharp: BoolArray


@final
@dataclass(frozen=True, slots=True)
class Evidence:
    """Whether scans are as independent as those over a right map are.

    ``godambe`` is α of the beams of a scan; ``tau`` how many scans in a row tell the same as one; ``misfit`` [m] how
    far from the walls of a piece of 2 m of the map beams end on average. ``limit`` [m] is the most that a right map
    has; ``scans`` of them were looked at.
    """

    godambe: float
    tau: float
    misfit: float
    limit: float
    scans: int

    @property
    def repeated(self) -> bool:
        """Whether errors are repeated from scan to scan."""
        return self.tau > MOST_TAU

    @property
    def misfitting(self) -> bool:
        """Whether walls are not where the map has them."""
        return self.misfit > self.limit

    @property
    def doubtful(self) -> bool:
        """Whether the map looks wrong."""
        return self.repeated or self.misfitting

    @property
    def scarce(self) -> bool:
        """Whether there are too few scans to tell."""
        return self.scans < FEW_SCANS

    @property
    def alpha(self) -> float:
        """Temperature of a scan: that of its beams, over a wrong map that of scans that repeat each other as well."""
        return min(self.godambe, 1.0 / max(self.tau, 1.0)) if self.doubtful else self.godambe


def weigh(scores: Scores, found: Residuals, tiles: IntArray, alpha: float, resolution: float) -> Evidence:
    """Evidence of smoothed scans: ``tiles`` as of ``tiles_of``, ``alpha`` of ``godambe``, cells of so many metres."""
    limit = max(_MOST_MISFIT * resolution, _LEAST_LIMIT)
    return Evidence(alpha, tau(scores, tiles), misfit(found, tiles), limit, len(tiles))


def scores_of(found: Residuals, sigma: float) -> Scores:
    """Scores of beams at smoothed poses."""
    weights = found.shares / sigma**2
    scores = -(weights * found.distances)[..., np.newaxis] * found.jacobians
    curvatures = np.einsum("nk,nki,nkj->nij", weights, found.jacobians, found.jacobians)
    arms = np.array([1.0, 1.0, _ARM])
    values = np.linalg.eigvalsh(curvatures * np.outer(arms, arms))
    enough = (found.jacobians != 0.0).any(axis=-1).sum(axis=1) >= _FEW_BEAMS
    return Scores(scores, curvatures + 1e-3 * np.eye(3), enough & (values[:, 0] > 1e-3 * values[:, 2]))


def godambe(known: Scores) -> float:
    """α = 3 / mean tr(H⁻¹ J), J the covariance of a scan's score with that of neighbouring beams; 0.5 of no scan.

    Sources: Pauli, Racugno and Ventura 2011 (α of a composite likelihood); Newey and West 1987 (the sum over lags).
    """
    s, h = known.scores[known.sharp], known.curvatures[known.sharp]
    if not len(s):
        return 0.5
    lags = max(_LEAST_LAG, s.shape[1] // 6)
    total = np.einsum("nki,nkj->nij", s, s)
    for lag in range(1, min(lags, s.shape[1] - 1) + 1):
        lagged = np.einsum("nki,nkj->nij", s[:, lag:], s[:, :-lag])
        total += (1.0 - lag / (lags + 1)) * (lagged + lagged.transpose(0, 2, 1))
    each = np.trace(np.linalg.solve(h, total), axis1=1, axis2=2) / 3.0
    return float(min(1.0, 1.0 / max(float(each.mean()), 1e-9)))


def tau(known: Scores, tiles: IntArray) -> float:
    """τ₁ = C₀ + 2 Σ C_l up to the first C_l that is not positive: errors of the map, as scans repeat them.

    Scores are summed by scan and tile and whitened by the scan's curvature, v; C_l is the mean over scans k of
    ⅓ Σ_c v_{k,c} · v_{k+l,c}. ``tiles`` (n, K) are as of ``tiles_of``.
    """
    values, vectors = np.linalg.eigh(known.curvatures)
    values = np.maximum(values, 1e-3 * values[:, 2:] + 1e-9)
    root = (vectors / np.sqrt(values)[:, np.newaxis]) @ vectors.transpose(0, 2, 1)
    white = np.einsum("nij,nkj->nki", root, known.scores)
    n, real = len(tiles), tiles >= 0
    keys = (tiles * (n + _LAGS + 1) + np.arange(n)[:, np.newaxis])[real]
    unique, inverse = np.unique(keys, return_inverse=True)
    if not unique.size:
        return 0.0
    sums = np.stack([np.bincount(inverse, white[..., i][real], unique.size) for i in range(3)], axis=-1)
    total = 0.0
    for lag in range(min(_LAGS, n - 1) + 1):
        at = np.minimum(np.searchsorted(unique, unique + lag), unique.size - 1)
        both = unique[at] == unique + lag
        repeated = float((sums[both] * sums[at[both]]).sum()) / (3.0 * n)
        if repeated <= 0.0:
            break
        total += repeated if lag == 0 else 2.0 * repeated
    return total


def tiles_of(factors: ScanFactors, poses: FloatArray) -> IntArray:
    """Number (n, K) of the piece of 2 m of the map where each beam ends at poses (n, 3); −1 where there is no beam."""
    ends = factors.scans.ends + np.float32(factors.law.offset) * factors.scans.directions
    c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x = poses[:, :1] + c * ends[..., 0] - s * ends[..., 1] - factors.surface.field.origin[0]
    y = poses[:, 1:2] + s * ends[..., 0] + c * ends[..., 1] - factors.surface.field.origin[1]
    column, row = (np.floor(np.clip(along / _TILE, -4e4, 4e4)).astype(np.int64) + 50_000 for along in (x, y))
    return np.where(factors.scans.real(), row * 100_000 + column, -1)


def misfit(found: Residuals, tiles: IntArray) -> float:
    """How far behind or before the walls of a tile beams end on average [m], as root mean square over the tiles."""
    signed, real = np.sign(found.along) * found.distances, tiles >= 0
    _, inverse = np.unique(tiles[real], return_inverse=True)
    weight = np.bincount(inverse, found.shares[real])
    total = np.bincount(inverse, (found.shares * signed)[real])
    counted = weight > _FEW_HITS
    if not counted.any():
        return 0.0
    return float(np.sqrt((total[counted] ** 2 / weight[counted]).sum() / weight[counted].sum()))
