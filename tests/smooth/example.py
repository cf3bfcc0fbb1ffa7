"""A small hall with scans cast into it, as the smoother takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.sensors.beams import BeamSelection, select
from mclcli.smooth.scans import Law, ScanFactors, Scans
from mclcli.smooth.surface import Surface
from mclcli.world import distance_field
from tests.search.scenes import MOUNT, hall, scan_at

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

GRID = hall((-1.0, -0.5, 0.3))
SURFACE = Surface.of(distance_field.compute(GRID, "exact", 1.0, boundary_only=True))
POSES = np.array([[0.6, 1.3, 0.7], [0.9, 1.2, 1.1], [1.2, 1.4, -2.9], [1.0, 2.0, 3.1]])


def scans_at(poses: FloatArray, beams: int = 40) -> Scans:
    """What is seen from each of the poses (n, 3), without noise; the second scan has lost three beams."""
    chosen = [select(scan_at(GRID, pose), MOUNT, BeamSelection(max_beams=beams)).with_return() for pose in poses]
    counts = np.array([one.ranges.size for one in chosen])
    counts[1] -= 3
    ends, directions = np.zeros((len(poses), beams, 2), np.float32), np.zeros((len(poses), beams, 2), np.float32)
    for i, (one, count) in enumerate(zip(chosen, counts.tolist(), strict=True)):
        ends[i, :count], directions[i, :count] = one.endpoints[:count], one.directions[:count]
    return Scans(ends, directions, counts, 8.0)


def factors(law: Law, alphas: FloatArray | None = None) -> ScanFactors:
    """Factors of scans taken at ``POSES``."""
    return ScanFactors(SURFACE, scans_at(POSES), law, np.ones(len(POSES)) if alphas is None else alphas)
