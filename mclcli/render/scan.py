"""One scan on the map: from where it was taken, and how well each beam's endpoint agrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.render import marks, page, palette, scales
from mclcli.render.canvas import open_canvas, points_of
from mclcli.render.page import LegendItem

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL import Image

    from mclcli.arrays import FloatArray
    from mclcli.world.occupancy import OccupancyGrid

_PLAIN = palette.TEAL


def draw_scan(
    grid: OccupancyGrid,
    pose: FloatArray,
    endpoints: FloatArray,
    values: FloatArray | None = None,
    *,
    label: str = "log p",
    title: str,
    subtitle: str = "",
) -> Image.Image:
    """Picture of a scan.

    Parameters
    ----------
    grid
        The map.
    pose
        Sensor pose (3,), x, y [m], yaw [rad] in map.
    endpoints
        (B, 2) map points [m] where the beams end; rows that are not finite (no return) are left out.
    values
        (B,) what colours each endpoint, high is good; NaN: the beam was not scored, and is grey. None: one colour.
    label
        What the values are, above the colour bar.
    title, subtitle
        One line each.

    Returns
    -------
    RGB image; see ``page.compose`` for where the map's points lie on it.

    Raises
    ------
    ValueError
        If a shape does not fit or the pose is not finite.

    """
    sensor = points_of(np.atleast_2d(pose), 3, "pose")[0]
    ends = np.asarray(endpoints, dtype=np.float64).reshape(-1, 2)
    there = np.isfinite(ends).all(axis=1)
    if values is not None and np.shape(values) != (len(ends),):
        raise ValueError(f"values: expected {len(ends)} numbers, got shape {np.shape(values)}")
    marked = np.full(len(ends), np.nan) if values is None else np.asarray(values, dtype=np.float64)
    ends, marked = ends[there], marked[there]
    canvas = open_canvas(grid, np.concatenate([sensor[np.newaxis, :2], ends]), close=True)
    start, pixels = canvas.to_pixel(sensor), canvas.to_pixel(ends)
    marks.rays(canvas.image, start, pixels, palette.INK, 34)
    order = np.argsort(-np.nan_to_num(marked, nan=np.inf), kind="stable")  # the worst on top
    for pixel, ink in zip(pixels[order], _inks(marked, one=values is None)[order].tolist(), strict=True):
        marks.disc(canvas.image, pixel, 4.0, palette.HALO)
        marks.disc(canvas.image, pixel, 3.0, tuple(ink))
    marks.arrow(canvas.image, start, float(sensor[2]), palette.INK)
    legend = _legend(marked, one=values is None)
    return page.compose(canvas, title=title, subtitle=subtitle, legend=legend, bar=_bar(marked, label))


def _inks(values: FloatArray, *, one: bool) -> NDArray[np.uint8]:
    """Colours (B, 3) of the endpoints."""
    if one:
        return np.tile(np.array(_PLAIN, dtype=np.uint8), (len(values), 1))
    low, high = scales.span_of(values)
    known = palette.pick(palette.ramp("time"), np.nan_to_num(values, nan=low), low, high)
    return np.where(np.isnan(values)[:, np.newaxis], np.array(palette.QUIET, dtype=np.uint8), known)


def _legend(values: FloatArray, *, one: bool) -> list[LegendItem]:
    items = [LegendItem("arrow", "sensor")]
    if len(values):
        items.append(LegendItem("dots", f"{len(values)} endpoints", _PLAIN if one else palette.INK))
    if not one and np.isnan(values).any():
        items.append(LegendItem("dots", f"{np.isnan(values).sum()} of them not scored", palette.QUIET))
    return items


def _bar(values: FloatArray, label: str) -> page.ColorBar | None:
    if not np.isfinite(values).any():
        return None
    return page.ColorBar(label, palette.ramp("time"), page.linear_ticks(*scales.span_of(values)))
