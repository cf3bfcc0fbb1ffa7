"""Sizes by KLD as nav2_amcl and Beluga compute them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.filter import kld
from mclcli.filter.kld import KldParameters
from tests.data import golden

if TYPE_CHECKING:
    from tests.golden.conftest import Note

ENDLESS = 2**31


def limits(table: dict[str, Any], k: list[int], least: int, most: int, unlimited: int) -> list[int | None]:
    """Our limits by the other program's rules; None where it has none."""
    parameters = KldParameters(least, most, table["pf_err"], table["pf_z"], "z", unlimited)
    found: list[int] = kld.limit(np.array(k), parameters).tolist()
    return [None if n == ENDLESS else n for n in found]


def test_limits_and_targets_are_those_of_nav2_and_beluga(note: Note) -> None:
    data = json.loads(golden("kld.json").read_text())
    k = data["k"]
    assert len(data["tables"]) == 9
    for table in data["tables"]:
        assert limits(table, k, 1, ENDLESS, 1) == table["nav2_limit_unclamped"]
        assert limits(table, k, 500, 2000, 1) == table["nav2_limit_min500_max2000"]
        assert limits(table, k, 1, ENDLESS, 2) == table["beluga_target"]
        note("kld.json", "limits and targets", 0.0, 3 * len(k))
