"""Sensors as mounted: what they refuse, and how readings of one sensor are taken together."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mclcli.native.backend import NUMPY
from mclcli.sensors import Measurement
from mclcli.sensors.beam_forms import BeamParameters
from mclcli.sensors.beams import Beams, BeamSelection
from mclcli.sensors.bearing import BearingModel, BearingParameters, observe
from mclcli.sensors.instruments import Camera, Lidar, combine
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.sensors.models import lidar_entry
from mclcli.world import distance_field
from mclcli.world.landmarks import Landmarks
from tests.support import level, scan_of, sightings
from tests.worlds import drawn

ROOM = drawn("....\n.#..\n....\n....", 0.5)
FIELD = distance_field.compute(ROOM, "exact", 2.0)
SOME = Beams(np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.ones(1), 8.0, np.arange(1), 1)
LIDAR = Lidar("lidar", LikelihoodField(FIELD, LikelihoodFieldParameters()), BeamSelection(), 0.5)
CAMERA = Camera("vision", BearingModel(BearingParameters()), Landmarks(("a",), np.array([[1.0, 1.0, 0.0]])), 0.25)
POSES = np.array([[0.5, 0.5, 0.0], [1.0, 0.2, 2.0], [9.0, 9.0, 0.0]])


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({}, ""),
        ({"angle_increment": -0.1}, ""),
        ({"range_max": math.inf}, ""),
        ({"range_max": 0.0}, "range_max"),
        ({"range_max": -1.0}, "range_max"),
        ({"range_max": math.nan}, "range_max"),
        ({"angle_increment": 0.0}, "angle_increment"),
        ({"angle_increment": math.nan}, "angle"),
        ({"angle_min": math.inf}, "angles not finite"),
    ],
)
def test_scans_whose_geometry_makes_no_sense_are_named(changes: dict[str, Any], problem: str) -> None:
    said = LIDAR.problem(scan_of([1.0, 2.0], **changes))
    assert (problem in said) if problem else not said


def test_a_single_beam_needs_no_increment() -> None:
    assert not LIDAR.problem(scan_of([1.0], angle_increment=0.0))


def test_each_instrument_wants_its_own_kind_of_reading() -> None:
    assert LIDAR.problem(sightings(0, ["a"], level(0.0))) == "not a laser scan"
    assert CAMERA.problem(scan_of([1.0])) == "not a sighting of landmarks"
    assert not CAMERA.problem(sightings(0, ["a"], level(0.0)))
    assert "not finite" in CAMERA.problem(sightings(0, ["a"], [[math.nan, 0.0, 1.0]]))


def test_readings_of_one_instrument_add_up() -> None:
    parts = [LIDAR.measure(scan_of([1.0, 0.7]), np.eye(4)), LIDAR.measure(scan_of([0.5]), np.eye(4))]
    both = combine(LIDAR, parts)
    expected = parts[0].log_likelihood(POSES) + parts[1].log_likelihood(POSES)
    np.testing.assert_allclose(both.log_likelihood(POSES), expected, rtol=0, atol=1e-12)
    assert (both.sensor, both.count, both.alpha) == ("lidar", 3, 0.5)
    assert both.log_peak == pytest.approx(parts[0].log_peak + parts[1].log_peak)


def test_beams_are_told_apart_for_the_latest_of_several_readings() -> None:
    parts = [LIDAR.measure(scan_of(ranges), np.eye(4)) for ranges in ([1.0], [0.5, 0.7], [0.4, 0.6, 0.8])]
    for some in (parts, parts[:2], parts[:1]):
        assert combine(LIDAR, some).each is some[-1].each
    assert combine(LIDAR, []).each is None


def test_no_reading_weighs_nothing() -> None:
    nothing = combine(CAMERA, [])
    assert nothing.log_likelihood(POSES).tolist() == [0.0, 0.0, 0.0]
    assert (nothing.count, nothing.log_peak, nothing.alpha) == (0, 0, 0.25)


def test_what_has_no_temperature_of_its_own_is_not_tempered() -> None:
    scan, seen = scan_of([1.0]), sightings(0, ["a"], level(0.0))
    field, bearing = LIDAR.model, CAMERA.model
    bare = [Lidar("lidar", field, BeamSelection()).measure(scan, np.eye(4))]
    bare += [Camera("vision", bearing, CAMERA.landmarks).measure(seen, np.eye(4))]
    caster = lidar_entry("beam").make(ROOM, BeamParameters(), distance_field.compute, NUMPY, 1)
    bare += [field.measure("lidar", SOME), caster.measure("lidar", SOME)]
    bare += [bearing.measure("vision", observe(seen, np.eye(4), CAMERA.landmarks))]
    bare += [Measurement("any", lambda poses: poses[:, 0], 1, 0.0)]
    assert [one.alpha for one in bare] == [1.0] * 6
