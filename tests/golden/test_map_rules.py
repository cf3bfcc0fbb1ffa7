"""Cells that nav2_map_server makes of every gray value."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.io.maps.map_description import MapDescription
from mclcli.io.maps.map_yaml import rule
from tests.golden.lasers import read

if TYPE_CHECKING:
    from tests.golden.conftest import Note


def test_every_gray_value_as_nav2_takes_it(note: Note) -> None:
    tables = read("map_rules.json")["tables"]
    assert len(tables) == 18
    for table in tables:
        thresholds = table["occupied_thresh"], table["free_thresh"]
        about = MapDescription("m.pgm", 0.05, (0.0, 0.0, 0.0), bool(table["negate"]), *thresholds, table["mode"])
        assert rule(about).tolist() == table["values"], table["mode"]
        note("map_rules.json", "cells of every gray value", 0.0, len(table["values"]))
