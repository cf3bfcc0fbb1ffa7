"""What a search for a lost robot is told: this update's readings, and those before it that did not fit either."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.filter import fit, recovery, temperature
from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import Localizer
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.recovery import Averages, Proposed, RecoveryParameters
from tests.replay.replays import QUIET, drive, ns, run

if TYPE_CHECKING:
    import pytest

    from mclcli.filter.recovery import Situation

ALWAYS = FilterParameters(update_min_d=0.0, update_min_a=0.0)


def stamps_looked_at(monkeypatch: pytest.MonkeyPatch, reliabilities: list[float]) -> list[list[int]]:
    """Stamps [half seconds] of the scans of which each update's search is told; every update draws particles anew."""
    told: list[list[int]] = []

    def propose(situation: Situation, n: int, rng: np.random.Generator) -> Proposed:
        del rng
        told.append([round((o.reading.stamp_ns - ns(0.1)) / ns(0.5)) for o in situation.observations])
        return Proposed.blindly(np.tile([2.0, 3.0, 0.0], (n, 1)))

    said = iter(reliabilities)
    monkeypatch.setattr(fit, "of_all", lambda *_: next(said))
    monkeypatch.setattr(recovery, "observe", lambda *_: Averages(0.0, -2.0))
    localizer = Localizer(QUIET, ALWAYS, 0, KldParameters(3, 3), RecoveryParameters("locate"))
    run(drive(seconds=len(reliabilities) // 2, speed=0.1), localizer=localizer, proposal=propose)
    return told


def test_scans_since_the_robot_seemed_lost_are_looked_at_together(monkeypatch: pytest.MonkeyPatch) -> None:
    told = stamps_looked_at(monkeypatch, [1.0, 1.0, 0.3, 0.4, 0.2, 0.9, 1.0, 0.3])
    assert told == [[2], [2, 3], [2, 3, 4], [7]]  # a robot that fits looks nowhere


def test_no_more_than_a_dozen_updates_are_looked_back_at(monkeypatch: pytest.MonkeyPatch) -> None:
    told = stamps_looked_at(monkeypatch, [0.1] * 20)
    assert told[-1] == list(range(7, 20))


def test_correlation_of_beams_is_measured_at_every_update_that_draws_nothing_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks: list[int] = []
    observe = temperature.observe

    def counted(*known: Any) -> Any:
        looks.append(1)
        return observe(*known)

    monkeypatch.setattr(temperature, "observe", counted)
    told = stamps_looked_at(monkeypatch, [1.0, 0.3, 0.4, 1.0])
    assert (len(told), len(looks)) == (2, 4)
