"""What the three profiles mean: one table of switches, every one of them a parameter."""

from __future__ import annotations

import pytest

from mclcli.errors import UsageError
from mclcli.settings import profiles

FIELD, PROB, BEAM = "likelihood_field", "likelihood_field_prob", "beam"
FIELDS, ALL = (FIELD, PROB), (FIELD, PROB, BEAM)

Row = tuple[str, tuple[str, ...], object, object, object]  # switch, models, textbook, nav2, beluga
SWITCHES: list[Row] = [
    ("combination", (FIELD,), "log", "one_plus_cubes", "one_plus_cubes"),
    ("combination", (PROB,), "log", "log", "log"),
    ("combination", (BEAM,), "log", "one_plus_cubes", "cubes"),
    ("hit_normalised", FIELDS, "no", "no", "yes"),
    ("off_map", FIELDS, "max_dist", "max_dist", "uniform"),
    ("field_unknown", FIELDS, "free", "free", "free"),
    ("obstacles", (FIELD,), "occupied", "occupied", "boundary"),
    ("obstacles", (PROB,), "occupied", "occupied", "occupied"),
    ("ray_unknown", (BEAM,), "occupied", "occupied", "occupied"),
    ("field_anchor", FIELDS, "corner", "half_cell", "corner"),
    ("origin_yaw", FIELDS, "use", "ignore", "use"),
    ("field_lookup", FIELDS, "nearest", "nearest", "nearest"),
    ("field_method", FIELDS, "exact", "exact", "exact"),
    ("field_precision", FIELDS, "double", "single_distance", "single_likelihood"),
    ("beam_subsampling", (FIELD, BEAM), "even_valid", "stride", "even"),
    ("beam_subsampling", (PROB,), "even_valid", "stride_ceil", "even"),
    ("beam_angles", ALL, "exact", "nav2", "exact"),
    ("beam_origin", (BEAM,), "sensor", "sensor", "base"),
    ("short_range", ALL, "skip", "max", "skip"),
    ("max_range", FIELDS, "skip", "skip", "keep_equal"),
    ("max_range", (BEAM,), "no_return", "as_read", "keep_equal"),
    ("range_of_rand", ALL, "smaller", "smaller", "parameter"),
    ("beam_form", (BEAM,), "textbook", "nav2", "beluga"),
    ("no_return", (BEAM,), "mixture", "mixture", "mixture"),
    ("raycast", (BEAM,), "exact", "bresenham_nav2", "bresenham_beluga"),
    ("weights_sum_to_1", (BEAM,), "yes", "no", "no"),
    ("gate", ALL, "euclidean", "per_axis", "euclidean"),
    ("estimate", ALL, "before", "after", "after"),
    ("kld_quantile", ALL, "probability", "z", "z"),
    ("kld_unlimited_bins", ALL, 0, 1, 2),
    ("noise_scaling", ALL, "distance", "step", "step"),
    ("turn_noise", ALL, "full", "folded", "folded"),
]


@pytest.mark.parametrize("row", SWITCHES, ids=lambda row: f"{row[0]}-{row[1][0]}")
def test_every_switch_stands_where_its_profile_puts_it(row: Row) -> None:
    name, models, *wanted = row
    for model in models:
        found = [profiles.build({}, profile=p, model=model).values()[name] for p in ("textbook", "nav2", "beluga")]
        assert found == wanted, model


@pytest.mark.parametrize("row", SWITCHES, ids=lambda row: f"{row[0]}-{row[1][0]}")
def test_every_switch_can_be_set_alone(row: Row) -> None:
    name, models, *wanted = row
    for profile in profiles.PROFILES:
        for value in wanted:
            changes = {name: value}
            if name == "weights_sum_to_1" and profile != "textbook" and value == "yes":
                with pytest.raises(UsageError, match=r"= 1\.1: must be 1"):
                    profiles.build(changes, profile=profile, model=models[0])
            elif name in {"kld_quantile", "range_of_rand"} and profile == "textbook":
                continue  # they need another parameter beside them
            else:
                assert profiles.build(changes, profile=profile, model=models[0]).values()[name] == value


def test_the_table_names_every_switch_that_a_profile_changes_by_a_word() -> None:
    """Numbers are defaults of the originals; words are how they work."""
    words = {
        name
        for models in profiles.PROFILES.values()
        for changes in models.values()
        for name, value in changes.items()
        if isinstance(value, str)
    }
    of_the_filter = {"resampler", "degenerate", "recovery", "recovery_rule"}
    of_the_filter |= {"estimate_mean", "estimate_covariance", "covariance"}
    assert words - of_the_filter <= {row[0] for row in SWITCHES}
