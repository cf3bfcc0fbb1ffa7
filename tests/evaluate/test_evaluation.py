"""One track summed up, several tracks summed up, and limits."""

from __future__ import annotations

import json
from dataclasses import fields

import numpy as np
import pytest

import mclcli
from mclcli.evaluate.evaluation import Evaluation, Protocol, as_plain, evaluate
from mclcli.evaluate.limits import Limits, missed
from mclcli.evaluate.spread import FIGURES, spread, spreads
from mclcli.geometry.trajectory import Trajectory
from tests.evaluate.drives import drive, noisy, shifted

REFERENCE = drive(np.arange(0.0, 60.0, 0.5))


def good() -> Evaluation:
    return evaluate(shifted(REFERENCE, 0.03, 0.01), REFERENCE, name="good.csv")


def bad() -> Evaluation:
    """A track that is lost once, without covariances, and half covered."""
    dx = np.where((np.arange(120) > 30) & (np.arange(120) < 40), 4.0, 0.3)
    dx[:10] = 0.7
    half = Trajectory(REFERENCE.stamps_ns[:60], REFERENCE.poses[:60])
    return evaluate(shifted(REFERENCE, dx, 0.15), half, name="bad.csv")


def test_a_constant_error() -> None:
    e = good()
    assert e.translation.rmse == pytest.approx(0.03)
    assert e.translation.std == pytest.approx(0.0, abs=1e-9)
    assert e.yaw.max == pytest.approx(0.01)
    assert e.within == {0.05: 1.0, 0.1: 1.0, 0.2: 1.0, 0.5: 1.0}
    assert (e.converged_after, e.losses, e.coverage) == (0.0, (), 1.0)
    assert e.way == pytest.approx(0.5 * 59.5, rel=0.01)
    assert (e.motion, e.consistency) == (None, None)


def test_alignment_only_when_asked_for() -> None:
    aligned = evaluate(shifted(REFERENCE, 5.0), REFERENCE, Protocol(align=True))
    assert aligned.translation.max < 1e-9
    assert aligned.motion == pytest.approx((-5.0, 0.0, 0.0), abs=1e-9)
    assert evaluate(shifted(REFERENCE, 5.0), REFERENCE).translation.min == pytest.approx(5.0)


def test_plain_values_are_json() -> None:
    facts = as_plain(bad())
    assert json.loads(json.dumps(facts, allow_nan=False)).keys() == facts.keys()
    assert (facts["compared"], facts["poses"], facts["coverage"]) == (60, 120, 0.5)
    assert facts["ape"]["translation"]["count"] == 60
    (loss,) = facts["losses"]
    assert loss["end"] - loss["start"] == pytest.approx(4.5)
    assert facts["consistency"] is None


@pytest.mark.parametrize(
    ("limits", "sentence"),
    [
        (Limits(max_ape=0.1), "is more than --max-ape 0.1 m"),
        (Limits(max_error=1.0), "largest error 4.0000 m is more than --max-error 1 m"),
        (Limits(max_yaw=0.1), "yaw error 8.594 deg (RMSE) is more than --max-yaw 5.72958 deg"),
        (Limits(max_rpe=0.1), "m per m (RMSE) is more than --max-rpe 0.1"),
        (Limits(max_losses=0), "lost once, 4.5 s in all; --max-losses is 0"),
        (Limits(max_convergence=1.0), "converged after 5.0 s; --max-convergence is 1 s"),
        (Limits(max_anees=2.0), "ANEES unknown: the track states no covariance"),
        (Limits(min_ellipse=0.9), "coverage of the 95 % ellipse unknown: the track states no covariance"),
        (Limits(min_within=(0.9, 0.5)), "68.3 % of the poses are within 0.5 m; --min-within asks for 90 %"),
        (Limits(min_coverage=0.9), "the reference covers 50.0 % of the poses; --min-coverage asks for 90 %"),
    ],
)
def test_limits_are_missed_with_a_sentence_each(limits: Limits, sentence: str) -> None:
    (told,) = missed(bad(), limits)
    assert sentence in told
    unknown = limits.max_anees is not None or limits.min_ellipse is not None
    assert len(missed(good(), limits)) == int(unknown)


def test_proud_covariances_miss_the_limit_on_their_ellipses() -> None:
    """Errors of 0.1 m, stated as 3 cm: inside are none."""
    off = Trajectory(
        REFERENCE.stamps_ns, REFERENCE.poses + np.array([0.1, 0.0, 0.0]), np.tile(0.0009 * np.eye(3), (120, 1, 1))
    )
    (told,) = missed(evaluate(off, REFERENCE), Limits(min_ellipse=0.9))
    assert told == "0.0 % of the updates are inside their 95 % ellipse; less than --min-ellipse 90 %"
    assert missed(evaluate(off, REFERENCE, Protocol(truth_sd=(0.1, 0.0))), Limits(min_ellipse=0.9)) == []


def test_every_limit_is_tried() -> None:
    values = {field.name: 0.0 for field in fields(Limits)} | {"min_within": (1.0, 0.0), "min_coverage": 1.0}
    assert len(missed(bad(), Limits(**values))) == len(fields(Limits))  # type: ignore[arg-type]
    assert missed(bad(), Limits()) == []


def test_a_robot_never_found_keeps_no_limit_on_losses() -> None:
    (told,) = missed(evaluate(shifted(REFERENCE, 9.0), REFERENCE), Limits(max_losses=99))
    assert "never found" in told
    standing = Trajectory(REFERENCE.stamps_ns, np.zeros((120, 3)))
    (told,) = missed(evaluate(standing, standing), Limits(max_rpe=0.1))
    assert "did not drive a metre" in told


def test_a_spread_is_repeatable_and_holds_its_own_median() -> None:
    values = np.random.default_rng(1).normal(1.0, 0.1, 20).tolist()
    found = spread(values, seed=3)
    assert found == spread(values, seed=3)
    assert found is not None
    assert found.median == pytest.approx(np.median(values))
    assert found.median_band[0] <= found.median <= found.median_band[1]
    # of the mean the band is that of the normal distribution, ±1.645 σ/√n
    half = 1.645 * np.std(values) / np.sqrt(20)
    assert found.mean_band == pytest.approx((np.mean(values) - half, np.mean(values) + half), abs=0.15 * half)
    assert spread([]) is None
    lone = spread([2.0])
    assert lone is not None
    assert (lone.median_band, lone.mean_band, lone.count) == ((2.0, 2.0), (2.0, 2.0), 1)


def test_figures_that_some_tracks_lack_say_of_how_many_they_are() -> None:
    never = evaluate(shifted(REFERENCE, 0.7), REFERENCE)
    found = spreads([good(), never])
    assert found["converged_after"].count == 1
    assert found["ape_rmse"].count == 2
    assert "anees" not in found
    assert set(found) < set(FIGURES)


def test_a_notebook_has_everything_at_hand() -> None:
    track, reference = noisy(1)
    e = mclcli.evaluate_track(track, reference, mclcli.Protocol(matching=mclcli.Matching("interpolate")))
    assert isinstance(e, mclcli.Evaluation)
    assert mclcli.compare_tracks(track, reference).apart == ()
