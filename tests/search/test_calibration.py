"""What the fit of docs/locate.md makes of some figures, added up by hand."""

from __future__ import annotations

import math

import pytest

from mclcli.search.calibration import Figures, logit, probability


@pytest.mark.parametrize(
    ("figures", "expected"),
    [
        # log_odds −5, agreed −5: clipped to −2, 4, −4, 2; passed 0: 0, 0.3; strain 0: 0.5, 1
        ((-5.0, 0.0, 0.0, 0.0), 4.171 - 0.494 + 0.324 - 2.06 + 0.49 - 0.0 - 1.3302 - 2.288 - 1.267),
        # log_odds 10, agreed 6; passed −0.2; strain 0.7: min(0.7, 0.3 + 4 · 0.3)
        ((10.0, 6.0, 0.3, 0.7), 4.171 + 0.988 + 0.81 + 1.03 + 1.47 + 0.8668 - 1.3302 - 3.2032 - 1.267),
        # log_odds 40, agreed 40; passed 2; strain 0.7: min(2.3, 0.3 + 4 · 0.1)
        ((40.0, 41.0, 0.1, 2.3), 4.171 + 0.988 + 2.43 + 1.03 + 2.94 + 0.0 - 4.434 - 3.2032 - 1.267),
        # log_odds 1, agreed −1; passed 0.5; strain 2
        ((1.0, -1.0, 0.5, 2.0), 4.171 + 0.247 + 0.324 - 0.515 + 0.49 - 0.0 - 2.217 - 4.576 - 2.534),
        # passed −2, strain 4: the lowest and a high one
        ((1.0, 5.0, 2.0, 4.0), 4.171 + 0.247 + 0.324 + 0.515 + 0.49 + 4.334 - 1.3302 - 4.576 - 5.068),
        # strain 7
        ((1.0, 5.0, 3.0, 7.0), 4.171 + 0.247 + 0.324 + 0.515 + 0.49 + 4.334 - 1.3302 - 4.576 - 6.335),
    ],
)
def test_terms_are_clipped_weighted_and_added(figures: tuple[float, float, float, float], expected: float) -> None:
    assert logit(Figures(*figures)) == pytest.approx(expected, abs=1e-9)
    assert probability(Figures(*figures)) == pytest.approx(1.0 / (1.0 + math.exp(-expected)), abs=5e-4)


def test_no_answer_is_certain() -> None:
    assert probability(Figures(-50.0, -50.0, 9.0, 90.0)) == 0.0005
    assert probability(Figures(50.0, 50.0, 0.0, 0.0)) == pytest.approx(0.9995, abs=0.01)
    assert probability(Figures(50.0, 50.0, 0.3, -0.5)) == 0.9995
