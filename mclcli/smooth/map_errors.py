"""What a wrong map does to a pose: pieces of 2 m of it stand off, each its own way, however often they are seen.

A piece c that stands off by δ_c moves the pose of a scan by −H⁻¹ G_c δ_c, with G_c = Σ_{i in c} w_i J_i n_iᵀ over the
beams that end there and n_i the slope of the distance. Independent δ of deviation s make the covariance
s² H⁻¹ (Σ_c G_c G_cᵀ) H⁻¹ (White 1982). More scans of the same piece do not lessen it. Of what pieces stand off, a
smoothed track has taken up about two thirds; what is left, the misfit, is a third.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.smooth import evidence

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.smooth.scans import ScanFactors

_LEFT = 1.0 / 3.0
_BLOCK = 256  # scans
_RIDGE = 0.01 / 6.0 * np.diag([1.0, 1.0, 4.0])  # of the trace: a corridor tells nothing along itself
_TILES = 10**11  # more than there are


def covariances(factors: ScanFactors, poses: FloatArray, misfit: float) -> FloatArray:
    """Covariances (n, 3, 3) that a map with so much ``misfit`` [m] adds to poses (n, 3)."""
    found = np.empty((len(poses), 3, 3))
    for start in range(0, len(poses), _BLOCK):
        block = slice(start, start + _BLOCK)
        found[block] = _of_unit_errors(factors.some(block), poses[block])
    return np.asarray((misfit / _LEFT) ** 2 * found)


def _of_unit_errors(factors: ScanFactors, poses: FloatArray) -> FloatArray:
    """H⁻¹ (Σ_c G_c G_cᵀ) H⁻¹ (n, 3, 3) of scans."""
    seen, tiles = factors.residuals(poses), evidence.tiles_of(factors, poses)
    weighed = (seen.shares / factors.law.sigma**2)[..., np.newaxis] * seen.jacobians
    curvatures = np.einsum("nki,nkj->nij", weighed, seen.jacobians)
    scale = np.maximum(np.trace(curvatures, axis1=1, axis2=2), 1.0)
    inverse = np.linalg.inv(curvatures + scale[:, np.newaxis, np.newaxis] * _RIDGE)
    real, n = tiles >= 0, len(poses)
    pieces, piece = np.unique((tiles + np.arange(n)[:, np.newaxis] * _TILES)[real], return_inverse=True)
    total, scan = np.zeros((n, 3, 3)), pieces // _TILES
    for slope in (seen.by_x, seen.by_y):
        moved = (weighed * slope[..., np.newaxis])[real]
        sums = np.stack([np.bincount(piece, moved[:, i], pieces.size) for i in range(3)], axis=-1)
        np.add.at(total, scan, sums[:, :, np.newaxis] * sums[:, np.newaxis, :])
    return np.asarray(inverse @ total @ inverse)
