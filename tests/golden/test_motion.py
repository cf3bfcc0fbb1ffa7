"""Motion models of nav2_amcl, pair by pair of odometry poses.

Where the differential drive differs on purpose: nav2 gives moves below 1 cm no first turn, so that they go straight
ahead whichever way the robot went: the 30 pairs ``below_1cm``, where ours follow the odometry. Pairs that turn in place
come with moves of some 1e-16 m, in whose direction ours lays the noise and nav2 does not. Turns beyond 90°
are as certain to nav2 as what they lack to half a turn: ``turn_noise`` = folded.
"""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters, decompose
from mclcli.motion.omnidirectional import OmnidirectionalMotion, OmnidirectionalParameters
from tests.data import golden

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.motion import MotionModel
    from tests.golden.conftest import Note

alpha_sets = pytest.mark.parametrize("alphas", ["all_0.2", "distinct"])


@pytest.fixture(scope="module")
def data() -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(golden("motion.json").read_text())
    assert len(loaded["kind"]) == 200
    return loaded


def increments(data: dict[str, Any]) -> FloatArray:
    """The odometry's increments (200, 3) in the frame of the base."""
    return se2.between(data["odom_old"], data["odom_new"])


def moved(model: MotionModel, data: dict[str, Any], normals: FloatArray | None = None) -> FloatArray:
    """Where the particle of each pair goes (200, 3)."""
    draws = np.zeros((200, 3)) if normals is None else normals
    steps = zip(np.array(data["particle"]), increments(data), draws, strict=True)
    return np.array([model.sample(pose[None], step, z[None])[0] for pose, step, z in steps])


def errors(found: FloatArray, expected: list[list[float]]) -> FloatArray:
    """Largest difference (200,) of each pair; nav2 does not wrap yaw."""
    difference = found - np.array(expected)
    difference[:, 2] = se2.wrap(difference[:, 2])
    largest: FloatArray = np.abs(difference).max(axis=1)
    return largest


def differential(data: dict[str, Any], alphas: str) -> DifferentialMotion:
    """The drive as nav2 has it."""
    a1, a2, a3, a4, _ = data["alphas"][alphas]
    return DifferentialMotion(DifferentialParameters(a1, a2, a3, a4, turn_noise="folded", noise_scaling="step"))


def omnidirectional(data: dict[str, Any], alphas: str) -> OmnidirectionalMotion:
    """The drive as nav2 has it."""
    a1, a2, a3, a4, a5 = data["alphas"][alphas]
    return OmnidirectionalMotion(OmnidirectionalParameters(a1, a2, a3, a4, a5, noise_scaling="step"))


@alpha_sets
def test_noise_of_the_differential_drive(note: Note, data: dict[str, Any], alphas: str) -> None:
    model = differential(data, alphas)
    found = np.array([model.noise_std(*decompose(step)) for step in increments(data)])
    worst = float(np.abs(found - data["differential"][alphas]["noise_std"]).max())
    assert note("motion.json", "differential, noise", worst, found.size) <= 1e-12


@alpha_sets
def test_noise_of_full_turns_is_theirs_up_to_a_quarter(data: dict[str, Any], alphas: str) -> None:
    model = DifferentialMotion(dataclasses.replace(differential(data, alphas).parameters, turn_noise="full"))
    steps, expected = increments(data), data["differential"][alphas]["noise_std"]
    for step, theirs in zip(steps, expected, strict=True):
        rot1, trans, rot2 = decompose(step)
        ours = model.noise_std(rot1, trans, rot2)
        last = rot2 if abs(trans) >= 0.01 else float(se2.wrap(rot1 + rot2))
        if abs(last) <= math.pi / 2:
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)
        else:
            assert ours[2] > theirs[2]


def test_the_differential_drive_without_noise(note: Note, data: dict[str, Any]) -> None:
    theirs = data["differential"]["particle_after_noise_free"]
    ours = moved(DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.0, 0.0)), data)
    found = errors(ours, theirs)
    differ = found > 1e-12
    note("motion.json", "differential, poses without noise, steps from 1 cm", float(found[~differ].max()), 3 * 170)
    assert {kind for kind, d in zip(data["kind"], differ, strict=True) if d} == {"below_1cm"}
    assert differ.sum() == 30
    for i in np.flatnonzero(differ):  # straight ahead there, where the odometry says here
        x, y, yaw = data["particle"][i]
        distance = data["differential"]["delta_trans"][i]
        np.testing.assert_allclose(
            theirs[i][:2], [x + distance * math.cos(yaw), y + distance * math.sin(yaw)], atol=1e-12
        )
    assert errors(ours, se2.compose(data["particle"], increments(data)).tolist()).max() < 1e-12


@alpha_sets
def test_the_differential_drive_with_noise(note: Note, data: dict[str, Any], alphas: str) -> None:
    trans = np.array([decompose(step)[1] for step in increments(data)])
    normals = -np.array(data["standard_normals"])  # nav2 subtracts its noise
    normals[trans < 0.0, 1] *= -1.0  # and calls a move backwards a positive one after half a turn
    differ = errors(
        moved(differential(data, alphas), data, normals), data["differential"][alphas]["particle_after_with_normals"]
    )
    small = (np.abs(trans) < 0.0099) & (trans != 0.0)
    worst, numbers = float(differ[~small].max()), 3 * int((~small).sum())
    assert note("motion.json", "differential, poses with noise, steps from 1 cm", worst, numbers) < 1e-12
    assert {kind for kind, s in zip(data["kind"], small, strict=True) if s} == {"below_1cm", "rotate_in_place"}
    assert (differ[small] > 1e-9).sum() > 30


@alpha_sets
def test_noise_of_the_omnidirectional_drive(note: Note, data: dict[str, Any], alphas: str) -> None:
    model = omnidirectional(data, alphas)
    found = np.array([model.noise_std(step) for step in increments(data)])
    worst = float(np.abs(found - data["omni"][alphas]["noise_std"]).max())
    assert note("motion.json", "omnidirectional, noise", worst, found.size) <= 1e-12


def test_the_omnidirectional_drive_without_noise(note: Note, data: dict[str, Any]) -> None:
    model = OmnidirectionalMotion(OmnidirectionalParameters(0.0, 0.0, 0.0, 0.0, 0.0))
    worst = float(errors(moved(model, data), data["omni"]["particle_after_noise_free"]).max())
    assert note("motion.json", "omnidirectional, poses without noise", worst, 600) < 1e-12


@alpha_sets
def test_the_omnidirectional_drive_with_noise(note: Note, data: dict[str, Any], alphas: str) -> None:
    """Without a move nav2 lays the noise along the odometry frame's x axis; it is alike in all directions: turned."""
    normals = np.array(data["standard_normals"])
    for i, step in enumerate(increments(data)):
        if np.hypot(step[0], step[1]) < 1e-12:
            ours = math.atan2(step[1], step[0]) if step[:2].any() else 0.0
            angle = data["omni"]["delta_bearing"][i] - ours
            along, across = normals[i, 0], normals[i, 2]
            normals[i, 0] = along * math.cos(angle) + across * math.sin(angle)
            normals[i, 2] = across * math.cos(angle) - along * math.sin(angle)
    found = moved(omnidirectional(data, alphas), data, normals)
    worst = float(errors(found, data["omni"][alphas]["particle_after_with_normals"]).max())
    assert note("motion.json", "omnidirectional, poses with noise", worst, 600) < 1e-12
