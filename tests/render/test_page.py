from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from mclcli.render import lettering, marks, page, palette, scales
from mclcli.render.canvas import open_canvas
from mclcli.render.page import LegendItem
from mclcli.render.track import draw_track
from mclcli.world.occupancy import OccupancyGrid
from tests.data import shared
from tests.render.pictures import closeness, color_at, pixel, room

NOWHERE = np.zeros((0, 3))


def margin_of(picture: Image.Image) -> int:
    """Least distance [px] of anything drawn from the edge of the page."""
    drawn = np.abs(np.asarray(picture, dtype=int) - np.array(palette.PAGE)).max(axis=2) > 8
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    return int(min(rows[0], columns[0], drawn.shape[0] - 1 - rows[-1], drawn.shape[1] - 1 - columns[-1]))


@pytest.mark.parametrize("title", ["", "Office", "A title that is much longer than any page is wide " * 20])
@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-5_000_000.0, 60_000.0, 0.4)])
@pytest.mark.parametrize("shape", [(60, 80), (3, 900), (900, 3)])
def test_nothing_reaches_the_edge_of_the_page(
    title: str, origin: tuple[float, float, float], shape: tuple[int, int]
) -> None:
    canvas = open_canvas(room(*shape, 0.1, origin), np.zeros((0, 2)))
    legend = [LegendItem("dots", f"entry {i} of the legend, with words") for i in range(9)]
    bar = page.ColorBar("log-likelihood\n[nats]", palette.ramp("heat"), page.linear_ticks(-123456.0, 0.0))
    picture = page.compose(canvas, title=title, subtitle=title, legend=legend, bar=bar)
    assert margin_of(picture) >= 8


def test_labels_of_far_origins_do_not_touch() -> None:
    canvas = open_canvas(room(origin=(-5_000_000.0, 60_000.0, 0.0)), np.zeros((0, 2)))
    step = page.tick_step(canvas.view)
    widest = max(
        lettering.width_of(scales.label(x, step), lettering.SMALL)
        for x in scales.ticks(canvas.view.left, canvas.view.right, step)
    )
    assert widest + 20.0 < step * canvas.view.scale


def test_ticks_stand_at_the_coordinates_of_the_map() -> None:
    picture = draw_track(room(), NOWHERE, title="t")
    canvas = open_canvas(room(), np.zeros((0, 2)))
    below = round(pixel(picture, 0.0, canvas.view.bottom)[1]) + 3
    row = closeness(picture, palette.FRAME)[below]
    found = np.flatnonzero(row > 0.9) + 0.5
    step = page.tick_step(canvas.view)
    expected = [pixel(picture, x, 0.0)[0] for x in scales.ticks(canvas.view.left, canvas.view.right, step)]
    assert found == pytest.approx(expected, abs=0.51)


@pytest.mark.parametrize(("height", "width", "resolution"), [(60, 80, 0.1), (1000, 2000, 0.05), (10, 10, 0.05)])
def test_the_scale_bar_is_as_long_as_it_says(height: int, width: int, resolution: float) -> None:
    canvas = open_canvas(room(height, width, resolution), np.zeros((0, 2)))
    length = page.scale_bar_length(canvas.view)
    assert f"{length:.0e}"[0] in "125"
    picture = page.compose(canvas, title="t", subtitle="")
    foot = np.asarray(picture)[round(pixel(picture, 0.0, canvas.view.bottom)[1]) + 38 :]
    dark = (foot == np.array(palette.INK)).all(axis=2)
    longest = max(int(row.sum()) for row in dark)  # the outline, above and below the halves
    assert longest - 1 == pytest.approx(length * canvas.view.scale, abs=8)
    assert 0.06 < length * canvas.view.scale / canvas.view.width <= 1 / 6


@pytest.mark.parametrize(
    ("value", "up", "down"), [(0.3, 0.5, 0.2), (2.0, 2.0, 2.0), (7.1, 10.0, 5.0), (1300, 2000, 1000)]
)
def test_round_numbers(value: float, up: float, down: float) -> None:
    assert scales.round_up(value) == pytest.approx(up)
    assert scales.round_down(value) == pytest.approx(down)


