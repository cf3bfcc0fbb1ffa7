"""Tables at the width of a screen."""

from __future__ import annotations

import re

import numpy as np
import pytest

from mclcli.cli.eval.report import _errors_table, _spread_table, _tracks_table
from mclcli.cli.tables import rendered
from mclcli.evaluate.evaluation import evaluate
from mclcli.evaluate.spread import spreads
from mclcli.geometry.trajectory import Trajectory

STAMPS = np.arange(200, dtype=np.int64) * 10**8


def drive(offset: float) -> Trajectory:
    x = np.linspace(0.0, 40.0, STAMPS.size)
    return Trajectory(STAMPS, np.stack([x, offset * np.sin(x), np.zeros_like(x)], axis=-1))


EVALUATIONS = [evaluate(drive(0.1 * i), drive(0.0), name=f"seeds/a long name of a track {i}.csv") for i in (1, 2, 3)]
TABLES = {
    "errors": _errors_table(EVALUATIONS[0]),
    "tracks": _tracks_table(EVALUATIONS),
    "spread": _spread_table(spreads(EVALUATIONS, 0)),
}


def figures(text: str) -> list[str]:
    return sorted(re.findall(r"\d+\.\d+", text))


@pytest.mark.parametrize("width", [60, 80, 200])
@pytest.mark.parametrize("name", TABLES)
def test_no_digit_is_cut(name: str, width: int) -> None:
    table = TABLES[name]
    shown = rendered(table, width)
    assert max(map(len, shown.splitlines())) <= width
    assert "…" not in shown
    whole = figures(rendered(table))
    headings = {str(column.header) for column in table.columns[1:]}
    for heading in headings:
        assert heading in shown
    assert set(whole) <= set(figures(shown))
    assert whole


def test_a_row_of_a_narrow_table_is_told_below_its_name() -> None:
    lines = rendered(TABLES["errors"], 60).splitlines()
    assert lines[0] == "APE, translation [m]"
    assert lines[1].startswith("  rmse 0.")
    assert all(line.startswith("  ") or line in {"", *TABLES["errors"].columns[0].cells} for line in lines)
