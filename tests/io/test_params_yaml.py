"""Parameters as YAML: what is written is read back, and everything else is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.io.tables.params_yaml import format_params, parse_params
from mclcli.settings import profiles

if TYPE_CHECKING:
    from pathlib import Path


def values_of(path: Path) -> dict[str, object]:
    """What a file in mcl's own dialect says."""
    return {name: given.value for name, given in parse_params(path.read_bytes(), str(path)).own.items()}


NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,20}", fullmatch=True).filter(lambda name: name not in {"y", "n", "no", "on"})
VALUES = (
    st.integers(-(10**15), 10**15)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text("a/_.:# -'1", max_size=9)
)


@given(st.dictionaries(NAMES, VALUES, min_size=1))
def test_what_is_written_is_read_back(tmp_path: Path, values: dict[str, float | str]) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(format_params(values))
    assert values_of(path) == values


def test_the_defaults_with_comments_are_read_back(tmp_path: Path) -> None:
    values = profiles.build({}).values()
    path = tmp_path / "p.yaml"
    path.write_text(format_params(values, {"z_hit": "a share: of # something"}))
    assert values_of(path) == values
    assert "# a share: of # something" in path.read_text()


def test_numbers_without_a_point_are_numbers(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("z_hit: 5e-1\nsigma_bearing: 3deg\nmax_beams: 30\n")
    settings = profiles.build(values_of(tmp_path / "p.yaml"))
    assert settings.lidars["likelihood_field"].z_hit == 0.5
    assert settings.bearing.sigma_bearing == pytest.approx(0.05235987755982989)
    assert settings.beams.max_beams == 30


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- 1\n", "not a mapping"),
        ("just words\n", "not a mapping"),
        ("z_hit: [1, 2]\n", "'z_hit' is not a number or a word"),
        ("a: 1\nz_hit: 1\nz_hit: 2\n", "key 'z_hit' stands there twice, line 3"),
    ],
)
def test_what_is_not_names_and_values(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(UsageError, match=said) as caught:
        values_of(tmp_path / "p.yaml")
    assert str(caught.value).startswith(str(tmp_path / "p.yaml"))


@pytest.mark.parametrize("text", ["a: 1\na: 2\n", "a: &x 1\nb: *x\n", "a: !!python/object:os.system 1\n", "a: [\n"])
def test_yaml_that_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises((InputError, UsageError)):
        values_of(tmp_path / "p.yaml")
