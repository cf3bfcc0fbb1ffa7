"""Parameters: names, bounds, units, and errors that say what to do."""

from __future__ import annotations

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import UsageError
from mclcli.filter.resampling import RESAMPLERS
from mclcli.sensors.likelihood_field import LikelihoodFieldParameters
from mclcli.settings import Profile, profiles


def test_nothing_given_means_the_defaults_of_the_table() -> None:
    expected = {name: default for _, name, default, _ in profiles.table("likelihood_field")}
    assert profiles.build({}).values() == expected


def test_defaults_that_people_rely_on() -> None:
    expected = {
        "min_particles": 2000,
        "max_particles": 2000,
        "max_beams": 60,
        "resample_ess": 0.5,
        "update_min_d": 0.25,
        "update_min_a": 0.2,
        "alpha1": 0.1,
        "sigma_hit": 0.2,
        "z_hit": 0.5,
        "z_rand": 0.5,
        "laser_likelihood_max_dist": 2.0,
        "sigma_bearing": math.radians(3.0),
        "eps_outlier": 0.1,
        "field_method": "exact",
        "resampler": "systematic",
        "max_range": "skip",
    }
    assert profiles.build({}).values().items() >= expected.items()


@pytest.mark.parametrize("model", list(profiles.MODELS))
def test_every_name_is_there_once_and_explained(model: str) -> None:
    rows = list(profiles.table(model))
    assert len({name for _, name, _, _ in rows}) == len(rows)
    assert all(description.meaning for _, _, _, description in rows)
    assert {description.unit for *_, description in rows} >= {"m", "rad", ""}


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("sigma_bearing", "3deg", math.radians(3.0)),
        ("sigma_bearing", "0.1", 0.1),
        ("sigma_hit", "15cm", 0.15),
        ("sigma_hit", 0.3, 0.3),
        ("resample_interval", "5", 5),
        ("resample_interval", 5.0, 5),
        ("max_beams", "1e2", 100),
        ("resampler", "multinomial", "multinomial"),
        ("base_frame_id", "base_footprint", "base_footprint"),
    ],
)
def test_values_are_read_with_their_units(name: str, text: object, value: float | str) -> None:
    got = profiles.build({name: text}).values()[name]
    assert got == (pytest.approx(value, rel=1e-15) if isinstance(value, float) else value)
    assert type(got) is type(value)


@pytest.mark.parametrize(
    ("given", "size"),
    [
        ({"particles": 500}, (500, 500)),
        ({"particles": "500"}, (500, 500)),
        ({"particles": "300:1e4"}, (300, 10_000)),
        ({"particles": 4000, "min_particles": 100}, (100, 4000)),
        ({"min_particles": 100}, (100, 2000)),
    ],
)
def test_particles_stands_for_the_smallest_and_the_largest_number(given: dict[str, object], size: object) -> None:
    values = profiles.build(given).kld
    assert (values.min_particles, values.max_particles) == size


@pytest.mark.parametrize("text", ["300:", ":300", "a:b", "1:2:3", "", "500:100", "0"])
def test_sizes_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="_particles"):
        profiles.build({"particles": text})


def test_the_originals_sizes_and_recoveries() -> None:
    unlimited: dict[Profile, int] = {"nav2": 1, "beluga": 2}
    for profile, bins in unlimited.items():
        settings = profiles.build({}, profile=profile)
        assert (settings.kld.min_particles, settings.kld.max_particles, settings.kld.z) == (500, 2000, 0.99)
        assert settings.kld.kld_unlimited_bins == bins
        assert not settings.recovery.enabled
        assert profiles.build(
            {"recovery_alpha_slow": 0.001, "recovery_alpha_fast": 0.1}, profile=profile
        ).recovery.enabled


def test_every_parameter_has_a_reference() -> None:
    assert list(profiles.SOURCES) == list(profiles.GROUPS)
    assert all(profiles.SOURCES.values())
    known = {name: (group, description) for group, name, _, description in profiles.table()}
    assert set(profiles.SOURCES_OF) <= set(known)
    for name, ours in (("ess_target", True), ("hypotheses", True), ("update_min_d", False), ("sigma_hit", False)):
        group, description = known[name]
        assert (profiles.source_of(group, name, description) == "mcl's own") == ours


