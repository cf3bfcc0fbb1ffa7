"""What a map in wrong pieces does to poses: against maps that are wrong, and against the sum written out."""

from __future__ import annotations

import numpy as np

from mclcli.smooth import evidence, map_errors
from mclcli.smooth.scans import Law, ScanFactors
from tests.smooth.example import POSES, SURFACE, scans_at

LAW = Law(0.05, 0.9)
FACTORS = ScanFactors(SURFACE, scans_at(POSES), LAW, np.ones(len(POSES)))


def test_covariances_are_the_sums_over_pieces() -> None:
    seen, tiles = FACTORS.residuals(POSES), evidence.tiles_of(FACTORS, POSES)
    found = map_errors.covariances(FACTORS, POSES, 0.02)
    for k in range(len(POSES)):
        count = FACTORS.scans.counts[k]
        rows = np.stack([seen.by_x[k], seen.by_y[k], seen.by_yaw[k]], axis=-1)[:count]
        weights = seen.shares[k, :count] / LAW.sigma**2
        curvature = sum(w * np.outer(j, j) for w, j in zip(weights, rows, strict=True))
        curvature = curvature + np.trace(curvature) * np.diag([1.0, 1.0, 4.0]) * 0.01 / 6.0
        middle = np.zeros((3, 3))
        for tile in set(tiles[k, :count].tolist()):
            own = tiles[k, :count] == tile
            moved = sum(w * np.outer(j, j[:2]) for w, j in zip(weights[own], rows[own], strict=True))
            middle += moved @ moved.T
        inverse = np.linalg.inv(curvature)
        np.testing.assert_allclose(found[k], 0.06**2 * inverse @ middle @ inverse, rtol=1e-9)


def test_they_grow_with_the_misfit_and_are_covariances() -> None:
    one, two = (map_errors.covariances(FACTORS, POSES, misfit) for misfit in (0.01, 0.02))
    np.testing.assert_allclose(two, 4.0 * one)
    assert (np.linalg.eigvalsh(one) > -1e-12).all()
    assert (np.sqrt(one[:, 0, 0]) > 0.003).all()


def test_seeing_a_piece_with_more_beams_makes_no_surer() -> None:
    more = ScanFactors(SURFACE, scans_at(POSES, beams=120), LAW, np.ones(len(POSES)))
    few, many = (map_errors.covariances(f, POSES, 0.02) for f in (FACTORS, more))
    ratio = np.trace(many, axis1=1, axis2=2) / np.trace(few, axis1=1, axis2=2)
    assert (ratio > 0.6).all()
    assert (ratio < 1.6).all()


def test_scans_without_a_beam_say_nothing() -> None:
    scans = scans_at(POSES)
    none = ScanFactors(SURFACE, type(scans)(scans.ends, scans.directions, np.zeros(4, np.int64), 8.0), LAW, np.ones(4))
    assert not map_errors.covariances(none, POSES, 0.02).any()
