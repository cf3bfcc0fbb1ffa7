"""The map as a drawing surface: which stretch of the map frame is shown, and the grid underneath.

Pictures are drawn in the map frame, x to the right and y upwards: a grid whose origin is yawed appears turned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np
from PIL import Image

from mclcli.geometry import se2
from mclcli.render import marks, palette, scales

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.world.occupancy import OccupancyGrid

LONG_SIDE = 1120
_LEAST = (620, 420)  # width, height: room for the words around the map
_MARGIN = 0.03
_CLOSEST = 3.0  # half the side of the smallest view [m], unless the map is smaller: a robot must find its room
_BEYOND = np.int8(-2)  # off the map; less than unknown, so that it never hides a cell


@final
@dataclass(frozen=True, slots=True)
class View:
    """The stretch of the map frame that is shown.

    ``left``, ``top`` [m] are the map coordinates of the upper left corner, ``scale`` [px/m], ``width`` × ``height`` px.
    """

    left: float
    top: float
    scale: float
    width: int
    height: int

    @property
    def right(self) -> float:
        """Map x [m] of the right edge."""
        return self.left + self.width / self.scale

    @property
    def bottom(self) -> float:
        """Map y [m] of the lower edge."""
        return self.top - self.height / self.scale

    def to_pixel(self, points: FloatArray) -> FloatArray:
        """Positions in pixels (..., 2), right and down, of map points (..., 2 or more) [m]; pixel i is [i, i + 1)."""
        return np.stack([points[..., 0] - self.left, self.top - points[..., 1]], axis=-1) * self.scale


@final
@dataclass(frozen=True, slots=True, eq=False)
class MapCanvas:
    """A map to draw on.

    ``image`` is RGB and ``marks.FINE`` times finer than ``view``; ``values`` (its height, width) int8 is what the grid
    says at each of its pixels: 0 free to 100 occupied, −1 unknown, −2 off the map.
    """

    view: View
    image: Image.Image
    values: NDArray[np.int8]

    def to_pixel(self, points: FloatArray) -> FloatArray:
        """Positions in pixels of the finished panel (..., 2) of map points (..., 2 or more) [m]."""
        return self.view.to_pixel(points)

    def cover(self, color: palette.Color, where: BoolArray, opacity: float = 1.0) -> None:
        """Lay one colour over the fine pixels ``where`` (height, width) is true."""
        mask = np.where(where, np.uint8(round(255 * opacity)), np.uint8(0))
        self.image.paste(color, (0, 0), Image.fromarray(mask))

    def cover_walls(self) -> None:
        """Draw the occupied cells again, above what was painted on the map."""
        self.cover(palette.WALL, self.values == 100)


def points_of(array: FloatArray | None, columns: int, name: str) -> FloatArray:
    """Check an array (N, columns) of float64; None is no rows.

    Raises
    ------
    ValueError
        If the shape is another or a value is NaN or infinite.

    """
    points = np.zeros((0, columns)) if array is None else np.asarray(array, dtype=np.float64)
    if points.size == 0:
        return np.zeros((0, columns))
    if points.ndim != 2 or points.shape[1] != columns or not np.isfinite(points).all():
        raise ValueError(f"{name}: expected finite numbers of shape (N, {columns}), got shape {points.shape}")
    return points


def open_canvas(grid: OccupancyGrid, points: FloatArray, *, close: bool = False) -> MapCanvas:
    """Draw a grid, cropped to where there is something to see around the points (P, 2) [m]; see ``choose_view``."""
    view = choose_view(grid, points, close=close)
    values = fine_values(grid, view)
    image = Image.fromarray(values.view(np.uint8))
    image.putpalette(palette.cell_colors().tobytes())
    canvas = MapCanvas(view, image.convert("RGB"), values)
    _draw_graticule(canvas)
    return canvas


def choose_view(grid: OccupancyGrid, points: FloatArray, *, close: bool = False) -> View:
    """Decide what is shown: the known cells and the points (P, 2) [m] with a margin, the long side 1120 px.

    The view closes in on the points where they occupy less than a quarter of the known cells' extent, or if ``close``.
    It never reaches further beyond the map than the map is large: points out there are cut off.
    """
    low, high = _known_bounds(grid)
    extent = float((high - low).max())
    if len(points):
        near = np.clip(points[:, :2], low - extent, high + extent)
        first, last = near.min(axis=0), near.max(axis=0)
        span, middle = float((last - first).max()), 0.5 * (first + last)
        if close or span < 0.25 * extent:
            reach = max((0.6 if close else 0.75) * span, 0.15 * extent, _CLOSEST)
            low, high = np.maximum(low, middle - reach), np.minimum(high, middle + reach)
        low, high = np.minimum(low, first), np.maximum(high, last)
    return _fit(low, high)


def _fit(low: FloatArray, high: FloatArray) -> View:
    """View of a box, with a margin, widened where it would be too narrow."""
    middle, extent = 0.5 * (low + high), high - low
    extent = extent + 2.0 * _MARGIN * extent.max()
    scale = LONG_SIDE / float(extent.max())
    width, height = (max(n, round(float(side) * scale)) for n, side in zip(_LEAST, extent, strict=True))
    return View(
        left=float(middle[0]) - 0.5 * width / scale,
        top=float(middle[1]) + 0.5 * height / scale,
        scale=scale,
        width=width,
        height=height,
    )


def _known_bounds(grid: OccupancyGrid) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner (2,) [m] in the map frame of the cells that are not unknown (all, if none)."""
    known = grid.cells != -1
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    height, width = grid.cells.shape
    r0, r1 = (rows[0], rows[-1] + 1) if rows.size else (0, height)
    c0, c1 = (columns[0], columns[-1] + 1) if columns.size else (0, width)
    corners = np.array([[c0, r0, 0.0], [c1, r0, 0.0], [c0, r1, 0.0], [c1, r1, 0.0]]) * grid.resolution
    corners = se2.compose(grid.origin, corners)[:, :2]
    return corners.min(axis=0), corners.max(axis=0)


