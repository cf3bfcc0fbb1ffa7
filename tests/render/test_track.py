from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mclcli.render import palette
from mclcli.render.track import draw_track
from tests.render.pictures import closeness, color_at, middle_of, near, pixel, room

DRIVE = np.stack([np.linspace(1.0, 7.0, 61), np.full(61, 3.0), np.zeros(61)], axis=-1)
STAMPS = np.linspace(10.0, 70.0, 61)


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_the_start_lies_where_the_first_pose_is(yaw: float) -> None:
    drive = DRIVE @ np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    picture = draw_track(room(origin=(0.0, 0.0, yaw)), drive, title="t")
    expected = pixel(picture, *drive[0, :2])
    found = middle_of(closeness(picture, palette.INK), expected, 10)
    assert np.abs(found - expected).max() <= 0.5


def test_the_line_lies_on_the_poses() -> None:
    picture = draw_track(room(), DRIVE, title="t")
    amount = closeness(picture, palette.TEAL)
    for x in np.linspace(1.5, 6.5, 11):
        expected = pixel(picture, x, 3.0)
        assert abs(middle_of(amount, expected, 8)[1] - expected[1]) <= 0.5
        assert near(color_at(picture, x, 3.0), palette.TEAL)


@pytest.mark.parametrize("yaw", [0.0, 1.0, 3.0, -2.0])
def test_the_arrow_points_along_the_heading(yaw: float) -> None:
    picture = draw_track(room(), np.array([[4.0, 3.0, yaw]]), title="one")
    at = pixel(picture, 4.0, 3.0)
    amount = closeness(picture, palette.INK)
    ahead = at + 9.0 * np.array([np.cos(yaw), -np.sin(yaw)])
    behind = at - 11.0 * np.array([np.cos(yaw), -np.sin(yaw)])
    assert amount[int(ahead[1]), int(ahead[0])] > 0.9
    assert amount[int(behind[1]), int(behind[0])] < 0.1
    assert np.hypot(*(middle_of(amount, at, 17) - at)) < 4.0


def test_time_colors_the_line_from_its_start_to_its_end() -> None:
    picture = draw_track(room(), DRIVE, stamps_s=STAMPS, title="t")
    ramp = palette.ramp("time")
    for x in (2.0, 4.0, 6.0):
        assert near(color_at(picture, x, 3.0), ramp[round((x - 1.0) / 6.0 * 255)], 20)


def test_the_line_breaks_between_segments() -> None:
    far = np.concatenate([DRIVE[:20], DRIVE[41:]])
    whole = draw_track(room(), far, title="t")
    parted = draw_track(room(), far, segments=np.repeat([0, 1], 20), title="t")
    assert near(color_at(whole, 4.23, 3.0), palette.TEAL)
    assert color_at(parted, 4.23, 3.0) == palette.FREE
    assert near(color_at(parted, 2.0, 3.0), palette.TEAL)


def test_a_band_marks_where_the_robot_was_lost() -> None:
    lost = np.zeros(61, np.bool_)
    lost[20:31] = True
    lost[50] = True
    picture, plain = (draw_track(room(), DRIVE, lost=marked, title="t") for marked in (lost, np.zeros(61, np.bool_)))
    beside = 0.0
    for i, marked in enumerate(lost.tolist()):
        x, y = pixel(picture, DRIVE[i, 0], 3.0)
        changed = picture.getpixel((int(x), int(y) - 5)) != plain.getpixel((int(x), int(y) - 5))
        beside += changed
        assert changed or not marked
    assert beside <= 20
    with pytest.raises(ValueError, match="lost"):
        draw_track(room(), DRIVE, lost=lost[1:], title="t")


def test_the_reference_is_dashed_beneath_the_track() -> None:
    picture = draw_track(room(), DRIVE, truth=DRIVE + np.array([0.0, 1.0, 0.0]), title="t")
    at = pixel(picture, 1.2, 4.0), pixel(picture, 6.8, 4.0)
    row = closeness(picture, palette.CRIMSON)[int(at[0][1]), int(at[0][0]) : int(at[1][0])]
    assert 0.5 < (row > 0.5).mean() < 0.75
    covered = draw_track(room(), DRIVE, truth=DRIVE, title="t")
    assert near(color_at(covered, 4.0, 3.0), palette.TEAL)


def test_the_cloud_lies_around_its_particles_and_follows_their_weights() -> None:
    rng = np.random.default_rng(0)
    left = np.array([2.0, 1.5, 0.0]) + rng.normal(0.0, 0.05, (300, 3))
    right = np.array([6.0, 1.5, 0.0]) + rng.normal(0.0, 0.05, (300, 3))
    weights = np.repeat([1.0, 1e-9], 300)
    picture = draw_track(room(), DRIVE, cloud=np.concatenate([left, right]), cloud_weights=weights, title="t")
    amount = closeness(picture, palette.AMBER)
    expected = pixel(picture, *left.mean(axis=0)[:2])
    assert np.abs(middle_of(amount, expected, 40) - expected).max() < 3.0
    x, y = pixel(picture, 6.0, 1.5).astype(int)
    assert amount[y - 4 : y + 5, x - 4 : x + 5].mean() < 0.3
    x, y = expected.astype(int)
    assert amount[y - 4 : y + 5, x - 4 : x + 5].mean() > 0.8


def test_a_single_particle_is_a_dot_at_its_place() -> None:
    cloud = np.array([[2.03, 1.57, 0.0]])
    picture = draw_track(room(), DRIVE, cloud=cloud, title="t")
    expected = pixel(picture, *cloud[0, :2])
    paper = np.asarray(picture, dtype=np.float64)[..., 2]
    found = middle_of(np.clip(palette.FREE[2] - paper, 0.0, None), expected, 6)
    assert np.abs(found - expected).max() <= 0.5


@pytest.mark.parametrize("stamps", [None, np.zeros(0)])
def test_without_poses_there_is_still_a_map(stamps: Any) -> None:
    picture = draw_track(room(), np.zeros((0, 3)), stamps_s=stamps, title="nothing yet")
    assert color_at(picture, 0.05, 3.03) == palette.WALL
    assert color_at(picture, 4.03, 3.03) == palette.FREE


def test_one_pose_with_one_stamp_is_enough() -> None:
    picture = draw_track(room(), DRIVE[:1], stamps_s=STAMPS[:1], truth=DRIVE[:1], cloud=DRIVE[:1], title="one")
    assert near(color_at(picture, 1.0, 3.0), palette.INK)


def test_poses_far_away_are_cut_off_at_the_edge() -> None:
    drive = np.array([[1.0, 3.0, 0.0], [1e12, 3.0, 0.0]])
    picture = draw_track(room(), drive, truth=drive, title="lost")
    assert near(color_at(picture, 5.0, 3.0), palette.TEAL)
    assert max(picture.size) < 1400


def test_the_same_input_gives_the_same_picture() -> None:
    cloud = np.random.default_rng(1).normal(3.0, 0.5, (500, 3))
    first, second = (draw_track(room(), DRIVE, stamps_s=STAMPS, cloud=cloud, title="t") for _ in range(2))
    assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("stamps_s", np.zeros(3)),
        ("stamps_s", np.full(61, np.nan)),
        ("segments", np.zeros(3, dtype=np.int64)),
        ("truth", np.zeros((4, 2))),
        ("cloud", np.full((4, 3), np.inf)),
        ("cloud_weights", np.ones(2)),
    ],
)
def test_what_does_not_fit_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"{name}: expected"):
        draw_track(room(), DRIVE, title="t", **{name: value})
