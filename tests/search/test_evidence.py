"""What speaks for a place: by the formula, term by term."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.search import evidence
from mclcli.search.calibration import LAW
from mclcli.search.evidence import Looked, weigh
from tests.search.scenes import finder_for, hall, seen_from

if TYPE_CHECKING:
    from mclcli.search.locating import Location

POSE = (1.3, 1.1, 0.7)


def looked(scans: int = 2) -> Looked:
    """Three places seen by so many scans of 44 beams a metre apart, with random figures."""
    rng = np.random.default_rng(4)
    return Looked(
        by_rate=-rng.uniform(1.0, 30.0, (len(LAW.rates), scans, 3)),
        beams=np.full(scans, 44.0),
        lost=-rng.uniform(0.0, 9.0, (scans, 3)),
        alphas=rng.uniform(0.2, 0.9, scans),
        ray_alpha=0.3,
        ways=np.ones(scans - 1),
        bearings=np.array([-1.0, -2.0, 0.5]),
        odometry=np.array([-0.1, -3.0, -0.7]),
        volume=np.array([-9.0, -8.0, -10.0]),
        directions=2,
    )


def log_mean(values: list[float], rarer: float) -> float:
    """Log Σ π exp, added up one by one."""
    priors = [math.exp(-rarer * g) for g in range(len(values))]
    return math.log(sum(p / sum(priors) * math.exp(v) for p, v in zip(priors, values, strict=True)))


def test_evidence_is_that_of_the_formula() -> None:
    seen, law = looked(), dataclasses.replace(LAW, length=2.0, beams=22.0)
    found = weigh(seen, law)
    rho = math.exp(-0.5)
    count = 0.5 * (1.0 + (1.0 - rho) / (1.0 + rho))  # of either scan
    for place in range(3):
        ends = strange = 0.0
        for scan in range(2):
            by_rate = seen.by_rate[:, scan, place]
            ends += log_mean((law.ends * seen.alphas[scan] * count * by_rate).tolist(), law.changed)
            few = (0.5 * count * by_rate).tolist()  # 22 beams of 44
            strange += log_mean(few, law.strange) - log_mean(few, law.fitting)
        rays = law.rays * 0.3 * count * float(seen.lost[:, place].sum())
        assert found.ends[place] == pytest.approx(ends)
        assert found.rays[place] == pytest.approx(rays)
        rest = float(seen.odometry[place] + seen.volume[place])
        assert found.here[place] == pytest.approx(ends + rays + rest + float(seen.bearings[place]))
        assert found.not_here[place] == pytest.approx(ends + strange + rays + rest - 2.0 * math.log(math.tau))


def test_scans_at_one_spot_say_what_one_says_and_far_ones_each_its_own() -> None:
    assert evidence.shares_of(np.zeros(4)).sum() == pytest.approx(1.0)
    assert evidence.shares_of(np.full(4, 1e3)).sum() == pytest.approx(5.0)
    np.testing.assert_allclose(evidence.shares_of(np.empty(0)), [1.0])
    one, two = evidence.shares_of(np.array([1.0, 1.0])).sum(), evidence.shares_of(np.array([2.0, 2.0])).sum()
    assert 1.0 < one < two < 3.0


def test_the_worse_it_fits_the_rather_it_is_not_on_this_map() -> None:
    """Of 44 beams so many end anywhere, the others right at a wall."""
    odds = []
    for astray in (0, 4, 9, 20):
        one = [(44 - astray) * 0.0 + astray * math.log(rate) for rate in LAW.rates]
        by_rate = np.tile(np.array(one)[:, np.newaxis, np.newaxis], (1, 2, 3))
        found = weigh(dataclasses.replace(looked(), by_rate=by_rate))
        odds.append(found.not_here - found.here)
    assert (np.diff(odds, axis=0) > 0.0).all()


def _found(location: Location | None) -> Location:
    assert location is not None
    return location


def test_a_wall_that_is_not_there_cannot_take_the_true_place_away() -> None:
    """The map has a wall across the view of half the beams; only the beam model can tell."""
    grid = hall()
    ghost = grid.cells.copy()
    ghost[30:50, 70] = 100
    haunted = dataclasses.replace(grid, cells=ghost)
    mode = _found(finder_for(haunted).find(seen_from(grid, POSE), 5)).modes[0]
    assert mode.terms["rays"] < -0.2
    assert math.hypot(mode.pose[0] - POSE[0], mode.pose[1] - POSE[1]) < 0.1
    assert mode.share > 0.5
