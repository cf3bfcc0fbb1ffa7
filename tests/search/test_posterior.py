"""Places weighed against each other: peaks and their masses, and what the beam model makes of them."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest

from mclcli.search import branching, lattice, posterior
from mclcli.search.branching import Found
from mclcli.search.scene import sightings_of
from mclcli.sensors.beams import Beams
from tests.search.scenes import finder_for, hall, seen_from

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.search.branching import Search
    from mclcli.search.posterior import Peaks, Weighing
    from mclcli.search.scene import Scene, View

POSE = (1.3, 1.1, 0.7)
PRIOR = 0.01


class Looked(NamedTuple):
    """A search for one scan, two of its poses as peaks: the best, and the same a metre ahead, through a pillar."""

    scene: Scene
    view: View
    search: Search
    found: Found
    peaks: Peaks


def looked() -> Looked:
    grid = hall()
    finder = finder_for(grid)
    view = finder.view(seen_from(grid, POSE))
    assert view is not None
    scene = finder.scene
    cells = lattice.build(view.beams.endpoints / scene.model.field.resolution, scene.places, scene.about)
    seen = sightings_of(scene, view.bearings, view.bearing_model)
    search = branching.prepare(scene.model.field, scene.pyramid, cells, scene.model.table(view.beams.r_max), seen)
    best, key = search.maximum()
    keys = np.array([key, key + 20])
    values = scene.model.measure("lidar", view.beams).log_likelihood(scene.to_map(cells.poses(keys)))
    peaks = posterior.Peaks(keys, values, np.array([1.0, 0.5]), 0.25)
    return Looked(scene, view, search, Found(best, key, keys, values, 0.0), peaks)


@pytest.fixture(name="at", scope="module")
def _at() -> Looked:
    return looked()


def logs(at: Looked) -> tuple[FloatArray, FloatArray]:
    """Log-likelihoods of the peaks: by the beam model, and by the field."""
    nodes = at.scene.to_map(at.search.lattice.poses(at.peaks.keys))
    beam = at.scene.rays.measure("lidar", at.view.rays).log_likelihood(nodes)
    return beam, at.scene.model.measure("lidar", at.view.beams).log_likelihood(nodes)


def weigh(at: Looked, alpha: float, prior: float = PRIOR) -> Weighing:
    return posterior.weigh(at.scene, at.view, at.search, at.found, at.peaks, alpha, prior)


@pytest.mark.parametrize("alpha", [0.01, 0.03])
def test_masses_are_corrected_by_what_the_beam_model_knows_more(at: Looked, alpha: float) -> None:
    beam, field = logs(at)
    gain = alpha * ((beam[1] - beam[0]) - (field[1] - field[0]))
    assert 0.3 < abs(gain) < 50.0  # or this would show nothing
    weighed = weigh(at, alpha)
    share = dict(zip(weighed.order.tolist(), weighed.shares.tolist(), strict=True))
    assert math.log(share[1] / share[0]) == pytest.approx(math.log(0.5) + gain, abs=1e-9)
    rest = 1.0 - sum(share.values()) - weighed.elsewhere
    assert rest / share[0] == pytest.approx(0.25, rel=1e-6)  # what lies around no peak is not corrected
    assert weighed.shares[0] >= weighed.shares[1]
    np.testing.assert_array_equal(weighed.log_beam, beam)


def test_no_correction_is_more_than_50_nats(at: Looked) -> None:
    beam, field = logs(at)
    far = abs((beam[1] - beam[0]) - (field[1] - field[0]))
    weighed = weigh(at, 400.0 / float(far))
    assert abs(math.log(weighed.shares[1] / weighed.shares[0])) == pytest.approx(50.0 + math.log(2.0), abs=1e-6)


def test_being_elsewhere_is_one_more_place(at: Looked) -> None:
    """Beams that end in any known cell, times the odds of the prior, over all poses of the lattice."""
    alpha = 0.03
    stray = at.view.beams.ranges.size * at.scene.log_stray(at.view.beams.r_max)
    expected = math.log(PRIOR / (1 - PRIOR)) + math.log(at.search.lattice.size) + alpha * (stray - at.found.best)
    weighed = weigh(at, alpha)
    first = weighed.shares[weighed.order.tolist().index(0)]
    assert math.log(weighed.elsewhere / first) == pytest.approx(expected, abs=1e-9)
    assert weigh(at, alpha, 0.0).elsewhere == 0.0


def test_figures_are_odds_and_what_does_not_fit(at: Looked) -> None:
    alpha = 0.03
    weighed, (beam, field) = weigh(at, alpha), logs(at)
    best = float(weighed.shares[0])
    assert weighed.figures.log_odds == pytest.approx(math.log(best / (1.0 - best)), abs=1e-6)
    of_field = np.array([1.0, 0.5]) / (1.75 + weighed.elsewhere / weighed.shares[weighed.order.tolist().index(0)])
    first = int(weighed.order[0])
    assert weighed.figures.log_odds_field == pytest.approx(math.log(of_field[first] / (1 - of_field[first])), abs=1e-6)
    count = at.view.beams.ranges.size
    assert weighed.figures.misfit == pytest.approx(at.search.log_p.max() - field[first] / count, abs=1e-12)
    rays = at.scene.rays.measure("lidar", at.view.rays)
    assert weighed.figures.misfit_rays == pytest.approx((rays.log_peak - beam[first]) / rays.count, abs=1e-12)


def test_what_does_not_fit_is_told_of_a_single_beam_too(at: Looked) -> None:
    beams = at.view.beams
    one = Beams(beams.origins[:1], beams.directions[:1], beams.ranges[:1], beams.r_max, beams.indices[:1], 1)
    alone = at._replace(view=dataclasses.replace(at.view, beams=one))
    weighed, (_, field) = weigh(alone, 0.03), logs(alone)
    expected = at.search.log_p.max() - field[int(weighed.order[0])]
    assert weighed.figures.misfit == pytest.approx(expected, abs=1e-12)


def test_peaks_take_their_neighbours_in(at: Looked) -> None:
    cells = at.search.lattice
    keys = (np.arange(8)[:, np.newaxis] * cells.places.shape[1] + np.arange(5)).ravel()  # a block of places
    poses = cells.poses(keys)
    apart = np.hypot(*(poses[:, :2] - poses[0, :2]).T)
    assert (apart > 3.0).any()
    values = -0.1 * np.arange(40.0)
    found = Found(0.0, 0, keys, values, 0.0)
    peaks = posterior.find_peaks(found, cells, 0.5, 3.0, 0.1)
    near = (apart <= 3.0) & (np.abs(poses[:, 2] - poses[0, 2]) <= 0.1)
    assert peaks.keys[0] == 0
    assert peaks.masses[0] == pytest.approx(np.exp(0.5 * values[near]).sum())
    assert peaks.keys[1] == keys[np.flatnonzero(~near)[0]]
    assert peaks.masses.sum() + peaks.rest == pytest.approx(np.exp(0.5 * values).sum())
    several = posterior.find_peaks(found, cells, 0.5, 0.1, 0.001)
    assert several.keys.size == posterior.MOST
    assert several.rest == pytest.approx(np.exp(0.5 * values[posterior.MOST :]).sum())
