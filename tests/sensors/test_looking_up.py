"""Codes looked up first and summed afterwards give what one pass gives, by both paths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.native.backend import COMPILED, NUMPY
from mclcli.sensors import endpoints
from mclcli.sensors.beams import Beams
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world import distance_field
from tests.sensors.test_likelihood_field import ORIGIN, POSES, RESOLUTION, ROOM
from tests.support import each_backend, grid_of

if TYPE_CHECKING:
    from mclcli.native.backend import Backend

FIELD = distance_field.compute(grid_of(ROOM, RESOLUTION, ORIGIN), "exact", 1.0)
ENDS = np.random.default_rng(2).uniform(-5.0, 5.0, (19, 2))
TABLE = np.random.default_rng(3).normal(size=FIELD.levels.size + 1)


def test_loops_over_a_map_of_ordinary_size_run_compiled() -> None:
    assert endpoints.kernels_over(FIELD, COMPILED, "likelihood_field") is not None
    assert endpoints.kernels_over(FIELD, NUMPY, "likelihood_field") is None


@each_backend
@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
def test_a_set_that_has_not_converged_skips_no_beam(backend: Backend, lookup: str) -> None:
    beams = Beams(np.zeros((19, 2)), ENDS, np.ones(19), 8.0, slots=19)
    one, other = (
        LikelihoodField(FIELD, LikelihoodFieldParameters(do_beamskip=skips, field_lookup=lookup), backend)  # type: ignore[arg-type]
        for skips in (True, False)
    )
    assert one.measure("lidar", beams).log_likelihood(POSES).tobytes() == (
        other.measure("lidar", beams).log_likelihood(POSES).tobytes()
    )


def test_a_scan_without_beams_says_nothing_of_a_converged_set() -> None:
    beams = Beams(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), 8.0)
    model = LikelihoodField(FIELD, LikelihoodFieldParameters(do_beamskip=True))
    assert model.measure("lidar", beams).log_likelihood(np.zeros((3, 3))).tolist() == [0.0, 0.0, 0.0]


def test_no_pose_is_possible_where_nearly_all_beams_are_skipped_and_a_slot_is_empty() -> None:
    beams = Beams(np.zeros((19, 2)), 1e4 * ENDS, np.ones(19), 8.0, slots=20)
    poses = np.array([0.5, 0.3, 0.2]) + np.random.default_rng(4).normal(0, 0.05, (7, 3))
    model = LikelihoodField(FIELD, LikelihoodFieldParameters(do_beamskip=True))
    assert model.measure("lidar", beams).log_likelihood(poses).tolist() == [-np.inf] * 7


@each_backend
@pytest.mark.parametrize("wide", [False, True])
def test_two_steps_have_the_bits_of_one(backend: Backend, *, wide: bool) -> None:
    codes = FIELD.codes.astype(np.uint32) if wide else FIELD.codes.copy()
    codes.flags.writeable = False
    field = distance_field.DistanceField(codes, FIELD.levels, RESOLUTION, FIELD.origin)
    found = endpoints.look_up(field, ENDS, POSES, backend=backend)
    assert found.shape == (19, len(POSES))
    assert found.max() == field.levels.size
    at_once = endpoints.sum_table(field, TABLE, ENDS, POSES, backend=backend)
    assert endpoints.sum_looked_up(found, TABLE, backend).tobytes() == at_once.tobytes()


@pytest.mark.parametrize("most", [0, 10**9])
def test_how_beams_are_skipped_does_not_depend_on_what_is_kept_in_memory(
    monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    from mclcli.sensors import likelihood_field

    monkeypatch.setattr(likelihood_field, "_MOST_LOOKED_UP", most)
    poses = np.array([0.5, 0.3, 0.2]) + np.random.default_rng(4).normal(0, 0.05, (200, 3))
    beams = Beams(np.zeros((19, 2)), ENDS, np.ones(19), 8.0, slots=19)
    parameters = LikelihoodFieldParameters(do_beamskip=True, beam_skip_distance=0.3)
    found = LikelihoodField(FIELD, parameters).measure("lidar", beams).log_likelihood(poses)
    distances = endpoints.distances(FIELD, ENDS, poses)
    kept = (distances < 0.3).mean(axis=0) > parameters.beam_skip_threshold
    assert 0 < kept.sum() < 19
    plain = LikelihoodField(FIELD, LikelihoodFieldParameters()).measure("lidar", beams.subset(kept))
    assert found.tobytes() == plain.log_likelihood(poses).tobytes()
