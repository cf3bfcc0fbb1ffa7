"""What a run says of a start that had to be searched for."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from mclcli.cli.run import beginnings
from mclcli.filter.start import Placed
from mclcli.replay.tally import ReplayTally
from tests.cli.support import MAPS, SAMPLES, mcl

LOG = SimpleNamespace(first_ns=10**9)
HERE, THERE = (1.0, 2.0, 0.5), (8.0, -2.0, 3.0)


def placed(*shares: float, elsewhere: float = 0.0) -> Placed:
    """A start with two places, or fewer."""
    places = np.array([HERE, THERE][: len(shares)]).reshape(-1, 3)
    return Placed(np.zeros((4, 3)), np.zeros(4, np.int64), places, np.array(shares), elsewhere)


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (placed(0.8, 0.2), ""),
        (placed(0.79, 0.2), "ambiguous, probability 0.79; or 8.00,-2.00,171.9deg (0.20)"),
        (placed(0.5, 0.3, elsewhere=0.2), "ambiguous, probability 0.50; or 8.00,-2.00,171.9deg (0.30), not on this"),
        (placed(0.3, 0.1, elsewhere=0.6), "not on this map, with probability 0.60"),
        (placed(0.1), "ambiguous, probability 0.10; or elsewhere"),
        (placed(), "the readings say nothing"),
    ],
)
def test_doubts_are_said(start: Placed, says: str) -> None:
    assert beginnings.doubt_of(start).startswith(says)
    assert bool(beginnings.doubt_of(start)) == bool(says)


def test_the_line_is_one_that_init_takes() -> None:
    assert beginnings.line(LOG, 3 * 10**9, placed(0.97)) == (  # type: ignore[arg-type]
        "start: 1.00,2.00,28.6deg, probability 0.97 at 2.0 s of the log"
    )


def test_the_summary_repeats_every_start_with_its_doubt() -> None:
    tally = ReplayTally(found=[(10**9, placed(0.97)), (4 * 10**9, placed(0.3, elsewhere=0.6))])
    first, second = beginnings.repeated(LOG, tally)  # type: ignore[arg-type]
    assert first.endswith("probability 0.97 at 0.0 s of the log")
    assert second.endswith("at 3.0 s of the log; not on this map, with probability 0.60")
    kept = beginnings.repeated(LOG, dataclasses.replace(tally, undecided={1: (5 * 10**9, 3)}))  # type: ignore[arg-type]
    assert kept == [first, second, "  3 places kept alive up to 4.0 s of the log; column modes of --steps"]


def test_places_that_are_still_possible_at_the_end_are_a_doubt() -> None:
    tally = ReplayTally(found=[(10**9, placed(0.97)), (4 * 10**9, placed(0.3))], undecided={1: (5 * 10**9, 3)})
    (doubt,) = beginnings.undecided(tally, 5 * 10**9)
    assert doubt.startswith("3 places were still possible at the last update")
    assert beginnings.undecided(tally, 6 * 10**9) == []
    assert beginnings.undecided(dataclasses.replace(tally, undecided={0: (5 * 10**9, 3)}), 5 * 10**9) == []
    assert beginnings.undecided(ReplayTally(), 0) == []


def test_a_run_says_where_it_began_once_at_the_start_and_once_in_the_summary() -> None:
    words = (SAMPLES / "office.mcap", "--duration", "5", "--track", "-")
    right = mcl("run", *words, "--map", MAPS / "office.yaml")
    assert right.err.count("start: -7.4") == 2
    assert "warning" not in right.err
    wrong = mcl("run", *words, "--map", MAPS / "warehouse.yaml")
    assert "mcl: warning: start: not on this map, with probability" in wrong.err
    given = mcl("run", *words, "--map", MAPS / "office.yaml", "--init=-7.45,1.66,-84deg")
    assert "start:" not in given.err
