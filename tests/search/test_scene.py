"""Where the base may be, in which frame poses are searched, and what bearings add to their score."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import get_args

import numpy as np
import pytest

from mclcli.search import scene as scenes
from mclcli.sensors.bearing import BearingModel, BearingParameters, Bearings
from mclcli.sensors.likelihood_field import FieldAnchor, OriginYaw
from tests.search.scenes import finder_for, hall
from tests.worlds import drawn

ROOM = drawn("....\n.#..\n....", 0.5)  # centres of cells at 0.25, 0.75, 1.25, 1.75


@pytest.mark.parametrize(
    ("region", "disc", "expected"),
    [
        ((0.25, 0.25, 1.25, 0.25), None, ["....", "....", "###."]),  # borders belong to it
        ((1.75, 1.25, 1.25, 0.75), None, ["..##", "..##", "...."]),  # either pair of corners
        (None, (0.25, 0.25, 0.5), ["....", "#...", "##.."]),
        ((0.0, 0.0, 0.5, 9.0), (0.25, 0.25, 0.5), ["....", "#...", "#..."]),
        ((5.0, 5.0, 9.0, 9.0), None, ["....", "....", "...."]),
    ],
)
def test_a_cell_is_allowed_if_its_centre_is(
    region: tuple[float, float, float, float] | None, disc: tuple[float, float, float] | None, expected: list[str]
) -> None:
    allowed = scenes.allowed_cells(ROOM, "free", region, disc)
    assert ["".join(".#"[int(cell)] for cell in row) for row in allowed[::-1]] == expected


SCENE = finder_for(hall(origin=(2.0, -1.0, 0.6))).scene


def anchored(anchor: FieldAnchor, yaw: OriginYaw) -> scenes.Scene:
    parameters = dataclasses.replace(SCENE.model.parameters, field_anchor=anchor, origin_yaw=yaw)
    return dataclasses.replace(SCENE, model=dataclasses.replace(SCENE.model, parameters=parameters))


@pytest.mark.parametrize(("anchor", "yaw"), list(itertools.product(get_args(FieldAnchor), get_args(OriginYaw))))
def test_poses_come_back_from_the_fields_frame(anchor: FieldAnchor, yaw: OriginYaw) -> None:
    scene = anchored(anchor, yaw)
    poses = np.random.default_rng(1).uniform([-3, -3, -3], [3, 3, 3], (20, 3))
    cells = np.column_stack(scene.anchoring.to_cells(scene.model.field, poses))
    np.testing.assert_allclose(scene.to_map(cells), poses, atol=1e-12)
    assert scene.anchoring == scene.model._anchoring  # noqa: SLF001 - the model that scores them


@pytest.mark.parametrize(("sigma", "eps"), [(0.05, 0.1), (0.3, 0.0), (0.01, 0.5)])
def test_the_law_of_sightings_is_the_bearing_mixture(sigma: float, eps: float) -> None:
    model = BearingModel(BearingParameters(sigma_bearing=sigma, eps_outlier=eps))
    seen = Bearings(np.array([0.2, -0.1]), np.array([0.3, -2.0]), np.array([[3.0, 1.0], [4.0, 0.5]]), 0, ("a", "b"))
    sightings = scenes.sightings_of(SCENE, [seen], model)
    peak, factor, rest, floor, most = sightings.law.tolist()
    errors = np.linspace(-math.pi, math.pi, 41)
    law = np.log(np.maximum(peak * np.exp(factor * errors**2) + rest, floor))
    np.testing.assert_allclose(law, model.log_p(errors), rtol=1e-12)
    assert most == pytest.approx(2.0 * model.log_p(np.zeros(1))[0])
    marks = sightings.marks
    landmarks = SCENE.to_map(np.column_stack([marks[:, :2], np.zeros(2)]))[:, :2]
    np.testing.assert_allclose(landmarks, seen.landmarks, atol=1e-12)
    assert marks[:, 2].tolist() == seen.angles.tolist()
    np.testing.assert_allclose(marks[:, 3:] * SCENE.model.field.resolution, [[0.2, -0.1]] * 2)


def test_nothing_sighted_adds_nothing() -> None:
    assert scenes.sightings_of(SCENE, [], None).law[4] == 0.0


def test_a_stray_endpoint_scores_the_mean_of_the_known_cells() -> None:
    model = SCENE.model
    p = np.exp(model.table(8.0)[model.field.codes])[~hall().unknown].mean()
    assert SCENE.log_stray(8.0) == pytest.approx(math.log(p))
