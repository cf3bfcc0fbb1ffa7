"""What the constants of the posterior must be like, whatever a fit makes of them."""

from __future__ import annotations

import numpy as np

from mclcli.search.calibration import LAW


def test_being_elsewhere_means_that_more_beams_end_anywhere() -> None:
    assert LAW.fitting > LAW.strange
    assert (np.diff(LAW.rates) > 0.0).all()
    assert 0.0 < LAW.rates[0] < LAW.rates[-1] < 1.0


def test_the_beam_model_can_only_take_a_little() -> None:
    assert 0.0 <= LAW.rays <= LAW.ends
    assert LAW.worst <= 1.0
    assert LAW.length > 0.0
