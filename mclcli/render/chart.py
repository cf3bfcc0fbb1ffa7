"""Curves over time, one panel below the other, on a common axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np
from PIL import Image, ImageDraw

from mclcli.render import lettering, marks, palette, scales
from mclcli.render.lettering import BODY, SMALL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray

PANEL = 190
_LEFT, _RIGHT, _HEAD, _FOOT = 78, 44, 34, 52
_WIDE = 20.0  # the largest value over the median from which on a linear axis would hide the rest


@final
@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Values (N,) at ``seconds`` (N,), in order of time; the line breaks where ``pieces`` (N,) changes."""

    seconds: FloatArray
    values: FloatArray
    color: palette.Color
    pieces: NDArray[np.intp] | None = None
    width: float = 1.6


@final
@dataclass(frozen=True, slots=True)
class Panel:
    """One panel: what it shows, curves of magnitudes ≥ 0, levels to hold them against, stretches of time to mark.

    ``note`` says what the marks mean.
    """

    heading: str
    curves: tuple[Curve, ...]
    levels: tuple[float, ...] = ()
    shades: tuple[tuple[float, float], ...] = ()
    note: str = ""


@final
@dataclass(frozen=True, slots=True)
class _Axis:
    """From ``low`` at pixel 0 to ``high`` at pixel ``length``, logarithmic if ``log``."""

    low: float
    high: float
    length: int
    log: bool = False

    def at(self, values: FloatArray) -> FloatArray:
        """Pixels of values; what lies beyond the ends is put at them."""
        shown = np.clip(values, self.low, self.high)
        if self.log:
            return np.asarray(np.log(shown / self.low) / math.log(self.high / self.low) * self.length)
        return np.asarray((shown - self.low) / (self.high - self.low) * self.length)

    def ticks(self) -> list[tuple[float, str]]:
        """Round values with their texts."""
        if self.log:
            decades = range(round(math.log10(self.low)), round(math.log10(self.high)) + 1)
            return [(10.0**d, f"{10.0**d:g}") for d in decades]
        step = scales.round_up((self.high - self.low) * 62.0 / self.length)
        return [(value, scales.label(value, step)) for value in scales.ticks(self.low, self.high, step)]


def draw_charts(panels: Sequence[Panel], *, width: int, time_text: str = "time [s]") -> Image.Image:
    """Picture of panels, ``width`` pixels wide; every panel shows the same stretch of time.

    An axis of values starts at 0, or is logarithmic where the greatest value is more than 20 times the median.

    Raises
    ------
    ValueError
        If there is nothing to show.

    """
    seconds = [curve.seconds for panel in panels for curve in panel.curves if curve.seconds.size]
    if not seconds:
        raise ValueError("panels: expected curves with values")
    first, last = min(float(s[0]) for s in seconds), max(float(s[-1]) for s in seconds)
    time = _Axis(first, last if last > first else first + 1.0, width - _LEFT - _RIGHT)
    page = Image.new("RGB", (width, len(panels) * (PANEL + _HEAD) + _FOOT), palette.PAGE)
    for number, panel in enumerate(panels):
        top = number * (PANEL + _HEAD) + _HEAD
        _draw_panel(page, top, panel, time)
    _draw_time(page, len(panels) * (PANEL + _HEAD), time, time_text)
    return page


def stack(upper: Image.Image, lower: Image.Image) -> Image.Image:
    """Two pictures as one page, the lower one below; where the map's points lie is kept."""
    page = Image.new("RGB", (max(upper.width, lower.width), upper.height + lower.height), palette.PAGE)
    page.paste(upper, (0, 0))
    page.paste(lower, (0, upper.height))
    page.info.update(upper.info)
    return page


