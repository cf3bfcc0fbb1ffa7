"""The distance field on the map: depth colours as on a sea chart, lines of equal distance, walls as coast."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from mclcli.render import marks, page, palette, scales
from mclcli.render.canvas import cells_from_fine, lay, open_canvas, visible_cells, widened
from mclcli.render.page import LegendItem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.render.canvas import MapCanvas, View
    from mclcli.world.occupancy import OccupancyGrid

_SHADES = 124
_LINE = _SHADES  # index of the colour of lines of equal distance


def draw_field(
    grid: OccupancyGrid, distance_m: FloatArray, *, max_dist: float, title: str, subtitle: str = ""
) -> Image.Image:
    """Picture of a distance field.

    Parameters
    ----------
    grid
        The map (H, W).
    distance_m
        (H, W) distance [m] of each cell to the nearest occupied one; more than ``max_dist`` counts as that.
    max_dist
        Where the field is clamped [m], > 0.
    title, subtitle
        One line each.

    Returns
    -------
    RGB image; see ``page.compose`` for where the map's points lie on it.

    Raises
    ------
    ValueError
        If the field's shape is not the map's, it holds NaN, or ``max_dist`` is not positive and finite.

    """
    if distance_m.shape != grid.cells.shape or np.isnan(distance_m).any():
        raise ValueError(f"distance_m: expected numbers of shape {grid.cells.shape}, got shape {distance_m.shape}")
    if not 0.0 < max_dist < np.inf:
        raise ValueError(f"max_dist: expected a positive number, got {max_dist}")
    canvas = open_canvas(grid, np.zeros((0, 2)))
    step = _line_step(canvas.view, max_dist)
    _paint(canvas, _fine_distance(grid, distance_m, canvas.view), max_dist, step)
    levels = [v / max_dist for v in scales.ticks(0.0, max_dist, step)[1:] if v < max_dist * (1.0 - 1e-9)]
    bar = page.ColorBar("distance [m]", palette.ramp("depth"), _ticks(max_dist, step), marked=tuple(levels))
    legend = [LegendItem("cells", "occupied", palette.WALL)]
    legend += [LegendItem("cells", "unknown", palette.UNKNOWN)] if (canvas.values == -1).any() else []
    return page.compose(canvas, title=title, subtitle=subtitle, legend=legend, bar=bar)


def _line_step(view: View, max_dist: float) -> float:
    """Round distance [m] between lines of equal distance, such that they keep 6 px apart."""
    return scales.round_up(max(max_dist / 5.0, 6.0 / view.scale))


def _ticks(max_dist: float, step: float) -> tuple[tuple[float, str], ...]:
    """Tick at every line, and at the clamp."""
    levels = [v for v in scales.ticks(0.0, max_dist, step) if v < max_dist - 0.4 * min(step, max_dist)]
    return (*((v / max_dist, scales.label(v, step)) for v in levels), (1.0, f"{max_dist:g}+"))


def _fine_distance(grid: OccupancyGrid, distance_m: FloatArray, view: View) -> NDArray[np.float32]:
    """Distance at every fine pixel (height, width), interpolated between cell centres."""
    affine = cells_from_fine(grid.origin, grid.resolution, view)
    rows, columns = visible_cells(grid, view)
    k = max(1, int(np.abs(affine[0, :2]).sum()))
    window = np.ascontiguousarray(distance_m[rows, columns][k // 2 :: k, k // 2 :: k], dtype=np.float32)
    if window.size == 0:
        return np.zeros((view.height * marks.FINE, view.width * marks.FINE), dtype=np.float32)
    affine[:, 2] -= columns.start, rows.start
    # A sample stands for the middle of its k × k block; its cell's centre is k // 2 + 1/2 into it.
    affine[:, 2] += 0.5 * k - (k // 2 + 0.5)
    return np.asarray(lay(Image.fromarray(window), affine / k, view, 0.0, smooth=True))


def _paint(canvas: MapCanvas, distance: NDArray[np.float32], max_dist: float, step: float) -> None:
    """Colour every fine pixel of the map through one palette of 256: it is drawn in a single pass."""
    index = np.clip(distance * np.float32((_SHADES - 1) / max_dist), 0.0, _SHADES - 1.0).astype(np.uint8)
    np.copyto(index, np.uint8(_LINE), where=_lines(distance, max_dist, step))
    index += np.where(canvas.values == -1, np.uint8(_LINE + 1), np.uint8(0))
    np.copyto(index, np.uint8(255), where=canvas.values == 100)
    sea = Image.fromarray(index)
    sea.putpalette(_colors().tobytes())
    canvas.image.paste(
        sea.convert("RGB"), (0, 0), Image.fromarray(np.where(canvas.values == -2, 0, 255).astype(np.uint8))
    )


def _colors() -> NDArray[np.uint8]:
    """Colours (256, 3): shades of known places and the line among them, the same of unknown places, last the wall."""
    line = palette.mix(palette.HALO, palette.UNKNOWN, 0.2)
    known = np.concatenate([palette.ramp("depth", _SHADES), np.array([line], dtype=np.uint8)])
    washed = np.rint(known + 0.72 * (np.array(palette.UNKNOWN) - known.astype(np.float64))).astype(np.uint8)
    return np.concatenate([known, washed, np.full((256 - 2 * len(known), 3), palette.WALL, dtype=np.uint8)])


def _lines(distance: NDArray[np.float32], max_dist: float, step: float) -> BoolArray:
    """Fine pixels (height, width) on a line of equal distance: where the band between lines changes."""
    levels = np.ceil(max_dist / step - 1e-6) - 1.0  # the clamp itself is a plain, not a line
    band = np.minimum(distance * np.float32(1.0 / step) + np.float32(1e-3), np.float32(levels)).astype(np.int8)
    change = np.zeros(band.shape, dtype=np.int8)
    change[:, 1:] |= band[:, 1:] != band[:, :-1]
    change[1:] |= band[1:] != band[:-1]
    return widened(change) > 0