def test_ticks_and_their_labels() -> None:
    assert scales.ticks(-0.31, 0.2, 0.1) == pytest.approx([-0.3, -0.2, -0.1, 0.0, 0.1, 0.2])
    assert [scales.label(v, 0.1) for v in (-0.3, -0.0, 1e-12, 2.0)] == ["-0.3", "0.0", "0.0", "2.0"]
    assert [scales.label(v, 50.0) for v in (-50.0, 5_400_000.0)] == ["-50", "5400000"]
    assert page.linear_ticks(10.0, 70.0) == tuple(((v - 10) / 60, str(v)) for v in range(10, 71, 10))
    assert page.linear_ticks(3.0, 3.0) == ((0.5, "3"),)


def test_a_legend_is_broken_into_rows_that_fit() -> None:
    legend = [LegendItem("line", f"entry number {i}") for i in range(12)]
    tall = page.compose(open_canvas(room(), np.zeros((0, 2))), title="t", subtitle="", legend=legend)
    flat = page.compose(open_canvas(room(), np.zeros((0, 2))), title="t", subtitle="", legend=legend[:2])
    assert tall.size[0] == flat.size[0]
    assert tall.size[1] > flat.size[1] + 20


@pytest.mark.parametrize("symbol", ["line", "dashes", "ramp", "dots", "ring", "arrow", "cells", "ellipse"])
def test_every_symbol_is_drawn(symbol: page.Symbol) -> None:
    canvas = open_canvas(room(), np.zeros((0, 2)))
    bare = page.compose(canvas, title="t", subtitle="", legend=[LegendItem("line", " ", palette.PAGE)])
    drawn = page.compose(canvas, title="t", subtitle="", legend=[LegendItem(symbol, " ", palette.CRIMSON)])
    assert (np.asarray(bare) != np.asarray(drawn)).any(axis=2).sum() > 20


def test_text_is_one_line_that_the_typeface_can_show() -> None:
    assert lettering.printable("a\n\tb\x1b[31m\u202e") == "a b?[31m?"
    assert lettering.printable("σ − × 机器人") == "sigma - x ???"
    assert lettering.printable("range ≥ 2°, naïve") == "range ? 2°, naive"
    assert len(lettering.printable("x" * 10_000)) == 400


def test_text_is_shortened_to_the_room_there_is() -> None:
    text = "The quick brown fox jumps over the lazy dog"
    short = lettering.shorten(text, 20, 150.0)
    assert short.endswith("…")
    assert text.startswith(short[:-1])
    assert 100.0 < lettering.width_of(short, 20) <= 150.0
    assert lettering.shorten(text, 20, 1e4) == text


def test_dashes_have_their_length_and_follow_the_line() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 30.0]])
    pieces = list(marks.dashes(line, on=8.0, off=5.0))
    assert [float(np.hypot(*np.diff(p, axis=0).T).sum()) for p in pieces] == pytest.approx([8.0, 8.0, 8.0, 1.0])
    assert pieces[1][0].tolist() == [10.0, 3.0]
    assert not list(marks.dashes(line[:1], on=8.0, off=5.0))
    assert not list(marks.dashes(np.zeros((5, 2)), on=8.0, off=5.0))


@pytest.mark.parametrize("name", ["time", "heat", "depth"])
def test_ramps_change_their_lightness_evenly_and_stand_out_from_paper(name: palette.RampName) -> None:
    colors = palette.ramp(name, 64) / 255.0
    linear = np.where(colors > 0.04045, ((colors + 0.055) / 1.055) ** 2.4, colors / 12.92)
    lightness = 116.0 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16.0  # CIE 1976 L*
    steps = np.diff(lightness)
    assert (steps > 0).all() or (steps < 0).all()
    assert np.abs(steps).max() < 3.0 * np.abs(steps).mean()
    if name == "time":
        assert lightness.max() < 82.0  # a thin line on paper of 97


def test_a_building_of_thin_walls_is_legible() -> None:
    with Image.open(shared("intel/intel.pgm")) as scan:
        gray = np.array(scan)[::-1]
    cells = np.full(gray.shape, -1, dtype=np.int8)
    cells[gray > 250], cells[gray < 5] = 0, 100
    grid = OccupancyGrid(cells, 0.05, np.array([-11.55, -24.2, 0.0]))
    picture = draw_track(grid, NOWHERE, title="Intel Research Lab")
    rng = np.random.default_rng(0)
    walls = np.argwhere(cells == 100)[rng.integers(0, (cells == 100).sum(), 200)]
    amount = closeness(picture, palette.WALL)
    for row, column in walls:
        x, y = pixel(picture, *grid.to_map([column + 0.5, row + 0.5])).astype(int)
        assert amount[y - 1 : y + 2, x - 1 : x + 2].max() > 0.4
    assert color_at(picture, 0.52, 0.31) == palette.FREE
