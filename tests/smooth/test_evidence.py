"""Temperature and the repetition of errors, against sums written out; and what both say of right and wrong maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.smooth import evidence
from mclcli.smooth.evidence import Evidence, Scores
from mclcli.smooth.scans import Law, Residuals
from tests.reference import smoothing as reference
from tests.smooth.example import POSES, SURFACE, factors

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


def independent(n: int = 30, beams: int = 36, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Scores (n, beams, 3) of independent beams and their curvatures (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    jacobians = rng.normal(size=(n, beams, 3))
    scores = jacobians * rng.normal(size=(n, beams, 1))
    return scores, np.einsum("nki,nkj->nij", jacobians, jacobians)


def test_the_temperature_is_that_of_the_sums_written_out() -> None:
    scores, curvatures = independent()
    known = Scores(scores, curvatures, np.arange(30) % 3 > 0)
    chosen = known.sharp
    expected = reference.godambe(scores[chosen].tolist(), np.linalg.inv(curvatures[chosen]).tolist(), 6)
    assert evidence.godambe(known) == pytest.approx(expected, rel=1e-9)


def test_beams_that_repeat_their_neighbours_count_less() -> None:
    scores, curvatures = independent(200)
    alone = evidence.godambe(Scores(scores, curvatures, np.ones(200, np.bool_)))
    pairs = np.repeat(scores, 3, axis=1), 3.0 * curvatures
    threes = evidence.godambe(Scores(*pairs, np.ones(200, np.bool_)))
    assert alone == pytest.approx(1.0, abs=0.1)
    assert 0.3 < threes < 0.45  # three that say the same are one, but for the weights of lags


def test_what_no_scan_tells_is_half() -> None:
    scores, curvatures = independent()
    assert evidence.godambe(Scores(scores, curvatures, np.zeros(30, np.bool_))) == 0.5


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_repetition_is_that_of_the_sums_written_out(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scores = rng.normal(size=(12, 9, 3)) + 0.4
    tiles = rng.integers(-1, 4, (12, 9))
    known = Scores(scores, np.tile(np.eye(3), (12, 1, 1)), np.ones(12, np.bool_))
    assert evidence.tau(known, tiles) == pytest.approx(reference.tau(scores.tolist(), tiles.tolist(), 60), rel=1e-9)


def test_scans_without_a_beam_repeat_nothing() -> None:
    known = Scores(np.zeros((3, 2, 3)), np.tile(np.eye(3), (3, 1, 1)), np.zeros(3, np.bool_))
    assert evidence.tau(known, np.full((3, 2), -1)) == 0.0


def test_tiles_are_of_two_metres_of_the_map() -> None:
    found = factors(Law(0.05, 0.9, 0.1))
    tiles = evidence.tiles_of(found, POSES)
    for k, pose in enumerate(POSES.tolist()):
        rows = zip(found.scans.ends[k].tolist(), found.scans.directions[k].tolist(), tiles[k].tolist(), strict=True)
        for beam, (end, ahead, tile) in enumerate(rows):
            x, y = reference.endpoint(pose, tuple(end), tuple(ahead), 0.1)
            column, row = (x - SURFACE.field.origin[0]) // 2.0, (y - SURFACE.field.origin[1]) // 2.0
            expected = (row + 50_000) * 100_000 + column + 50_000 if beam < found.scans.counts[k] else -1
            assert tile == expected


def test_misfit_is_the_mean_by_tile_with_its_sign() -> None:
    """Beams 3 cm behind their walls in one tile, 1 cm before them in another, and both ways in a third."""
    distances = np.tile([0.03, 0.01, 0.02], (100, 1)).astype(np.float64)
    along = np.tile([0.8, -0.5, 1.0], (100, 1)) * np.where(np.arange(100) % 2 == 0, 1.0, [[1.0], [1.0], [-1.0]]).T
    flat = np.zeros((100, 3))
    found = Residuals(distances, flat, flat, flat, along, np.ones((100, 3)))
    tiles = np.tile([1, 2, 3], (100, 1))
    assert evidence.misfit(found, tiles) == pytest.approx(np.sqrt((0.03**2 + 0.01**2) / 3.0))
    assert evidence.misfit(found, np.full((100, 3), -1)) == 0.0


def test_only_doubtful_evidence_makes_scans_repeat_each_other() -> None:
    right = Evidence(0.9, 8.0, 0.003, 0.006, 500)
    assert right.alpha == 0.9
    assert not any((right.repeated, right.misfitting, right.scarce))
    repeated = Evidence(0.9, 25.0, 0.003, 0.006, 500)
    assert repeated.repeated
    assert repeated.alpha == pytest.approx(1 / 25)
    misfitting = Evidence(0.1, 8.0, 0.02, 0.006, 500)
    assert misfitting.misfitting
    assert misfitting.alpha == pytest.approx(0.1)
    assert Evidence(0.9, 8.0, 0.003, 0.006, 20).scarce
