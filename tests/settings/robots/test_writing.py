"""Settings written for nav2: they come back the same, and nav2 finds every value of the type it declares."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from mclcli import load_settings
from mclcli.errors import UsageError
from mclcli.settings import profiles
from mclcli.settings.robots import names as nav2_names
from mclcli.settings.robots.reading import load, settings_of
from mclcli.settings.robots.writing import to_nav2
from tests.reference.rcl_scalars import typed
from tests.settings.robots.robots import BELUGA, NAV2, amcl

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from mclcli.settings import Profile
    from mclcli.settings.profiles import Settings

MODELS, PROFILES = list(profiles.MODELS), list(profiles.PROFILES)


def scalars(text: str) -> Iterator[tuple[str, str]]:
    """Block and ``NAME: VALUE`` lines of what was written, split by hand."""
    block = ""
    for line in text.splitlines():
        name, _, value = line.strip().partition(": ")
        if line.startswith("#"):
            continue
        if value:
            yield f"{block}.{name}", value
        elif name != "ros__parameters:":
            block = name.removesuffix(":")


def values_for(default: profiles.Value, about: Any) -> st.SearchStrategy[profiles.Value]:
    """Values within a parameter's bounds."""
    if about.choices:
        return st.sampled_from(about.choices)
    if isinstance(default, bool):
        return st.booleans()
    if isinstance(default, str):
        return st.sampled_from(["", "a", "/front/scan", "robot1/odom", "on", "0.5", 'with " and \\', "ä: #"])
    low = about.low if about.low is not None else (about.above if about.above is not None else -50.0)
    high = min(about.high if about.high is not None else 50.0, 50.0)
    if isinstance(default, int):
        return st.integers(math.ceil(low), max(math.ceil(low), int(high)))
    return st.floats(low, high, exclude_min=about.above is not None)


@st.composite
def any_settings(draw: st.DrawFn) -> Settings:
    """Settings of any profile and model with a few values changed."""
    profile, model = draw(st.sampled_from(PROFILES)), draw(st.sampled_from(MODELS))
    rows = {name: (default, about) for _, name, default, about in profiles.table(model)}
    names = draw(st.lists(st.sampled_from(sorted(rows)), max_size=8, unique=True))
    values = {name: draw(values_for(*rows[name])) for name in names}
    try:
        return profiles.build(values, profile=profile, model=model)
    except UsageError:  # values that do not go together
        return profiles.build({}, profile=profile, model=model)


@hypothesis_settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(any_settings())
def test_any_settings_come_back(tmp_path: Path, settings: Settings) -> None:
    path = tmp_path / "nav2.yaml"
    path.write_text(to_nav2(settings), encoding="utf-8")
    assert load_settings(path) == settings
    path.write_text(to_nav2(settings, load(path)), encoding="utf-8")
    assert load_settings(path) == settings


@hypothesis_settings(deadline=None, max_examples=50)
@given(any_settings())
def test_nav2_finds_the_types_it_declares(settings: Settings) -> None:
    """As rcl reads scalars, and as YAML 1.1 does, with which nav2's launch files rewrite the file."""
    text = to_nav2(settings)
    assert text.count("amcl:\n") == 1
    yaml = YAML(typ="safe", pure=True)
    yaml.version = (1, 1)
    read = yaml.load("%YAML 1.1\n---\n" + text)["amcl"]["ros__parameters"]
    written = {name: value for name, value in scalars(text) if name.startswith("amcl.")}
    assert len(written) == len(read) > 20
    for name, value in written.items():
        row = nav2_names.NAMES[name.removeprefix("amcl.")]
        assert row.nav2 is not None
        assert type(typed(value)) is type(read[row.name]) is type(row.nav2)
        assert typed(value) == read[row.name]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("profile", PROFILES)
def test_the_defaults_of_every_profile_come_back(tmp_path: Path, profile: Profile, model: str) -> None:
    settings = profiles.build({}, profile=profile, model=model)
    (tmp_path / "nav2.yaml").write_text(to_nav2(settings))
    assert load_settings(tmp_path / "nav2.yaml") == settings


def test_nav2s_own_settings_need_no_block_of_mcls() -> None:
    for model in MODELS:
        assert "\nmcl:" not in to_nav2(profiles.build({"alpha1": 0.7}, profile="nav2", model=model))


@pytest.mark.parametrize("text", [NAV2, BELUGA, amcl("alpha1: 1.0", head="fleet/robot1/amcl:\n  ros__parameters:\n")])
def test_a_robots_file_comes_back_with_what_it_was_given_besides(tmp_path: Path, text: str) -> None:
    path = tmp_path / "nav2.yaml"
    path.write_text(text)
    before = load(path)
    path.write_text(to_nav2(settings_of(before, {"alpha2": 0.75}), before))
    after = load(path)
    assert after.namespace == before.namespace
    assert (after.profile, after.model) == (before.profile, before.model)
    assert settings_of(after, {}) == settings_of(before, {"alpha2": 0.75})
    kept = {name: value for name, value in before.as_read.items() if nav2_names.NAMES[name].becomes in {"", "--init"}}
    assert after.as_read.items() >= {n: v for n, v in kept.items() if nav2_names.NAMES[n].nav2 is not None}.items()


def test_a_probability_is_written_as_the_quantile_that_nav2_takes_it_for() -> None:
    written = dict(scalars(to_nav2(profiles.build({"pf_z": 0.99}))))
    assert float(written["amcl.pf_z"]) == pytest.approx(2.3263478740408408, rel=1e-12)


def test_a_filter_that_does_not_recover_is_written_as_one() -> None:
    off = dict(scalars(to_nav2(profiles.build({}))))
    assert (off["amcl.recovery_alpha_slow"], off["amcl.recovery_alpha_fast"]) == ("0.0", "0.0")
    on = dict(scalars(to_nav2(profiles.build({"recovery": "uniform"}))))
    assert (on["amcl.recovery_alpha_slow"], on["amcl.recovery_alpha_fast"]) == ("0.001", "0.1")
    assert "mcl.recovery" not in on


def test_what_the_robot_was_given_for_another_lidar_model_stays(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(NAV2)
    file = load(tmp_path / "nav2.yaml", model="likelihood_field")
    written = dict(scalars(to_nav2(settings_of(file, {}, model="likelihood_field"), file)))
    assert (written["amcl.do_beamskip"], written["amcl.z_max"]) == ("true", "0.06")
    assert written["amcl.laser_model_type"] == '"likelihood_field"'


def test_what_nav2_cannot_take_is_not_written_for_it() -> None:
    settings = profiles.build({"max_beams": 0, "robot_model_type": "stationary"}, profile="nav2")
    written = dict(scalars(to_nav2(settings)))
    assert not {"amcl.max_beams", "amcl.robot_model_type"} & set(written)
    assert (written["mcl.max_beams"], written["mcl.robot_model_type"]) == ("0", '"stationary"')
