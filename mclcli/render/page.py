"""What stands around a map: title, axes, legend, scale bar, colour bar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final

import numpy as np
from PIL import Image, ImageDraw

from mclcli.render import lettering, marks, palette, scales
from mclcli.render.canvas import axis_step
from mclcli.render.lettering import BODY, SMALL, SUBTITLE, TITLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mclcli.render.canvas import MapCanvas, View

Symbol = Literal["line", "dashes", "ramp", "dots", "ring", "arrow", "cells", "ellipse"]

_PAD = 22
_SWATCH = (34, 20)
_ROW = 26
_BAR_WIDTH, _BAR_HEIGHT = 14, 300


@final
@dataclass(frozen=True, slots=True)
class LegendItem:
    """One entry of the legend: a symbol in a colour, and what it stands for."""

    symbol: Symbol
    text: str
    color: palette.Color = palette.INK


@final
@dataclass(frozen=True, slots=True, eq=False)
class ColorBar:
    """What the colours mean: ``heading`` above the bar, ``colors`` (K, 3) from its foot to its top.

    ``ticks`` are (height as a fraction from the foot, text); ``marked`` heights get a line across the bar.
    """

    heading: str
    colors: NDArray[np.uint8]
    ticks: tuple[tuple[float, str], ...]
    marked: tuple[float, ...] = ()


def linear_ticks(low: float, high: float, count: int = 6) -> tuple[tuple[float, str], ...]:
    """Ticks at round values between low and high for a colour bar that runs from one to the other."""
    if not high > low:
        return ((0.5, f"{low:.6g}"),)
    step = scales.round_up((high - low) / count)
    return tuple(((v - low) / (high - low), scales.label(v, step)) for v in scales.ticks(low, high, step))


@final
@dataclass(frozen=True, slots=True)
class _Layout:
    """Where things stand on the page [px]: the panel's corner and size, the page's size, the rows of the legend."""

    left: int
    top: int
    panel: tuple[int, int]
    page: tuple[int, int]
    rows: tuple[tuple[LegendItem, ...], ...]

    @property
    def right(self) -> int:
        """Where the panel ends, to the right."""
        return self.left + self.panel[0]

    @property
    def bottom(self) -> int:
        """Where the panel ends, below."""
        return self.top + self.panel[1]


def compose(
    canvas: MapCanvas, *, title: str, subtitle: str, legend: Sequence[LegendItem] = (), bar: ColorBar | None = None
) -> Image.Image:
    """Finish a picture: the canvas at its final size on a page with everything that explains it.

    The RGB image's ``info["pixel_from_map"]`` is (scale [px/m], left, top): map point (x, y) lies at pixel
    (left + scale·x, top − scale·y), pixel i covering [i, i + 1).
    """
    title, subtitle = lettering.printable(title), lettering.printable(subtitle)
    view = canvas.view
    layout = _lay_out(view, legend, bar, subtitle=bool(subtitle))
    page = Image.new("RGB", layout.page, palette.PAGE)
    page.paste(canvas.image.reduce(marks.FINE), (layout.left, layout.top))
    _draw_titles(page, layout, title, subtitle)
    _draw_axes(page, layout, view)
    _draw_legend(page, layout)
    _draw_scale_bar(page, layout, view)
    if bar is not None:
        _draw_bar(page, layout, bar)
    corner = (layout.left - view.scale * view.left, layout.top + view.scale * view.top)
    page.info["pixel_from_map"] = (view.scale, *corner)
    return page


def _tick_labels(low: float, high: float, step: float) -> list[tuple[float, str]]:
    return [(value, scales.label(value, step)) for value in scales.ticks(low, high, step)]


def tick_step(view: View) -> float:
    """Distance of the ticks [m] of both axes, such that the labels of the x axis keep apart."""
    step = axis_step(view, 0.0)
    widest = max((lettering.width_of(t, SMALL) for _, t in _tick_labels(view.left, view.right, step)), default=0.0)
    return axis_step(view, widest)


def _lay_out(view: View, legend: Sequence[LegendItem], bar: ColorBar | None, *, subtitle: bool) -> _Layout:
    labels = [text for _, text in _tick_labels(view.bottom, view.top, tick_step(view))]
    left = _PAD + 10 + round(max((lettering.width_of(text, SMALL) for text in labels), default=0.0))
    right = _PAD + 22
    if bar is not None:
        texts = [_BAR_WIDTH + 10 + lettering.width_of(text, SMALL) for _, text in bar.ticks]
        right = _PAD + 16 + round(max([*texts, *(lettering.width_of(t, SMALL) for t in bar.heading.split("\n"))]))
    top = _PAD + 28 + (26 if subtitle else 0) + 32
    rows = _legend_rows(legend, room=view.width - _scale_bar_room(view))
    bottom = 38 + _ROW * max(1, len(rows)) + _PAD
    page = (left + view.width + right, top + view.height + bottom)
    return _Layout(left, top, (view.width, view.height), page, rows)


def _item_width(item: LegendItem) -> int:
    return _SWATCH[0] + 8 + round(lettering.width_of(lettering.printable(item.text), BODY)) + 24


def _legend_rows(legend: Sequence[LegendItem], room: float) -> tuple[tuple[LegendItem, ...], ...]:
    rows: list[list[LegendItem]] = []
    used = room
    for item in legend:
        if not rows or used + _item_width(item) > room:
            rows.append([])
            used = 0.0
        rows[-1].append(item)
        used += _item_width(item)
    return tuple(tuple(row) for row in rows)


def _draw_titles(page: Image.Image, layout: _Layout, title: str, subtitle: str) -> None:
    room = layout.page[0] - 2 * _PAD
    baseline = _PAD + 22
    lettering.write_bold(page, (_PAD, baseline), lettering.shorten(title, TITLE, room), TITLE, palette.INK)
    short = lettering.shorten(subtitle, SUBTITLE, room)
    lettering.write(page, (_PAD, baseline + 27), short, SUBTITLE, palette.QUIET)


def _draw_axes(page: Image.Image, layout: _Layout, view: View) -> None:
    """Frame, ticks and labels in metres of the map frame."""
    draw, step = ImageDraw.Draw(page), tick_step(view)
    edge = (layout.left - 1, layout.top - 1, layout.right, layout.bottom)
    draw.rectangle(edge, outline=palette.FRAME)
    for x, text in _tick_labels(view.left, view.right, step):
        at = layout.left + int((x - view.left) * view.scale)
        draw.line((at, edge[3], at, edge[3] + 5), fill=palette.FRAME)
        lettering.write(page, (at + 0.5, edge[3] + 8), text, SMALL, palette.QUIET, "ma")
    for y, text in _tick_labels(view.bottom, view.top, step):
        at = layout.top + int((view.top - y) * view.scale)
        draw.line((edge[0] - 5, at, edge[0], at), fill=palette.FRAME)
        lettering.write(page, (edge[0] - 8, at + 0.5), text, SMALL, palette.QUIET, "rm")
    lettering.write(page, (edge[0], edge[1] - 8), "y [m]", SMALL, palette.QUIET, "ms")
    lettering.write(page, (edge[2] + 8, edge[3]), "x [m]", SMALL, palette.QUIET, "lm")


def _draw_legend(page: Image.Image, layout: _Layout) -> None:
    y = layout.bottom + 38
    for row in layout.rows:
        x = layout.left
        for item in row:
            page.paste(_swatch(item), (x, y))
            text = lettering.printable(item.text)
            lettering.write(page, (x + _SWATCH[0] + 8, y + _SWATCH[1] // 2), text, BODY, palette.INK, "lm")
            x += _item_width(item)
        y += _ROW


def _swatch(item: LegendItem) -> Image.Image:
    """Small picture (34 × 20 px) of a legend symbol."""
    width, height = _SWATCH
    sheet = Image.new("RGB", (width * marks.FINE, height * marks.FINE), palette.PAGE)
    middle = np.array([width / 2, height / 2])
    line = middle + np.stack([np.linspace(-15, 15, 61), np.zeros(61)], axis=-1)
    match item.symbol:
        case "line":
            marks.stroke(sheet, line, item.color, 3.0)
        case "dashes":
            marks.stroke_dashed(sheet, line, item.color, 1.7)
        case "ramp":
            marks.stroke_ramp(sheet, line, palette.ramp("time", 61), 3.0)
        case "dots":
            spots = middle + np.array([[-11, 3], [-6, -3], [-2, 2], [2, -2], [4, 4], [8, -1], [12, 3], [-1, -6]])
            marks.soft_dots(sheet, spots, np.full(len(spots), 0.75), item.color)
        case "ring":
            marks.disc(sheet, middle, 6.0, palette.HALO, item.color)
        case "arrow":
            marks.arrow(sheet, middle, 0.0, item.color, size=9.0)
        case "cells":
            ImageDraw.Draw(sheet).rectangle((8 * 3, 4 * 3, 26 * 3, 16 * 3), fill=item.color)
        case "ellipse":
            turn = np.linspace(0.0, 2.0 * np.pi, 61)
            marks.stroke(sheet, middle + np.stack([12 * np.cos(turn), 6 * np.sin(turn)], axis=-1), item.color, 1.6)
    return sheet.reduce(marks.FINE)


def scale_bar_length(view: View) -> float:
    """Round length [m] of the scale bar: at most a sixth of the picture's width."""
    return scales.round_down(view.width / 6 / view.scale)


