"""NEES, its average, and the bands it belongs in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.evaluate.association import associate
from mclcli.evaluate.consistency import anees_band, anees_over_runs, chi2_band, consistency, consistency_over_runs, nees
from mclcli.geometry.trajectory import Trajectory
from tests.evaluate.drives import drive
from tests.reference import evaluation as naive

COVARIANCE = np.array([[0.04, 0.01, 0.002], [0.01, 0.09, -0.003], [0.002, -0.003, 0.01]])


def sampled(seed: int, count: int, factor: float = 1.0) -> tuple[Trajectory, Trajectory]:
    """A track whose errors are drawn from the covariance it states, times a factor."""
    reference = drive(np.arange(count) * 0.5)
    error = np.random.default_rng(seed).multivariate_normal(np.zeros(3), factor * COVARIANCE, count)
    spread = np.broadcast_to(COVARIANCE, (count, 3, 3))
    return Trajectory(reference.stamps_ns, reference.poses + error, spread), reference


@pytest.mark.parametrize(  # Bronstein, table of quantiles of χ²
    ("degrees", "low", "high"), [(3, 0.215795, 9.348404), (30, 16.790772, 46.979242), (150, 117.984518, 185.800447)]
)
def test_quantiles(degrees: int, low: float, high: float) -> None:
    assert chi2_band(degrees) == pytest.approx((low, high), abs=1e-5)
    assert anees_band(degrees // 3) == pytest.approx((low / degrees, high / degrees), abs=1e-6)


@given(st.integers(0, 10_000))
def test_nees(seed: int) -> None:
    pairs = associate(*sampled(seed, 4))
    _, found = nees(pairs)
    errors = (pairs.estimated - pairs.expected).tolist()
    wanted = [naive.nees((e[0], e[1], naive.wrap(e[2])), COVARIANCE.tolist()) for e in errors]
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, 0), (4.0, 1), (0.25, -1)])
def test_honest_covariances_are_told_from_others(factor: float, verdict: int) -> None:
    found = consistency(associate(*sampled(5, 400, factor)))
    assert found is not None
    side = int(found.anees > found.band[1]) - int(found.anees < found.band[0])
    assert side == verdict
    assert found.anees == pytest.approx(factor, rel=0.15)
    assert (found.count, found.singular) == (400, 0)
    if verdict == 0:
        assert found.inside == pytest.approx(0.95, abs=0.03)


def test_the_band_holds_what_it_says() -> None:
    low, high = anees_band(50)
    runs = [nees(associate(*sampled(seed, 40)))[1] for seed in range(50)]
    averages = anees_over_runs(runs)
    assert averages.shape == (40,)
    assert np.mean((averages >= low) & (averages <= high)) > 0.85


def test_many_drives_are_averaged_moment_by_moment() -> None:
    drives = [associate(*sampled(seed, 40)) for seed in range(50)]
    found = consistency_over_runs(drives)
    assert found is not None
    assert (found.runs, found.moments, found.band) == (50, 40, anees_band(50))
    assert found.inside > 0.85
    proud = consistency_over_runs([associate(*sampled(seed, 40, 2.0)) for seed in range(50)])
    assert proud is not None
    assert proud.inside < 0.1
    assert consistency_over_runs(drives[:1]) is None


def test_moments_are_those_at_which_all_made_an_update() -> None:
    first, second = (associate(*sampled(seed, 10)) for seed in (1, 2))
    thinned = replace(second, updated=np.arange(10) % 2 == 0)
    found = consistency_over_runs([first, thinned])
    assert found is not None
    assert found.moments == 5
    assert consistency_over_runs([replace(first, updated=np.arange(10) % 2 == 1), thinned]) is None


def test_singular_covariances_and_carried_poses_are_left_out() -> None:
    track, reference = sampled(1, 6)
    spread = np.array(track.covariances)
    spread[2] = 0.0
    spread[3] = np.ones((3, 3))
    updated = np.array([True, True, True, True, False, True])
    found = consistency(associate(Trajectory(track.stamps_ns, track.poses, spread, updated), reference))
    assert found is not None
    assert (found.count, found.singular) == (3, 2)


def test_nearly_singular_covariances_are_named_and_set_no_mean() -> None:
    """Of one particle: a hundredth of a millimetre across the way, or in yaw, or in x alone."""
    track, reference = sampled(1, 40)
    spread = np.array(track.covariances)
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    spread[3] = 0.0
    spread[3, :2, :2] = turn @ np.diag([0.04, 1e-10]) @ turn.T
    spread[3, 2, 2] = 0.01
    spread[5] = np.diag([0.04, 0.04, 1e-12])
    spread[8] = np.diag([1e-16, 0.04, 0.01])
    absurd = consistency(associate(Trajectory(track.stamps_ns, track.poses, spread), reference))
    others = np.delete(np.arange(40), [3, 5, 8])
    kept = consistency(associate(Trajectory(track.stamps_ns[others], track.poses[others], spread[others]), reference))
    assert absurd is not None
    assert kept is not None
    assert (absurd.count, absurd.singular, absurd.near_singular) == (37, 0, 3)
    assert absurd.anees == kept.anees


@pytest.mark.parametrize("factor", [0.25, 1.0, 4.0])
def test_the_ellipses_hold_what_they_say_of_honest_covariances_alone(factor: float) -> None:
    """χ² with 3 and with 2 degrees of freedom, of a covariance that is off by a factor."""
    found = consistency(associate(*sampled(5, 4000, factor)))
    assert found is not None
    solid = {0.25: 1.0, 1.0: 0.95, 4.0: 0.4187}[factor]  # P(χ²₃ ≤ 7.8147 / factor)
    planar = 1.0 - np.exp(-0.5 * 5.9915 / factor)
    assert found.ellipse == pytest.approx(solid, abs=0.02)
    assert found.ellipse_xy == pytest.approx(planar, abs=0.02)
    assert found.median_nees == pytest.approx(2.366 * factor, rel=0.06)


def test_the_reference_has_a_share_of_the_error() -> None:
    """Errors of the covariance stated plus the reference's, which is then accounted for."""
    track, reference = sampled(7, 3000)
    noise = np.random.default_rng(3).normal(0.0, 1.0, (3000, 3)) * [0.4, 0.4, 0.2]
    blurred = Trajectory(reference.stamps_ns, reference.poses + noise)
    pairs = associate(track, blurred)
    proud, honest = consistency(pairs), consistency(pairs, (0.4, 0.2))
    assert proud is not None
    assert honest is not None
    assert proud.anees > 2.0
    assert honest.anees == pytest.approx(1.0, abs=0.05)
    assert honest.truth_sd == (0.4, 0.2)
    over = consistency_over_runs([associate(*sampled(seed, 40)) for seed in range(50)], (0.4, 0.2))
    assert over is not None
    assert over.inside < 0.1  # too modest, where the reference is exact


def test_without_covariances_nothing_is_said() -> None:
    track, reference = sampled(1, 6)
    assert consistency(associate(reference, reference)) is None
    nothing = Trajectory(track.stamps_ns, track.poses, np.zeros((6, 3, 3)))
    assert consistency(associate(nothing, reference)) is None
