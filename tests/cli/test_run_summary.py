"""What ``mcl run`` says at the end: where the robot began and ended, how sure, what is doubtful; -q and -v."""

from __future__ import annotations

import os
import re
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.cli.console import fitting
from mclcli.cli.run.ends import Ends, deviations
from mclcli.cli.run.progress import forms
from mclcli.records import Estimate
from tests.cli.support import OFFICE_MAP, finish, process

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

LOST = "4,-4,0,0.1,3deg"
PLACE = r"(-?\d+\.\d\d,-?\d+\.\d\d,-?\d+\.\d)deg ± (\d+\.\d\d) m, (\d+\.\d)° at (\d+\.\d) s of the log"


def said(err: str, what: str) -> re.Match[str]:
    found = re.search(f"^mcl: {what}: {PLACE}$", err, re.MULTILINE)
    assert found is not None, err
    return found


def test_the_summary_says_where_the_robot_began_and_ended(run_short: Runner) -> None:
    result = run_short("--steps", "-")
    steps = result.table
    first, last = said(result.err, "first update"), said(result.err, "last update")
    for found, row in ((first, 0), (last, -1)):
        x, y, yaw = (float(text) for text in found[1].split(","))
        np.testing.assert_allclose([x, y], [steps["x"][row], steps["y"][row]], atol=0.0051)
        assert abs(yaw - np.degrees(steps["yaw"][row])) < 0.051
        assert float(found[3]) == pytest.approx(np.degrees(np.sqrt(steps["cov_yawyaw"][row])), abs=0.051)
    reliability = steps["reliability"]
    line = f"reliability: {reliability.mean():.2f} on average, {reliability.min():.2f} at the least"
    assert line in result.err
    assert "warning" not in result.err


def test_the_deviation_is_that_of_the_longest_axis() -> None:
    turned = np.array([[2.5, 1.5, 0.0], [1.5, 2.5, 0.0], [0.0, 0.0, 0.01]])
    assert deviations(Estimate(np.zeros(3), turned)) == pytest.approx((2.0, 0.1))


def test_doubts_of_the_end() -> None:
    lost = Ends(ends_lost=True, last_reliability=0.31, converged=False)
    assert lost.doubts() == ["probably lost at the last update (reliability 0.31): do not rely on its pose"]
    assert "not in one place" in Ends(converged=False).doubts()[0]
    assert Ends().doubts() == []
    assert Ends().lines(0) == []


def test_quiet_hides_no_doubt(run_short: Runner) -> None:
    loud, quiet = run_short("--track", "-", init=LOST), run_short("--track", "-", "-q", init=LOST)
    assert loud.out == quiet.out
    lines = quiet.err.splitlines()
    assert all(line.startswith("mcl: warning: ") for line in lines)
    assert any("probably lost, or off the map, at" in line for line in lines)
    assert any("probably lost at the last update" in line for line in lines)
    assert run_short("--track", "-", "-q").err == ""


def test_verbose_says_more(run_short: Runner) -> None:
    plain, more = run_short("--track", "-"), run_short("--track", "-", "-v")
    added = set(more.err.splitlines()) - set(plain.err.splitlines())
    for what in ("settings: profile textbook", "scan: /scan", "odometry: /odom", "map: office.yaml", "took "):
        assert any(line.startswith(f"mcl: {what}") for line in added), what
    assert more.out == plain.out


def test_a_terminal_is_told_how_to_keep_a_result(short: Path) -> None:
    words = ("run", short, "--map", OFFICE_MAP, "--init", "/initialpose", "--particles", 50)
    master, slave = os.openpty()
    try:
        result = finish(process(*words, stdout=slave, stderr=subprocess.PIPE))
    finally:
        os.close(slave)
        os.close(master)
    assert result.code == 0
    assert result.err.splitlines()[-1].startswith("mcl: nothing was kept; --track F.csv")


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_progress_is_never_cut(width: int) -> None:
    for pose in ([-1234.56, -1234.56, -3.1], [0.0, 0.0, 0.0]):
        lines = forms(" 92 %", 100209.2, 5.0, (1431, 20000), np.array(pose))
        assert len(fitting(lines, width)) <= width
        assert [len(line) for line in lines] == sorted((len(line) for line in lines), reverse=True)
    assert "×" in fitting(lines, width)