def _draw_panel(page: Image.Image, top: int, panel: Panel, time: _Axis) -> None:
    axis = _value_axis(panel)
    sheet = Image.new("RGB", (time.length * marks.FINE, PANEL * marks.FINE), palette.FREE)
    draw = ImageDraw.Draw(sheet)
    for start, end in panel.shades:
        x0, x1 = (time.at(np.array([start, end])) * marks.FINE).tolist()
        draw.rectangle((x0, 0, max(x1, x0 + 2 * marks.FINE), sheet.height), fill=_SHADE)
    ticks = axis.ticks()
    for value, _ in ticks:
        marks.stroke(sheet, _level(axis, value, time.length), _GRID, 0.4)
    for level in panel.levels:
        if axis.low < level <= axis.high:
            marks.stroke_dashed(sheet, _level(axis, level, time.length), palette.QUIET, 1.0)
    for curve in panel.curves:
        _draw_curve(sheet, curve, time, axis)
    page.paste(sheet.reduce(marks.FINE), (_LEFT, top))
    _draw_frame(page, top, panel, time, axis, ticks)


def _draw_curve(sheet: Image.Image, curve: Curve, time: _Axis, axis: _Axis) -> None:
    pixels = np.stack([time.at(curve.seconds), PANEL - axis.at(curve.values)], axis=-1)
    pieces = np.zeros(len(pixels), dtype=np.intp) if curve.pieces is None else curve.pieces
    for piece in np.split(pixels, np.flatnonzero(np.diff(pieces)) + 1):
        if len(piece) == 1:
            marks.disc(sheet, piece[0], curve.width, curve.color)
        marks.stroke(sheet, piece, curve.color, curve.width)


def _draw_frame(
    page: Image.Image, top: int, panel: Panel, time: _Axis, axis: _Axis, ticks: list[tuple[float, str]]
) -> None:
    draw = ImageDraw.Draw(page)
    draw.rectangle((_LEFT - 1, top - 1, _LEFT + time.length, top + PANEL), outline=palette.FRAME)
    lettering.write(page, (_LEFT, top - 9), lettering.printable(panel.heading), BODY, palette.INK)
    lettering.write(page, (_LEFT + time.length, top - 9), panel.note, SMALL, palette.QUIET, "rs")
    for value, text in ticks:
        y = top + PANEL - float(axis.at(np.array(value)))
        draw.line((_LEFT - 6, y, _LEFT - 1, y), fill=palette.FRAME)
        lettering.write(page, (_LEFT - 9, y), text, SMALL, palette.QUIET, "rm")


def _draw_time(page: Image.Image, bottom: int, time: _Axis, text: str) -> None:
    draw = ImageDraw.Draw(page)
    for value, label in time.ticks():
        x = _LEFT + float(time.at(np.array(value)))
        draw.line((x, bottom, x, bottom + 5), fill=palette.FRAME)
        lettering.write(page, (x, bottom + 8), label, SMALL, palette.QUIET, "ma")
    lettering.write(page, (_LEFT + time.length, bottom + 26), lettering.printable(text), SMALL, palette.QUIET, "ra")


def _value_axis(panel: Panel) -> _Axis:
    values = np.concatenate([curve.values for curve in panel.curves])
    greatest, middle = float(values.max()), float(np.median(values))
    if greatest > _WIDE * middle > 0.0:
        low = 10.0 ** math.floor(math.log10(max(float(np.quantile(values, 0.02)), greatest * 1e-6)))
        return _Axis(low, 10.0 ** math.ceil(math.log10(greatest)), PANEL, log=True)
    return _Axis(0.0, 1.08 * greatest if greatest > 0.0 else 1.0, PANEL)


def _level(axis: _Axis, value: float, length: int) -> FloatArray:
    y = PANEL - float(axis.at(np.array(value)))
    return np.stack([np.linspace(0.0, length, 2), np.full(2, y)], axis=-1)


_SHADE = palette.mix(palette.FREE, palette.CRIMSON, 0.14)
_GRID = palette.mix(palette.FREE, palette.GRATICULE, 0.5)