def _scale_bar_room(view: View) -> float:
    return scale_bar_length(view) * view.scale + 70.0


def _draw_scale_bar(page: Image.Image, layout: _Layout, view: View) -> None:
    """Bar in two halves, the first filled, with its length in metres."""
    draw, length = ImageDraw.Draw(page), scale_bar_length(view)
    text = f"{length:g} m"
    right = layout.right - round(lettering.width_of(text, SMALL)) - 8
    left, y = right - round(length * view.scale), layout.bottom + 48
    draw.rectangle((left, y - 3, right, y + 2), fill=palette.HALO, outline=palette.INK)
    draw.rectangle((left, y - 3, (left + right) // 2, y + 2), fill=palette.INK)
    lettering.write(page, (right + 8, y), text, SMALL, palette.INK, "lm")


def _draw_bar(page: Image.Image, layout: _Layout, bar: ColorBar) -> None:
    """Colour bar at the panel's upper right, its heading above it."""
    x, y = layout.right + 16, layout.top + 6
    for line in bar.heading.split("\n"):
        lettering.write(page, (x, y), line, SMALL, palette.QUIET, "ls")
        y += 16
    y -= 6
    strip = Image.fromarray(np.ascontiguousarray(bar.colors[::-1, np.newaxis, :]))
    page.paste(strip.resize((_BAR_WIDTH, _BAR_HEIGHT), Image.Resampling.BILINEAR), (x, y))
    draw = ImageDraw.Draw(page)
    draw.rectangle((x - 1, y - 1, x + _BAR_WIDTH, y + _BAR_HEIGHT), outline=palette.FRAME)
    for height in bar.marked:
        at = y + round((1.0 - height) * (_BAR_HEIGHT - 1))
        draw.line((x, at, x + _BAR_WIDTH - 1, at), fill=palette.HALO)
    for height, text in bar.ticks:
        at = y + round((1.0 - height) * (_BAR_HEIGHT - 1))
        draw.line((x + _BAR_WIDTH + 1, at, x + _BAR_WIDTH + 4, at), fill=palette.FRAME)
        lettering.write(page, (x + _BAR_WIDTH + 9, at + 0.5), text, SMALL, palette.INK, "lm")