def test_changing_one_value_leaves_the_others() -> None:
    before, after = profiles.build({}).values(), profiles.build({"sigma_hit": 0.4}).values()
    assert {name for name in before if before[name] != after[name]} == {"sigma_hit"}


@pytest.mark.parametrize(
    ("name", "hint"), [("sigma_hits", "sigma_hit"), ("partikles", "particles"), ("alpha_1", "alpha1")]
)
def test_an_unknown_name_is_answered_with_the_nearest(name: str, hint: str) -> None:
    with pytest.raises(UsageError, match=f"unknown parameter '{name}'; did you mean '{hint}'"):
        profiles.build({name: 1})


def test_a_name_like_no_other_is_answered_with_the_command() -> None:
    with pytest.raises(UsageError, match="unknown parameter 'qqq'; `mcl params` lists them all"):
        profiles.build({"qqq": 1})


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("sigma_hit", 0.0, "must be greater than 0"),
        ("sigma_hit", -1.0, "must be greater than 0"),
        ("z_hit", -0.1, "must be at least 0"),
        ("alpha3", -0.1, "must be at least 0"),
        ("sigma_bearing", 1.01, "must be at most 1"),
        ("sigma_bearing", "60deg", "must be at most 1"),
        ("eps_outlier", 1.01, "must be at most 1"),
        ("resample_ess", 1.01, "must be at most 1"),
        ("particles", 0, "must be at least 1"),
        ("max_beams", -1, "must be at least 0"),
        ("laser_likelihood_max_dist", 0, "must be greater than 0"),
        ("resampler", "bogus", "must be one of systematic"),
        ("max_range", "drop", "must be one of skip, score"),
        ("field_method", "fast", "must be one of exact, brushfire"),
        ("particles", 10.5, "whole number"),
        ("particles", "10.5", "whole number"),
        ("particles", math.inf, "number"),
        ("particles", math.nan, "number"),
        ("sigma_hit", math.inf, "number"),
        ("sigma_hit", math.nan, "number"),
        ("z_hit", "inf", "not a number"),
        ("sigma_hit", "3deg", "not a number in m"),
        ("z_hit", "1m", "not a number"),
        ("sigma_hit", True, "must be a number"),
        ("sigma_hit", [0.2], "must be a number"),
        ("sigma_hit", None, "must be a number"),
    ],
)
def test_values_out_of_bounds_are_errors_that_name_the_parameter(name: str, value: object, problem: str) -> None:
    with pytest.raises(UsageError, match=problem) as caught:
        profiles.build({name: value})
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "value", [("sigma_bearing", 1.0), ("eps_outlier", 0.0), ("resample_ess", 1.0), ("z_rand", 0.0)]
)
def test_bounds_themselves_are_allowed(value: tuple[str, float]) -> None:
    assert profiles.build(dict([value])).values()[value[0]] == value[1]


@pytest.mark.parametrize("profile", list(profiles.PROFILES))
@pytest.mark.parametrize("model", list(profiles.MODELS))
def test_every_profile_has_every_model_and_names_only_what_exists(profile: Profile, model: str) -> None:
    settings = profiles.build({}, profile=profile, model=model)
    changes = profiles.PROFILES[profile][model]
    assert {name for _, name, _, _ in profiles.table()} >= set(changes)
    values = settings.values()
    assert {name: values[name] for name in changes if name in values} == {
        n: v for n, v in changes.items() if n in values
    }


def test_parameters_of_another_lidar_model_are_passed_over() -> None:
    assert "lambda_short" not in profiles.build({"lambda_short": 0.3}).values()
    assert profiles.build({"lambda_short": 0.3}, model="beam").lidars["beam"].lambda_short == 0.3


def test_the_command_line_offers_the_profiles_that_there_are() -> None:
    assert tuple(profiles.PROFILES) == get_args(Profile)


def test_a_models_own_parameters_are_checked_without_the_table() -> None:
    with pytest.raises(UsageError, match="sigma_hit"):
        LikelihoodFieldParameters(sigma_hit=-0.2)


def test_every_registered_resampler_can_be_chosen() -> None:
    chosen = [profiles.build({"resampler": name}).filter.resampler for name in RESAMPLERS]
    assert chosen == list(RESAMPLERS)


