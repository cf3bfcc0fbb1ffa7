"""Shares from evidence: one distribution over places, what was not looked at, and not being on this map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.search.calibration import LAW
from mclcli.search.evidence import Evidence
from mclcli.search.posterior import posterior

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

HERE = np.array([-3.0, 0.0, -1.0])


def evidence(strange: FloatArray) -> Evidence:
    nothing = np.zeros(3)
    return Evidence(HERE, nothing, nothing, nothing, nothing, strange)


def test_shares_are_the_masses_over_the_sum_of_all() -> None:
    found = posterior(evidence(HERE - 2.0), 0.3, 0.05)
    inside = np.exp(HERE).sum()
    missed = 0.3 * math.exp(LAW.unlisted) * inside
    strange = math.exp(LAW.doubt - 2.0) * (inside + missed)
    whole = inside + missed + strange
    assert found.order.tolist() == [1, 2, 0]
    np.testing.assert_allclose(found.shares, np.exp([0.0, -1.0, -3.0]) / whole)
    assert found.unlisted == pytest.approx(missed / whole)
    assert found.elsewhere == pytest.approx(strange / whole)
    assert found.shares.sum() + found.unlisted + found.elsewhere == pytest.approx(1.0)
    np.testing.assert_allclose(found.low, np.exp([0.0, -1.0, -3.0]) / (inside * 1.3 + strange))
    np.testing.assert_allclose(found.high, np.exp([0.0, -1.0, -3.0]) / (inside + strange))


def test_the_prior_of_not_being_on_the_map_scales_the_odds() -> None:
    odds = []
    for prior in (0.05, 0.5):
        found = posterior(evidence(HERE), 0.0, prior)
        odds.append(found.elsewhere / (1.0 - found.elsewhere))
    assert odds[1] / odds[0] == pytest.approx(19.0)
    assert posterior(evidence(HERE), 0.0, 0.0).elsewhere == 0.0


def test_beams_that_end_anywhere_all_along_are_of_another_map() -> None:
    """Evidence so large that its exponential overflows leaves a distribution all the same."""
    found = posterior(evidence(HERE + 5000.0), 0.0, 0.05)
    assert found.elsewhere == pytest.approx(1.0)
    assert found.shares.sum() == pytest.approx(0.0, abs=1e-12)