def cells_from_fine(origin: FloatArray, resolution: float, view: View) -> FloatArray:
    """Affine map (2, 3): fine pixels (right, down) to continuous cells (column, row) of a lattice.

    ``origin`` (3,) is the pose of the lattice's lower left corner in map, ``resolution`` the side of a cell [m].
    """
    x, y, yaw = (float(v) for v in origin)
    c, s = math.cos(yaw), math.sin(yaw)
    cells = 1.0 / (view.scale * marks.FINE * resolution)  # per fine pixel
    right, up = (view.left - x) / resolution, (view.top - y) / resolution
    return np.array(
        [[c * cells, -s * cells, c * right + s * up], [-s * cells, -c * cells, -s * right + c * up]], dtype=np.float64
    )


def visible_cells(grid: OccupancyGrid, view: View) -> tuple[slice, slice]:
    """Rows and columns of the grid that may lie in the view; empty if none do."""
    affine = cells_from_fine(grid.origin, grid.resolution, view)
    w, h = view.width * marks.FINE, view.height * marks.FINE
    corners = np.array([[0, 0, 1], [w, 0, 1], [0, h, 1], [w, h, 1]]) @ affine.T
    low, high = np.floor(corners.min(axis=0)) - 1, np.ceil(corners.max(axis=0)) + 1
    height, width = grid.cells.shape
    (c0, c1), (r0, r1) = (
        (int(np.clip(low[i], 0, n)), int(np.clip(high[i], 0, n))) for i, n in ((0, width), (1, height))
    )
    return slice(r0, r1), slice(c0, c1)


def lay(image: Image.Image, affine: FloatArray, view: View, fill: float, *, smooth: bool) -> Image.Image:
    """Resample an image whose pixels are cells (row 0 lowest) onto the fine sheet of a view.

    ``affine`` (2, 3) takes fine pixels to its pixels, ``fill`` is what lies beyond it.
    """
    (a, b, c), (d, e, f) = affine.tolist()
    size = (view.width * marks.FINE, view.height * marks.FINE)
    how = Image.Resampling.BILINEAR if smooth else Image.Resampling.NEAREST
    if smooth or (b == 0.0 and d == 0.0):
        return image.transform(size, Image.Transform.AFFINE, (a, b, c, d, e, f), how, fillcolor=fill)
    # Pillow's nearest-neighbour affine map is 16-bit fixed point when it turns: off by pixels on small maps.
    return image.transform(size, Image.Transform.PERSPECTIVE, (a, b, c, d, e, f, 0.0, 0.0), how, fillcolor=fill)


def pooling(affine: FloatArray) -> int:
    """Side of the square blocks of cells of which no fine pixel can miss one, turned or not."""
    return max(1, math.ceil(float(np.abs(affine[0, :2]).sum()) - 1e-9))


def fine_values(grid: OccupancyGrid, view: View) -> NDArray[np.int8]:
    """What the grid says at every fine pixel, (height, width) int8; walls stay a pixel wide however small cells get."""
    affine = cells_from_fine(grid.origin, grid.resolution, view)
    rows, columns = visible_cells(grid, view)
    window, k = grid.cells[rows, columns], pooling(affine)
    if window.size == 0:
        return np.full((view.height * marks.FINE, view.width * marks.FINE), _BEYOND)
    # The greatest value wins: occupied over free over unknown.
    if k > 1:
        window = np.maximum.reduceat(window, np.arange(0, window.shape[0], k), axis=0)
        window = np.maximum.reduceat(window, np.arange(0, window.shape[1], k), axis=1)
    affine[:, 2] -= columns.start, rows.start
    blocks = Image.fromarray(np.ascontiguousarray(window).view(np.uint8))
    laid = lay(blocks, affine / k, view, int(_BEYOND.view(np.uint8)), smooth=False)
    values = np.array(laid).view(np.int8)
    return widened(values) if view.scale * grid.resolution < 1.2 else values


def widened(values: NDArray[np.int8]) -> NDArray[np.int8]:
    """Each value spread to its neighbours on all sides where it is greater than theirs."""
    wide = values.copy()
    for axis in (0, 1):
        line = np.moveaxis(wide, axis, 0)
        before = line.copy()
        np.maximum(line[1:], before[:-1], out=line[1:])
        np.maximum(line[:-1], before[1:], out=line[:-1])
    return wide


def axis_step(view: View, room: float) -> float:
    """Distance [m] of ticks and graticule so that labels ``room`` pixels wide keep apart."""
    return scales.round_up(max(room + 26.0, 80.0) / view.scale)


def _draw_graticule(canvas: MapCanvas) -> None:
    """Faint crosses where the round coordinates of the axes meet."""
    view, arm = canvas.view, 5.0
    step = axis_step(view, 0.0)
    for x in scales.ticks(view.left, view.right, step):
        for y in scales.ticks(view.bottom, view.top, step):
            at = canvas.to_pixel(np.array([x, y]))
            for along in (np.array([arm, 0.0]), np.array([0.0, arm])):
                marks.stroke(canvas.image, np.stack([at - along, at + along]), palette.GRATICULE, 0.4)
