"""From pixels to rays: lenses undone, and bearings through a camera's mount."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.geometry import pinhole, se3
from mclcli.records import CameraModel, LandmarkSightings
from mclcli.sensors.bearing import observe
from mclcli.world.landmarks import Landmarks
from tests.reference.camera import project

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray

FX, FY, CX, CY = 610.0, 605.0, 321.5, 238.25
K = np.array([[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]])
P = np.array([[580.0, 0.0, 318.0, -35.0], [0.0, 580.0, 241.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
LENSES: dict[str, tuple[str, Sequence[float]]] = {
    "none": ("", ()),
    "plumb_bob, barrel": ("plumb_bob", (-0.31, 0.12, 0.0012, -0.0007, -0.02)),
    "plumb_bob, pincushion": ("plumb_bob", (0.18, -0.05, -0.001, 0.002, 0.01)),
    "plumb_bob, four coefficients": ("plumb_bob", (-0.2, 0.05, 0.001, 0.0005)),
    "rational_polynomial": ("rational_polynomial", (2.1, 1.3, 0.0004, -0.0003, 0.09, 2.35, 1.75, 0.32)),
    "equidistant": ("equidistant", (-0.02, 0.004, -0.0011, 0.0002)),
    "equidistant, ideal": ("fisheye", ()),
}


def model(**changes: Any) -> CameraModel:
    fields: dict[str, Any] = {
        "stamp_ns": 0,
        "frame_id": "optical",
        "distortion_model": "plumb_bob",
        "distortion": np.zeros(5),
        "k": K,
        "r": np.eye(3),
        "p": P,
    }
    return CameraModel(**(fields | changes))


def unit(rays: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(rays, axis=1, keepdims=True)
    return rays / lengths


def view(reach: float = 0.6) -> FloatArray:
    """Directions over a field of view, the axis among them."""
    return unit(np.array([[x, y, 1.0] for x in np.linspace(-reach, reach, 9) for y in np.linspace(-0.5, 0.5, 7)]))


@pytest.mark.parametrize("lens", LENSES)
def test_rays_are_where_the_pixels_came_from(lens: str) -> None:
    kind, d = LENSES[lens]
    pixels = np.array([project(ray, kind, d, (FX, FY), (CX, CY)) for ray in view().tolist()])
    found = pinhole.rays(model(distortion_model=kind, distortion=np.array(d)), pixels, rectified=False)
    np.testing.assert_allclose(unit(found), view(), rtol=0, atol=1e-9)


def test_the_axis_points_forward_right_is_x_and_down_is_y() -> None:
    pixels = np.array([[CX, CY], [CX + FX, CY], [CX, CY + FY]])
    found = pinhole.rays(model(), pixels, rectified=False)
    np.testing.assert_allclose(found, [[0, 0, 1], [1, 0, 1], [0, 1, 1]], rtol=0, atol=1e-12)


def test_a_fisheye_sees_behind_itself() -> None:
    """Without coefficients the distance from the middle is the angle itself: at 2 rad the ray points backwards."""
    pixels = np.array([[CX + 2.0 * FX, CY], [CX, CY - 2.0 * FY]])
    found = pinhole.rays(model(distortion_model="equidistant", distortion=np.zeros(4)), pixels, rectified=False)
    expected = [[math.sin(2), 0, math.cos(2)], [0, -math.sin(2), math.cos(2)]]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("kind", "d"), [("plumb_bob", (-0.3, 0, 0, 0, 0)), ("equidistant", (-0.2, 0, 0, 0))])
def test_pixels_that_no_direction_leads_to_have_no_ray(kind: str, d: tuple[float, ...]) -> None:
    """x(1 − 0.3x²) rises to 0.703 only, θ(1 − 0.2θ²) to 0.861; further out the formulas fold over."""
    pixels = np.array([[CX + 0.65 * FX, CY], [CX + 0.9 * FX, CY], [CX + 3.0 * FX, CY], [CX - 30.0 * FX, CY]])
    found = pinhole.rays(model(distortion_model=kind, distortion=np.array(d)), pixels, rectified=False)
    assert np.isfinite(found).all(axis=1).tolist() == [True, False, False, False]


def test_a_radius_that_returns_beyond_a_fold_has_no_ray() -> None:
    """θ − 0.3θ³ + 0.04θ⁵ falls between √2 and √2.5; radius 0.88 is reached at 2 rad alone, beyond that."""
    folded = model(distortion_model="equidistant", distortion=np.array([-0.3, 0.04, 0.0, 0.0]))
    found = pinhole.rays(folded, np.array([[CX + 0.88 * FX, CY], [CX + 0.6 * FX, CY]]), rectified=False)
    assert np.isfinite(found).all(axis=1).tolist() == [False, True]


def test_rectified_pixels_go_through_the_projection_alone() -> None:
    wild = model(distortion=np.array([-0.3, 0.1, 0, 0, 0]), k=np.eye(3), r=np.diag([1.0, -1.0, -1.0]))
    found = pinhole.rays(wild, np.array([[318.0 + 290.0, 241.0 - 58.0]]), rectified=True)
    np.testing.assert_allclose(found, [[0.5, -0.1, 1.0]], rtol=0, atol=1e-12)


def test_raw_and_rectified_pixels_of_a_turned_camera_agree() -> None:
    """What image_proc does: a raw ray turned by R, then projected by P (its fourth column only shifts)."""
    turn = se3.from_rpy([0, 0, 0], 0.02, -0.03, 0.01)[:3, :3]
    kind, d = LENSES["plumb_bob, barrel"]
    lens = model(distortion=np.array(d), r=turn)
    raw = np.array([project(ray, kind, d, (FX, FY), (CX, CY)) for ray in view().tolist()])
    turned = view() @ turn.T
    flat = P[:, :3] @ (turned / turned[:, 2:]).T
    from_raw = pinhole.rays(lens, raw, rectified=False)
    np.testing.assert_allclose(unit(from_raw), unit(pinhole.rays(lens, flat[:2].T, rectified=True)), rtol=0, atol=1e-9)


def test_binning_and_a_region_of_interest_belong_to_the_published_image() -> None:
    full = np.array([[100.0, 60.0], [400.0, 300.0]])
    part = model(binning=(2, 3), offset=(40, 12))
    found = pinhole.rays(part, (full - [40, 12]) / [2, 3], rectified=False)
    np.testing.assert_allclose(found, pinhole.rays(model(), full, rectified=False), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "rectified", "said"),
    [
        ({}, False, ""),
        ({"k": np.zeros((3, 3))}, False, "not calibrated: K has no focal length"),
        ({"k": np.zeros((3, 3))}, True, ""),
        ({"p": np.zeros((3, 4))}, True, "not calibrated: P has no focal length"),
        ({"p": np.zeros((3, 4))}, False, ""),
        ({"k": np.full((3, 3), math.nan)}, False, "not calibrated"),
        ({"r": np.zeros((3, 3))}, False, ""),
        ({"r": np.diag([1.0, 1.0, -1.0])}, False, "R is no rotation"),
        ({"r": np.full((3, 3), math.inf)}, False, "R is no rotation"),
        ({"distortion_model": "unheard_of"}, False, ""),
        ({"distortion_model": "unheard_of", "distortion": np.ones(1)}, False, "model 'unheard_of' is not known"),
        ({"distortion_model": "unheard_of", "distortion": np.ones(1)}, True, ""),
        ({"distortion": np.r_[np.ones(8), np.zeros(6)]}, False, ""),
        ({"distortion": np.ones(12)}, False, "D is not a distortion of model plumb_bob"),
        ({"distortion": np.array([math.nan])}, False, "D is not a distortion of model plumb_bob"),
        ({"distortion_model": "equidistant", "distortion": np.ones(5)}, False, "not a distortion of model equidistant"),
    ],
)
def test_what_gives_no_rays_is_told(changes: dict[str, Any], rectified: bool, said: str) -> None:  # noqa: FBT001
    found = pinhole.problem(model(**changes), rectified=rectified)
    assert said in found
    assert bool(found) == bool(said)


OPTICAL = se3.from_rpy([0, 0, 0], -math.pi / 2, 0.0, -math.pi / 2)  # body x forward, y left, z up, from optical


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw"), [(0, 0, 0), (0, 0.5, 0), (0.4, 0, 0), (0.3, -0.6, 1.0), (math.pi, 0.2, -2.0)]
)
def test_bearings_through_a_tilted_mount_are_those_of_plain_trigonometry(roll: float, pitch: float, yaw: float) -> None:
    """A post stands at a known place; the pixel it appears at, through the mount, gives its direction on the map."""
    position = np.array([0.3, -0.1, 1.2])
    base_from_optical = se3.from_rpy(position, roll, pitch, yaw) @ OPTICAL
    lens = model(distortion=np.array(LENSES["plumb_bob, barrel"][1]))
    pixels = np.array([[100.0, 380.0], [500.0, 90.0], [CX, CY]])
    rays = pinhole.rays(lens, pixels, rectified=False)
    posts = position + 4.0 * (base_from_optical[:3, :3] @ unit(rays).T).T
    seen = LandmarkSightings(0, "optical", ("a", "b", "c"), rays)
    bearings = observe(seen, base_from_optical, Landmarks(seen.ids, posts))
    expected = [math.atan2(y - position[1], x - position[0]) for x, y, _ in posts.tolist()]
    np.testing.assert_allclose(bearings.angles, expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(bearings.origin, position[:2])


def test_a_pitched_camera_by_hand() -> None:
    """Looking down by 30°, a pixel 45° to the right of the middle: forward cos 30°, sideways 1, hence atan(1/cos 30°).

    Without the mount's pitch the answer would be 45°.
    """
    mount = se3.from_rpy([0, 0, 1.0], 0.0, math.radians(30.0), 0.0) @ OPTICAL
    rays = pinhole.rays(model(), np.array([[CX + FX, CY]]), rectified=False)
    seen = LandmarkSightings(0, "optical", ("a",), rays)
    bearings = observe(seen, mount, Landmarks(("a",), np.zeros((1, 3))))
    np.testing.assert_allclose(bearings.angles, [-math.atan2(1.0, math.cos(math.radians(30.0)))], rtol=0, atol=1e-12)
