"""The likelihood of a scan over the map: where the robot could be, and where best."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from mclcli.render import marks, page, palette, scales
from mclcli.render.canvas import cells_from_fine, lay, open_canvas, points_of
from mclcli.render.page import LegendItem

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.render.canvas import MapCanvas
    from mclcli.world.occupancy import OccupancyGrid

_NOTHING = 255  # no pose was scored there
_BEST = palette.TEAL
_OTHERS = palette.mix(palette.TEAL, palette.PAGE, 0.35)


def draw_heatmap(
    grid: OccupancyGrid,
    xy: FloatArray,
    log_weight: FloatArray,
    *,
    step: float,
    best_poses: FloatArray | None = None,
    lattice_yaw: float = 0.0,
    depth: float | None = None,
    title: str,
    subtitle: str = "",
) -> Image.Image:
    """Picture of the log-likelihood over places.

    Parameters
    ----------
    grid
        The map.
    xy
        Places (P, 2) [m] in map, on a square lattice; P may be 0.
    log_weight
        (P,) log-likelihood [nats] at each, best over yaw; −inf is allowed.
    step
        Distance of neighbouring places [m].
    best_poses
        (K, 3) poses to mark with arrows, the best first.
    lattice_yaw
        Direction [rad] of the lattice's rows in map.
    depth
        Colours span this many nats below the best; None: at least 20, and so much that a quarter of the places
        stand out.
    title, subtitle
        One line each.

    Returns
    -------
    RGB image; see ``page.compose`` for where the map's points lie on it.

    Raises
    ------
    ValueError
        If a shape does not fit, a place is not finite, a log-likelihood is NaN or +inf, or ``step`` is not positive.

    """
    places, best = points_of(xy, 2, "xy"), points_of(best_poses, 3, "best_poses")
    logs = np.asarray(log_weight, dtype=np.float64)
    if logs.shape != (len(places),) or np.isnan(logs).any() or (logs == np.inf).any():
        raise ValueError(f"log_weight: expected {len(places)} numbers below +inf, got shape {logs.shape}")
    if not 0.0 < step < math.inf:
        raise ValueError(f"step: expected a positive number, got {step}")
    canvas = open_canvas(grid, np.concatenate([places, best[:, :2]]))
    below = logs.max() - logs if np.isfinite(logs).any() else np.zeros(0)
    bar = None
    if len(below):
        depth = _depth(below) if depth is None else depth
        _paint(canvas, places, below / depth, step, lattice_yaw)
        bar = _bar(depth, clipped=bool(below.max() > depth))
    canvas.cover_walls()
    for rank, pose in reversed(list(enumerate(best))):
        ink, size = (_OTHERS, 10.0) if rank else (_BEST, 15.0)
        marks.arrow(canvas.image, canvas.to_pixel(pose), float(pose[2]), ink, size)
    return page.compose(canvas, title=title, subtitle=subtitle, legend=_legend(len(best)), bar=bar)


def _depth(below: FloatArray) -> float:
    """Round number of nats that the colours span."""
    finite = below[np.isfinite(below)]
    wanted = max(20.0, float(np.quantile(finite, 0.25)))
    return scales.round_up(max(min(wanted, float(finite.max())), 1.0))


def _paint(canvas: MapCanvas, places: FloatArray, share: FloatArray, step: float, yaw: float) -> None:
    """Squares of side ``step`` around the places, coloured by ``share`` (P,): 0 the best, 1 and more the worst."""
    c, s = math.cos(yaw), math.sin(yaw)
    # Squares too small to be seen are merged; the best of them shows.
    side = max(step, 1.5 / (canvas.view.scale * marks.FINE))
    pixels = canvas.to_pixel(places)
    seen = ((pixels > -60.0) & (pixels < np.array([canvas.view.width, canvas.view.height]) + 60.0)).all(axis=1)
    if not seen.any():
        return
    base = places[seen][0]
    along = (places[seen] - base) @ np.array([[c, -s], [s, c]])
    low = along.min(axis=0)
    column, row = np.rint((along - low) / side).astype(np.intp).T
    index = np.full((row.max() + 1, column.max() + 1), _NOTHING, dtype=np.uint8)
    np.minimum.at(index, (row, column), np.rint(np.minimum(share[seen], 1.0) * 254.0).astype(np.uint8))
    corner = base + np.array([[c, -s], [s, c]]) @ (low - 0.5 * side)
    affine = cells_from_fine(np.array([*corner, yaw]), side, canvas.view)
    laid = lay(Image.fromarray(index), affine, canvas.view, _NOTHING, smooth=False)
    there = laid.point([255] * _NOTHING + [0])
    laid.putpalette(palette.ramp("heat", 255)[::-1].tobytes())
    canvas.image.paste(laid.convert("RGB"), (0, 0), there)


def _bar(depth: float, *, clipped: bool) -> page.ColorBar:
    """Colour bar in nats below the best, the best on top."""
    step = scales.round_up(depth / 5.0)
    values = scales.ticks(0.0, depth, step)
    texts = [scales.label(-v, step) for v in values]
    if clipped:
        texts[-1] += " or less"
    ticks = tuple((1.0 - v / depth, text) for v, text in zip(values, texts, strict=True))
    return page.ColorBar("log-likelihood\n[nats], best = 0", palette.ramp("heat"), ticks)


def _legend(count: int) -> list[LegendItem]:
    others = "next best pose" if count == 2 else f"next {count - 1} best poses"
    items = [LegendItem("arrow", "best pose", _BEST), LegendItem("arrow", others, _OTHERS)]
    return items[: min(count, 2)]
