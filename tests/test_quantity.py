"""Numbers with units, as people write them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import UsageError
from mclcli.quantity import parse_list, parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("90deg", "rad", math.pi / 2),
        ("-45°", "rad", -math.pi / 4),
        ("1.5", "rad", 1.5),
        ("1.5rad", "rad", 1.5),
        ("5cm", "m", 0.05),
        ("5mm", "m", 0.005),
        (" 2 m ", "m", 2.0),
        ("1e-2km", "m", 10.0),
        ("100ms", "s", 0.1),
        ("2min", "s", 120.0),
        ("3", "", 3.0),
    ],
)
def test_units(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit, "x") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("-23", "x: -23 rad looks like degrees; for degrees write -23deg"),
        ("90", "for degrees write 90deg"),
        ("6.29", "for degrees write 6.29deg"),
        *(("-23deg", ""), ("720°", ""), ("90rad", ""), ("6.2832", ""), ("-3.2", "")),
    ],
)
def test_a_plain_angle_of_more_than_a_turn_looks_like_degrees(
    text: str, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    parse_quantity(text, "rad", "x")
    assert told in caplog.text
    assert bool(told) == bool(caplog.records)
    parse_quantity("90", "m", "x")
    assert len(caplog.records) == bool(told)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        *(("", "m"), ("m", "m"), ("5deg", "m"), ("5m", "rad"), ("5m", ""), ("nan", "m"), ("inf", "m"), ("1e999", "")),
        *(("1_000", "m"), ("0x10", "m"), ("1,5", "m"), ("5 6", "m"), ("5mm mm", "m")),
    ],
)
def test_what_is_no_such_quantity_is_named(text: str, unit: str) -> None:
    with pytest.raises(UsageError, match="--mount") as caught:
        parse_quantity(text, unit, "--mount")
    assert f"'{text}'" in str(caught.value)


@pytest.mark.parametrize(("text", "unit"), [("1e10", "m"), ("-2e6km", "m"), ("1e300", "rad"), ("1e308min", "s")])
def test_what_is_beyond_all_bounds_is_refused(text: str, unit: str) -> None:
    with pytest.raises(UsageError, match=f"'{text}' is beyond"):
        parse_quantity(text, unit, "--init")


@given(st.floats(-1e9, 1e9))
def test_plain_numbers_come_back_to_the_bit(value: float) -> None:
    assert parse_quantity(repr(value), "m", "x") == value


def test_a_list_has_a_unit_for_each_place() -> None:
    assert parse_list("1,20cm,90deg", ("m", "m", "rad"), "--init") == pytest.approx((1.0, 0.2, math.pi / 2))
    assert parse_list("1,2", ("m", "m", "rad"), "--init") == (1.0, 2.0)


@pytest.mark.parametrize("text", ["1,2,3,4", "1,,3", "1,2,x", ""])
def test_lists_that_do_not_fit_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--init"):
        parse_list(text, ("m", "m", "rad"), "--init")
