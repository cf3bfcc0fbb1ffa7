"""Stretches of updates at which a robot was probably lost."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from mclcli.cli.run.report import _losses, _within
from mclcli.records import Estimate
from mclcli.replay.tally import ReplayTally, Stretch

LOG = SimpleNamespace(first_ns=0)


def judged(fits: list[float]) -> ReplayTally:
    """Updates a second apart, a metre apart on x."""
    tally = ReplayTally(updates=len(fits))
    for i, fit in enumerate(fits):
        estimate = Estimate(np.array([float(i), -1.0, 0.0]), np.eye(3))
        told = SimpleNamespace(stamp_ns=i * 10**9, estimate=estimate, reliability=fit, lost=fit < 0.8)
        tally.judge(told)  # type: ignore[arg-type]
    return tally


def test_updates_in_a_row_are_one_stretch() -> None:
    assert judged([0.9, 0.7, 0.3, 0.5, 0.9, 0.79]).lost == [
        Stretch(10**9, 3 * 10**9, (1.0, -1.0), (3.0, -1.0), 0.3, 3),
        Stretch(5 * 10**9, 5 * 10**9, (5.0, -1.0), (5.0, -1.0), 0.79, 1),
    ]


def test_the_summary_names_the_first_five() -> None:
    lines = _losses(LOG, judged([0.5, 0.9] * 7))  # type: ignore[arg-type]
    assert lines[0] == "probably lost, or off the map, at 7 of 14 updates (reliability < 0.8)"
    assert lines[2] == "  lost from 2.0 to 2.0 s of the log, 2.0,-1.0 to 2.0,-1.0, reliability 0.50"
    assert lines[6] == "  and 2 more; column lost of --steps has them all"
    assert len(lines) == 7
    assert len(_losses(LOG, judged([0.5, 0.9] * 5))) == 6  # type: ignore[arg-type]
    assert _losses(LOG, judged([0.9])) == []  # type: ignore[arg-type]


def test_poses_between_two_lost_updates_are_marked() -> None:
    stamps = np.arange(8, dtype=np.int64) * 5 * 10**8
    marked = _within(stamps, judged([0.9, 0.7, 0.3, 0.9]).lost)
    assert marked.tolist() == [False, False, True, True, True, False, False, False]
