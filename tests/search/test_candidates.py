"""Peaks among the poses that a search enumerates."""

from __future__ import annotations

import numpy as np
import pytest

from mclcli.search import candidates, lattice
from mclcli.search.branching import Found
from tests.search.scenes import finder_for, hall, seen_from

POSE = (1.3, 1.1, 0.7)


def test_peaks_take_their_neighbours_in() -> None:
    search = finder_for(hall())
    view = search.view(seen_from(hall(), POSE))
    assert view is not None
    cells = lattice.build(view.beams.endpoints / 0.05, search.scene.places)
    keys = (np.arange(8)[:, np.newaxis] * cells.places.shape[1] + np.arange(5)).ravel()  # a block of places
    poses = cells.poses(keys)
    apart = np.hypot(*(poses[:, :2] - poses[0, :2]).T)
    assert (apart > 3.0).any()
    values = -0.1 * np.arange(40.0)
    found = Found(0.0, 0, keys, values, 0.0)
    peaks = candidates.find_peaks(found, cells, 0.5, 3.0, 0.1)
    near = (apart <= 3.0) & (np.abs(poses[:, 2] - poses[0, 2]) <= 0.1)
    assert peaks.keys[0] == 0
    assert peaks.masses[0] == pytest.approx(np.exp(0.5 * values[near]).sum())
    assert peaks.keys[1] == keys[np.flatnonzero(~near)[0]]
    assert peaks.masses.sum() + peaks.rest == pytest.approx(np.exp(0.5 * values).sum())
    several = candidates.find_peaks(found, cells, 0.5, 0.1, 0.001)
    assert several.keys.size == candidates.MOST
    assert several.rest == pytest.approx(np.exp(0.5 * values[candidates.MOST :]).sum())
