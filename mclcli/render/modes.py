"""Where the robot may be: places on the map by their probability, and the scan as seen from the best."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.render import marks, page, palette
from mclcli.render.canvas import open_canvas, points_of
from mclcli.render.page import LegendItem

if TYPE_CHECKING:
    from PIL import Image

    from mclcli.arrays import FloatArray
    from mclcli.world.occupancy import OccupancyGrid

_BEST = palette.CRIMSON
_OTHERS = palette.AMBER
_SCAN = palette.TEAL


def draw_modes(
    grid: OccupancyGrid,
    poses: FloatArray,
    shares: FloatArray,
    endpoints: FloatArray,
    *,
    title: str,
    subtitle: str = "",
) -> Image.Image:
    """Picture of places that compete.

    Parameters
    ----------
    grid
        The map.
    poses
        (K, 3) x, y [m], yaw [rad] in map, the best first.
    shares
        (K,) their probabilities; an arrow's size and depth of colour say it.
    endpoints
        (B, 2) map points [m] where the beams end, seen from the best pose; rows that are not finite are left out.
    title, subtitle
        One line each.

    Returns
    -------
    RGB image; see ``page.compose`` for where the map's points lie on it.

    Raises
    ------
    ValueError
        If a shape does not fit, or a pose is not finite.

    """
    places = points_of(poses, 3, "poses")
    if np.shape(shares) != (len(places),):
        raise ValueError(f"shares: expected {len(places)} numbers, got shape {np.shape(shares)}")
    ends = np.asarray(endpoints, dtype=np.float64).reshape(-1, 2)
    ends = ends[np.isfinite(ends).all(axis=1)]
    canvas = open_canvas(grid, np.concatenate([places[:, :2], ends]))
    if len(places):
        marks.rays(canvas.image, canvas.to_pixel(places[0]), canvas.to_pixel(ends), _SCAN, 26)
    for pixel in canvas.to_pixel(ends):
        marks.disc(canvas.image, pixel, 2.2, _SCAN)
    for rank in reversed(range(len(places))):
        share = float(np.clip(shares[rank], 0.0, 1.0))
        ink = _BEST if rank == 0 else palette.mix(palette.PAGE, _OTHERS, 0.35 + 0.65 * share**0.5)
        size = 15.0 if rank == 0 else 7.0 + 8.0 * share**0.5
        marks.arrow(canvas.image, canvas.to_pixel(places[rank]), float(places[rank, 2]), ink, size)
    return page.compose(canvas, title=title, subtitle=subtitle, legend=_legend(shares, len(ends)))


def _legend(shares: FloatArray, ends: int) -> list[LegendItem]:
    items = []
    if len(shares):
        items.append(LegendItem("arrow", f"best place, {_percent(float(shares[0]))}", _BEST))
    if len(shares) > 1:
        others = f"{len(shares) - 1} other{'s' if len(shares) > 2 else ''}, up to {_percent(float(shares[1:].max()))}"
        items.append(LegendItem("arrow", others, _OTHERS))
    if ends:
        items.append(LegendItem("dots", f"{ends} endpoints seen from the best", _SCAN))
    return items


def _percent(share: float) -> str:
    """Share as a percentage that never rounds up to certainty."""
    return f"{np.floor(share * 1000.0) / 10.0:g} %" if share < 1.0 else "100 %"