@given(
    st.sampled_from([row[1] for row in profiles.table("likelihood_field")]),
    st.floats() | st.text(max_size=6) | st.integers(),
)
def test_any_value_is_taken_whole_or_refused_in_one_line(name: str, value: object) -> None:
    try:
        taken = profiles.build({name: value}).values()[name]
    except UsageError as error:
        said = str(error)
    else:
        said = f"{name} = {taken}" if isinstance(taken, str) or math.isfinite(taken) else ""
    assert name in said


# name: default, then its bounds: above (exclusive), low, high
TABLE: dict[str, tuple[float | str, float | None, float | None, float | None]] = {
    "resample_ess": (0.5, None, 0.0, 1.0),
    "resample_interval": (1, None, 1, None),
    "resample_moved": (False, None, None, None),
    "ess_target": (0.05, 0.0, None, 1.0),
    "fit_trusted": (0.8, None, 0.0, 1.0),
    "fit_ignored": (0.5, None, 0.0, 1.0),
    "hypotheses": (4, None, 0, 100),
    "update_min_d": (0.25, None, None, None),
    "update_min_a": (0.2, None, None, None),
    "vision_min_d": (0.02, None, 0.0, None),
    "vision_min_a": (0.02, None, 0.0, None),
    "min_particles": (2000, None, 1, None),
    "max_particles": (2000, None, 1, None),
    "pf_err": (0.05, 0.0, None, None),
    "pf_z": (0.99, 0.0, None, None),
    "kld_unlimited_bins": (0, None, 0, 2),
    "recovery_alpha_slow": (0.001, None, 0.0, 1.0),
    "recovery_alpha_fast": (0.1, None, 0.0, 1.0),
    "alpha1": (0.1, None, 0.0, None),
    "alpha2": (0.1, None, 0.0, None),
    "alpha3": (0.1, None, 0.0, None),
    "alpha4": (0.1, None, 0.0, None),
    "alpha5": (0.1, None, 0.0, None),
    "stationary_sigma_xy": (0.02, None, 0.0, None),
    "stationary_sigma_yaw": (0.02, None, 0.0, None),
    "odom_max_speed": (10.0, None, 0.0, None),
    "odom_max_turn": (15.0, None, 0.0, None),
    "max_beams": (60, None, 0, None),
    "laser_min_range": (-1.0, None, None, None),
    "laser_max_range": (-1.0, None, None, None),
    "range_offset": (0.0, None, -1.0, 1.0),
    "z_hit": (0.5, None, 0.0, None),
    "z_rand": (0.5, None, 0.0, None),
    "sigma_hit": (0.2, 0.0, None, None),
    "laser_likelihood_max_dist": (2.0, 0.0, None, None),
    "do_beamskip": (False, None, None, None),
    "beam_skip_distance": (0.5, 0.0, None, None),
    "beam_skip_threshold": (0.3, None, 0.0, 1.0),
    "beam_skip_error_threshold": (0.9, None, 0.0, 1.0),
    "sigma_bearing": (math.radians(3.0), 0.0, None, 1.0),
    "eps_outlier": (0.1, None, 0.0, 1.0),
    "locate_beams": (90, None, 1, None),
    "window_beams": (240, None, 1, None),
    "window_scans": (12, None, 1, None),
    "mode_distance": (0.5, 0.0, None, None),
    "mode_angle": (math.radians(15.0), 0.0, None, None),
    "leaf_nats": (8.0, 0.0, None, 40.0),
    "off_map_prior": (0.05, None, 0.0, 0.99),
    "beam: z_hit": (0.75, None, 0.0, None),
    "z_short": (0.1, None, 0.0, None),
    "z_max": (0.05, None, 0.0, None),
    "beam: z_rand": (0.1, None, 0.0, None),
    "beam: sigma_hit": (0.2, None, 1e-09, 1000000000.0),
    "lambda_short": (0.1, None, 0.0, 1000000000.0),
}


def test_numbers_have_the_defaults_and_bounds_that_are_published() -> None:
    """What a run does and what files of settings may hold hangs on each: a change is a change of every output."""
    rows: dict[str, tuple[float | str, float | None, float | None, float | None]] = {}
    for model in profiles.MODELS:
        for _, name, default, one in profiles.table(model):
            values = (default, one.above, one.low, one.high)
            rows[name if rows.get(name, values) == values else f"{model}: {name}"] = values
    assert {name: values for name, values in rows.items() if not isinstance(values[0], str)} == TABLE
