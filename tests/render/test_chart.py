"""Curves over time."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from mclcli.render import palette
from mclcli.render.chart import PANEL, Curve, Panel, draw_charts, stack
from mclcli.render.evaluation import Errors, draw_evaluation, floor_around
from tests.render.pictures import closeness, room

SECONDS = np.linspace(0.0, 10.0, 101)


def panel(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], **changes: object) -> Panel:
    return Panel("error [m]", (Curve(SECONDS, values, palette.TEAL),), **changes)  # type: ignore[arg-type]


def rows_of(picture: Image.Image, color: palette.Color) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    return np.flatnonzero((closeness(picture, color) > 0.5).any(axis=1))


def test_a_greater_value_stands_higher() -> None:
    high = rows_of(draw_charts([panel(np.where(SECONDS < 5, 0.5, 1.0))], width=800), palette.TEAL)
    low = rows_of(draw_charts([panel(np.where(SECONDS < 5, 0.5, 0.6))], width=800), palette.TEAL)
    assert high.max() - high.min() == pytest.approx(0.5 / 1.08 * PANEL, abs=4)
    assert low.max() - low.min() == pytest.approx(0.1 / 0.648 * PANEL, abs=4)


def test_a_rare_great_value_does_not_flatten_the_rest() -> None:
    values = np.where(SECONDS > 9.5, 30.0, np.where(SECONDS < 5, 0.02, 0.05))
    drawn = draw_charts([panel(values)], width=800)
    shown = np.asarray(closeness(drawn, palette.TEAL) > 0.5)
    early, late = (rows_of(drawn.crop((x, 0, x + 60, drawn.height)), palette.TEAL).mean() for x in (120, 500))
    assert early - late > 10  # 0.02 and 0.05 are told apart on a logarithmic axis
    assert shown.any()


def test_lines_break_where_pieces_do() -> None:
    kept = np.concatenate([np.arange(30), np.arange(71, 101)])
    curve = Curve(SECONDS[kept], np.ones(60), palette.TEAL, (kept > 50).astype(np.intp))
    drawn = draw_charts([Panel("error", (curve,))], width=800)
    covered = np.any(closeness(drawn, palette.TEAL) > 0.5, axis=0)
    middle = 78 + int(0.5 * (800 - 78 - 44))
    assert not covered[middle - 80 : middle + 80].any()
    assert covered[78 + 40]


def test_marked_time_is_shaded() -> None:
    plain, marked = (
        np.asarray(draw_charts([panel(np.ones(101), shades=shades, note="shaded: lost")], width=800), dtype=float)
        for shades in ((), ((2.0, 4.0),))
    )
    changed = (np.abs(plain - marked).max(axis=2) > 4).any(axis=0)
    edges = np.flatnonzero(changed)
    assert (edges.min() - 78) / 678 == pytest.approx(0.2, abs=0.01)
    assert (edges.max() - 78) / 678 == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("values", [np.zeros(1), np.array([1e-12]), np.array([5.0])])
def test_a_single_pose_makes_a_chart(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> None:
    drawn = draw_charts([Panel("error", (Curve(np.zeros(1), values, palette.TEAL),))], width=640)
    assert drawn.size[0] == 640
    assert rows_of(drawn, palette.TEAL).size > 0


def test_nothing_to_show_is_refused() -> None:
    with pytest.raises(ValueError, match="expected curves"):
        draw_charts([Panel("error", (Curve(np.zeros(0), np.zeros(0), palette.TEAL),))], width=640)


def test_a_stack_keeps_where_the_map_lies() -> None:
    upper, lower = Image.new("RGB", (30, 20)), Image.new("RGB", (40, 10))
    upper.info["pixel_from_map"] = (1.0, 2.0, 3.0)
    both = stack(upper, lower)
    assert (both.size, both.info["pixel_from_map"]) == ((40, 30), (1.0, 2.0, 3.0))


@pytest.mark.parametrize("count", [1, 2, 8])
def test_tracks_over_their_reference(count: int) -> None:
    poses = np.column_stack([np.linspace(1.0, 6.0, 101), np.full(101, 2.0), np.zeros(101)])
    errors = [0.3 * (i + 1) for i in range(count)]
    zeros = np.zeros(101)
    tracks = [Errors(f"t{e}", poses + np.array([0.0, e, 0.0]), SECONDS, zeros + e, zeros) for e in errors]
    drawn = draw_evaluation(room(), tracks, poses, levels=((0.5,), (0.2,)), title="tracks")
    assert (closeness(drawn, palette.CRIMSON) > 0.5).sum() > 200
    assert draw_evaluation(None, tracks, poses, title="tracks").height > 2 * PANEL


def test_floors_stay_small_however_far_tracks_run() -> None:
    grid = floor_around(np.array([[0.0, 0.0, 0.0], [3e5, 2e5, 0.0]]))
    assert grid.cells.size < 2_000_000
    assert grid.contains(np.array([3e5, 2e5]))
