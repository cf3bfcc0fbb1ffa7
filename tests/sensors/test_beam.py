"""The beam mixture against its definition: term by term, integrated, and at the ends of every range."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special

from mclcli.errors import UsageError
from mclcli.sensors.beam import BeamModel
from mclcli.sensors.beam_forms import COMBINATIONS, FLOOR, FORMS, BeamParameters
from mclcli.sensors.beams import Beams
from mclcli.world.raycast import make_caster
from tests.reference.beam import mixture
from tests.worlds import drawn, room

R_MAX = 8.0
HALF_CELL = 0.05
CASTER = make_caster(room(0.1))
WEIGHTS = {"z_hit": 0.6, "z_short": 0.2, "z_max": 0.07, "z_rand": 0.13}
SIGMAS = [1e-9, 1e-3, 0.2, 5.0, 1e3, 1e9]
RATES = [0.0, 1e-15, 1e-6, 0.1, 3.0, 1e3, 1e9]
EXPECTED = [0.0, 1e-12, 0.04999, 0.05, 0.7, 4.0, R_MAX - 1e-9, R_MAX]

readings = st.one_of(st.floats(0.0, R_MAX), st.sampled_from([0.0, 5e-324, R_MAX, math.inf, 1e300, R_MAX - 1e-15]))
ranges = st.one_of(st.floats(0.0, 2 * R_MAX), st.sampled_from([0.0, 5e-324, HALF_CELL, R_MAX, 1e12]))
sigmas = st.one_of(st.floats(1e-9, 1e9), st.sampled_from(SIGMAS))
rates = st.one_of(st.floats(0.0, 1e9), st.sampled_from([5e-324, *RATES]))


def model(sigma: float = 0.2, rate: float = 0.1, **changes: Any) -> BeamModel:
    parameters = BeamParameters(**{**WEIGHTS, **changes}, sigma_hit=sigma, lambda_short=rate)
    return BeamModel(CASTER, parameters)


def density(m: BeamModel, r: float, r_star: float) -> float:
    """p(r | r*) before the floor."""
    return float(m.components(np.array([r]), np.array([r_star]), R_MAX).total()[0])


def integral(m: BeamModel, r_star: float) -> float:
    """∫ p dr over [0, r_max), in pieces that follow its steps and peaks."""
    sigma, rate = m.parameters.sigma_hit, max(m.parameters.lambda_short, 1e-300)
    peaks = [r_star + k * sigma for k in (-12, -6, -3, -1, 0, 1, 3, 6, 12)] + [k / rate for k in (1, 5, 20, 60)]
    inner = sorted({p for p in peaks if 0.0 < p < R_MAX})
    edges = [0.0, *inner, np.nextafter(R_MAX, 0.0)]
    nodes, gains = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in itertools.pairwise(edges):
        r = 0.5 * (high - low) * nodes + 0.5 * (high + low)
        total += 0.5 * (high - low) * float(gains @ m.components(r, np.full(r.shape, r_star), R_MAX).total())
    return total


@pytest.mark.parametrize("no_return", ["mixture", "censored"])
@pytest.mark.parametrize("sigma", SIGMAS[1:])
@pytest.mark.parametrize("rate", RATES)
def test_the_density_integrates_to_what_z_max_leaves(sigma: float, rate: float, no_return: str) -> None:
    m = model(sigma, rate, no_return=no_return)
    for r_star in EXPECTED:
        assert integral(m, r_star) == pytest.approx(1.0 - WEIGHTS["z_max"], abs=1e-6)


@pytest.mark.parametrize("r_star", [0.3, 2.0, 7.9, R_MAX])
@pytest.mark.parametrize(("sigma", "rate"), [(0.05, 0.1), (0.3, 1.0), (4.0, 0.0)])
def test_scipy_integrates_to_the_same(sigma: float, rate: float, r_star: float) -> None:
    m = model(sigma, rate)
    peaks = [r_star - 4 * sigma, r_star, r_star + 4 * sigma]
    breaks = [p for p in peaks if 0.0 < p < R_MAX]
    total, _ = integrate.quad(lambda r: density(m, r, r_star), 0.0, np.nextafter(R_MAX, 0.0), points=breaks, limit=200)
    assert total == pytest.approx(1.0 - WEIGHTS["z_max"], abs=1e-7)


@given(r=readings, r_star=ranges, sigma=sigmas, rate=rates, censored=st.booleans())
def test_every_value_agrees_with_the_definition(
    r: float, r_star: float, sigma: float, rate: float, *, censored: bool
) -> None:
    m = model(sigma, rate, no_return="censored" if censored else "mixture")
    expected = mixture(
        r, r_star, r_max=R_MAX, half_cell=HALF_CELL, **WEIGHTS, sigma=sigma, rate=rate, censored=censored
    )
    assert density(m, r, r_star) == pytest.approx(expected, rel=1e-9, abs=1e-300)
    assert float(m.log_p(np.array([r]), np.array([r_star]), R_MAX)[0]) == pytest.approx(math.log(max(expected, FLOOR)))


@given(
    seen=st.lists(st.one_of(readings, st.floats(-5.0, 0.0)), min_size=1, max_size=19),
    expected=st.lists(st.one_of(ranges, st.just(math.nan)), min_size=1, max_size=3),
    sigma=sigmas,
    rate=rates,
    no_return=st.sampled_from(["mixture", "censored"]),
)
def test_the_compiled_mixture_is_the_formula(
    seen: list[float], expected: list[float], sigma: float, rate: float, no_return: str
) -> None:
    m, r = model(sigma, rate, no_return=no_return), np.array(seen)
    r_star = np.resize(np.array(expected), (4, r.size))
    by_numpy = m.components(r, r_star, R_MAX).total()
    compiled = m.likelihood_of_many(Beams(np.zeros((r.size, 2)), np.zeros((r.size, 2)), r, R_MAX))(r_star.copy())
    nowhere = np.isnan(r_star)
    assert np.isnan(compiled[nowhere]).all()
    np.testing.assert_allclose(compiled[~nowhere], by_numpy[~nowhere], rtol=1e-12, atol=1e-290)


@pytest.mark.parametrize("sigma", [0.05, 0.5])
def test_the_hit_component_is_the_truncated_gaussian_of_scipys_error_function(sigma: float) -> None:
    r = np.linspace(0.0, 7.99, 50)[:, np.newaxis]
    r_star = np.linspace(HALF_CELL, R_MAX, 40)
    got = model(sigma).components(r, r_star, R_MAX).hit
    share = special.ndtr((R_MAX - r_star) / sigma) - special.ndtr(-r_star / sigma)
    gauss = np.exp(-0.5 * ((r - r_star) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
    np.testing.assert_allclose(got, WEIGHTS["z_hit"] * gauss / share, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("form", FORMS)
@given(r=readings, r_star=st.floats(0.0, R_MAX), sigma=sigmas, rate=rates)
def test_every_finite_input_has_a_finite_answer(form: str, r: float, r_star: float, sigma: float, rate: float) -> None:
    for no_return in ("mixture", "censored"):
        value = model(sigma, rate, beam_form=form, no_return=no_return).log_p(
            np.array([r, -1.0, -1e300]), np.array([r_star]), R_MAX
        )
        assert np.isfinite(value).all()


@pytest.mark.parametrize("sigma", [1e-9, 0.2, 3.0, 1e9])
def test_seeing_nothing_is_likelier_the_farther_the_wall(sigma: float) -> None:
    r_star = np.concatenate([np.linspace(0.0, 3 * R_MAX, 400), [1e6]])
    p = model(sigma, no_return="censored").components(np.array([math.inf]), r_star, R_MAX).total()
    assert (np.diff(p) >= 0.0).all()
    assert p[0] >= WEIGHTS["z_max"]
    assert p[-1] <= WEIGHTS["z_max"] + WEIGHTS["z_hit"] + 1e-12
    if sigma < 1.0:
        assert p[-1] == pytest.approx(WEIGHTS["z_max"] + WEIGHTS["z_hit"])


def test_a_reading_of_the_maximum_or_more_is_no_return() -> None:
    for no_return in ("mixture", "censored"):
        m = model(no_return=no_return)
        assert density(m, R_MAX, 3.0) == density(m, math.inf, 3.0) == density(m, R_MAX + 1.0, 3.0)
    mixed = model().components(np.array([R_MAX]), np.array([R_MAX]), R_MAX)
    assert [float(part[0]) > 0.0 for part in (mixed.hit, mixed.short, mixed.max, mixed.rand)] == [True] * 4
    before = model().components(np.array([np.nextafter(R_MAX, 0.0)]), np.array([3.0]), R_MAX)
    assert float(before.max[0]) == float(before.short[0]) == 0.0


def test_the_shares_of_a_wall_that_touches_the_sensor_go_to_hit() -> None:
    near, far = (model().components(np.array([0.01]), np.array([r]), R_MAX) for r in (0.049, 0.051))
    assert float(near.short[0]) == 0.0 < float(far.short[0])
    assert float(near.hit[0]) > float(far.hit[0])


@pytest.mark.parametrize("form", ["nav2", "beluga"])
def test_the_other_forms_follow_their_formulas(form: str) -> None:
    m = model(0.3, 0.5, beam_form=form, z_hit=0.5, z_short=0.05, z_max=0.05, z_rand=0.5, weights_sum_to_1="no")
    short = 0.05 * 0.5 * math.exp(-0.5 * 2.0)
    hit = 0.5 * math.exp(-0.5 * (1.0 / 0.3) ** 2)
    if form == "beluga":
        hit *= (
            2.0
            / (math.erf(5.0 / 0.3 / math.sqrt(2)) + math.erf(3.0 / 0.3 / math.sqrt(2)))
            / (0.3 * math.sqrt(2 * math.pi))
        )
        short /= 1.0 - math.exp(-0.5 * 3.0)
    assert density(m, 2.0, 3.0) == pytest.approx(hit + short + 0.5 / R_MAX)
    assert density(m, R_MAX, 0.5) == pytest.approx(0.05)
    parts = m.components(np.array([2.0]), np.array([3.0]), R_MAX)
    if form == "beluga":
        assert float(m.components(np.array([-0.5]), np.array([3.0]), R_MAX).short[0]) == 0.0
    shares = [float(share[0]) for share in (parts.hit, parts.short, parts.max, parts.rand)]
    assert shares == pytest.approx([hit, short, 0.0, 0.5 / R_MAX])


def beams(count: int = 40, seed: int = 3, r_max: float = 2.5) -> Beams:
    generator = np.random.default_rng(seed)
    yaw = generator.uniform(-math.pi, math.pi, count)
    distances = generator.uniform(0.1, 2.4, count)
    distances[::7] = r_max
    distances[3] = math.inf
    directions = np.column_stack([np.cos(yaw), np.sin(yaw)])
    return Beams(generator.uniform(-0.1, 0.1, (count, 2)), directions, distances, r_max)


def poses(count: int = 200) -> Any:
    generator = np.random.default_rng(5)
    return np.column_stack(
        [generator.uniform(-1.5, 2.5, count), generator.uniform(-1, 2, count), generator.uniform(-4, 4, count)]
    )


@pytest.mark.parametrize("no_return", ["mixture", "censored"])
def test_a_measurement_is_the_sum_over_expected_ranges(no_return: str) -> None:
    m, seen = model(no_return=no_return), beams()
    measurement = m.measure("lidar", seen, 0.5)
    assert (measurement.sensor, measurement.count, measurement.alpha) == ("lidar", 40, 0.5)
    for pose, got in zip(poses(20), measurement.log_likelihood(poses(20)), strict=True):
        far = CASTER.ranges(pose[np.newaxis], seen.origins, seen.directions, 1e3)[0]
        terms = [
            math.log(
                max(
                    FLOOR,
                    mixture(
                        r,
                        min(r_star, seen.r_max) if no_return == "mixture" else r_star,
                        r_max=seen.r_max,
                        half_cell=HALF_CELL,
                        **WEIGHTS,
                        sigma=0.2,
                        rate=0.1,
                        censored=no_return == "censored",
                    ),
                )
            )
            for r, r_star in zip(seen.ranges.tolist(), far.tolist(), strict=True)
        ]
        assert got == pytest.approx(math.fsum(terms), abs=1e-9)
        assert measurement.each is not None
        np.testing.assert_allclose(measurement.each(pose[np.newaxis])[0], terms, rtol=0, atol=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_the_order_of_beams_and_the_number_of_threads_do_not_matter(form: str) -> None:
    seen, many = beams(), poses(3000)
    order = np.random.default_rng(1).permutation(40)
    shuffled = Beams(seen.origins[order], seen.directions[order], seen.ranges[order], seen.r_max)
    one = model(beam_form=form).measure("lidar", seen).log_likelihood(many)
    np.testing.assert_allclose(
        model(beam_form=form).measure("lidar", shuffled).log_likelihood(many), one, rtol=1e-12, atol=1e-12
    )
    threaded = BeamModel(CASTER, model(beam_form=form).parameters, threads=3)
    np.testing.assert_array_equal(threaded.measure("lidar", seen).log_likelihood(many), one)


@pytest.mark.parametrize("form", FORMS)
def test_a_reading_that_is_not_a_number_counts_for_nothing(form: str) -> None:
    seen = beams()
    seen.ranges[[4, 11]] = math.nan
    kept = ~np.isnan(seen.ranges)
    without = Beams(seen.origins[kept], seen.directions[kept], seen.ranges[kept], seen.r_max)
    measurements = [model(beam_form=form).measure("lidar", b) for b in (seen, without)]
    assert measurements[0].count == measurements[1].count == 38
    one, other = (m.log_likelihood(poses()) for m in measurements)
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("form", FORMS)
def test_the_pose_that_saw_the_readings_fits_best_and_reaches_the_peak(form: str) -> None:
    seen = beams()
    truth = np.array([[0.2, 0.3, 0.4]])
    seen.ranges[:] = CASTER.ranges(truth, seen.origins, seen.directions, seen.r_max)[0]
    measurement = model(beam_form=form).measure("lidar", seen)
    (best,) = measurement.log_likelihood(truth)
    assert best == pytest.approx(measurement.log_peak)
    assert best > measurement.log_likelihood(poses()).max()


@pytest.mark.parametrize("form", FORMS)
def test_the_peak_expects_what_was_read_and_the_floor_a_wall_at_the_sensor(form: str) -> None:
    m, seen = model(beam_form=form), beams()
    measurement = m.measure("lidar", seen)
    read = seen.ranges[~np.isnan(seen.ranges)]
    expected = np.minimum(np.maximum(read, 0.0), seen.r_max)
    assert measurement.log_floor == pytest.approx(m.log_p(read, np.zeros(read.size), seen.r_max).sum())
    assert measurement.log_peak == pytest.approx(m.log_p(read, expected, seen.r_max).sum())


@pytest.mark.parametrize("count", [4, 511, 513, 1100])
def test_any_number_of_beams_is_the_sum_of_each(count: int) -> None:
    seen, m = beams(count), model()
    some = poses(3)
    got = m.measure("lidar", seen).log_likelihood(some)
    there = seen.subset(~np.isnan(seen.ranges))
    np.testing.assert_allclose(got, m.each(there, some).sum(axis=1), rtol=1e-9)


@pytest.mark.parametrize("r_max", [0.3, 0.8, 2.5])
def test_no_return_from_as_far_as_the_lidar_sees_is_the_same_compiled(r_max: float) -> None:
    m, seen = model(), Beams(np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.array([r_max]), r_max)
    expected = np.array([[r_max], [np.nextafter(r_max, 0.0)], [0.5 * r_max]])
    compiled = m.likelihood_of_many(seen)(expected.copy())
    formula = m.components(seen.ranges, expected, r_max).total()
    np.testing.assert_allclose(compiled, formula, rtol=1e-12)


def test_no_beam_says_nothing() -> None:
    none = Beams(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), R_MAX)
    assert model().measure("lidar", none).log_likelihood(poses(3)).tolist() == [0.0, 0.0, 0.0]
    cubes = model(combination="one_plus_cubes").measure("lidar", none)
    assert cubes.log_likelihood(poses(3)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("combination", COMBINATIONS)
def test_beams_combine_as_said(combination: str) -> None:
    measurement = model(combination=combination).measure("lidar", beams())
    assert measurement.each is not None
    pose = poses(1)
    p = np.exp(measurement.each(pose)[0])
    expected = {"log": np.log(p).sum(), "one_plus_cubes": np.log1p((p**3).sum()), "cubes": np.log((p**3).sum())}
    np.testing.assert_allclose(measurement.log_likelihood(pose), expected[combination], rtol=1e-12)


def test_the_weights_sum_to_one_or_the_error_names_the_sum() -> None:
    assert BeamParameters() == BeamParameters(z_hit=0.75, z_short=0.1, z_max=0.05, z_rand=0.1)
    with pytest.raises(UsageError, match=r"= 1\.1: must be 1; .* weights_sum_to_1=no"):
        BeamParameters(z_hit=0.5, z_short=0.05, z_max=0.05, z_rand=0.5)
    with pytest.raises(UsageError, match=r"= 1\.000002"):
        BeamParameters(z_hit=0.750002)
    BeamParameters(z_hit=0.7500009)
    BeamParameters(z_hit=0.5, z_short=0.05, z_max=0.05, z_rand=0.5, weights_sum_to_1="no")


@pytest.mark.parametrize(
    "wrong",
    [{"z_hit": -0.1, "z_rand": 0.95}, {"sigma_hit": 0.0}, {"lambda_short": -1.0}, {"raycast": "guess"}],
)
def test_values_out_of_bounds_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=next(iter(wrong))):
        BeamParameters(**wrong)


def test_a_ray_caster_for_every_choice() -> None:
    for raycast in ("exact", "approximate", "bresenham_nav2", "bresenham_beluga"):
        for unknown in ("occupied", "free"):
            caster = make_caster(drawn("..?#\n....", 0.5), method=raycast, ray_unknown=unknown)
            m = BeamModel(caster, BeamParameters(raycast=raycast, ray_unknown=unknown, no_return="censored"))
            score = m.measure("lidar", beams()).log_likelihood(np.array([[0.7, 0.3, 0.0], [-9.0, 0.0, 0.0]]))
            assert np.isfinite(score).all()
            assert score[0] != score[1]
