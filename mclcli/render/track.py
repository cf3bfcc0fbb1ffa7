"""A run on the map: the track coloured by time, the reference beneath it, the particles at its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.render import marks, page, palette
from mclcli.render.canvas import open_canvas, points_of
from mclcli.render.page import LegendItem

if TYPE_CHECKING:
    from PIL import Image

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.render.canvas import MapCanvas
    from mclcli.world.occupancy import OccupancyGrid

_TRACK = palette.TEAL
_LOST = palette.mix(palette.CRIMSON, palette.HALO, 0.35)
_SPREAD = palette.mix(palette.AMBER, palette.INK, 0.45)


def draw_track(
    grid: OccupancyGrid,
    poses: FloatArray,
    *,
    stamps_s: FloatArray | None = None,
    segments: IntArray | None = None,
    truth: FloatArray | None = None,
    belief: FloatArray | None = None,
    cloud: FloatArray | None = None,
    cloud_weights: FloatArray | None = None,
    lost: BoolArray | None = None,
    title: str,
    subtitle: str = "",
) -> Image.Image:
    """Picture of a track on its map.

    Parameters
    ----------
    grid
        The map.
    poses
        Track (N, 3), x, y [m], yaw [rad] in map; N may be 0.
    stamps_s
        (N,) seconds as the colour bar shall show them; None draws the track in one colour.
    segments
        (N,) number of the stretch each pose belongs to; the line breaks where it changes. None: one stretch.
    truth
        Reference (M, 3), drawn dashed beneath the track.
    belief
        What the robot itself believed (K, 3), drawn dashed as well.
    cloud
        Particles (P, 3) at the end of the track.
    cloud_weights
        (P,) their weights, ≥ 0, of any sum; None: equal.
    lost
        (N,) where the robot was probably lost; None: nowhere. Marked by a red band under the track.
    title, subtitle
        One line each.

    Returns
    -------
    RGB image; see ``page.compose`` for where the map's points lie on it.

    Raises
    ------
    ValueError
        If a shape does not fit or a number is not finite.

    """
    poses, truth, cloud = (points_of(a, 3, name) for a, name in ((poses, "poses"), (truth, "truth"), (cloud, "cloud")))
    belief = points_of(belief, 3, "belief")
    stamps = _per_row(stamps_s, len(poses), "stamps_s")
    if segments is not None and np.shape(segments) != (len(poses),):
        raise ValueError(f"segments: expected {len(poses)} numbers, got shape {np.shape(segments)}")
    weights = _per_row(cloud_weights, len(cloud), "cloud_weights")
    canvas = open_canvas(grid, np.concatenate([poses, truth, belief])[:, :2])
    marks.stroke_dashed(canvas.image, canvas.to_pixel(truth), palette.CRIMSON, 1.7)
    marks.stroke_dashed(canvas.image, canvas.to_pixel(belief), palette.AMBER, 1.7)
    spread = _draw_cloud(canvas, cloud, weights)
    astray = _runs(lost, len(poses))
    _draw_lost(canvas, poses, astray)
    _draw_line(canvas, poses, stamps, segments)
    _draw_ends(canvas, poses)
    legend = _legend(poses, stamps, truth, belief, cloud, spread=spread, lost=bool(astray))
    return page.compose(canvas, title=title, subtitle=subtitle, legend=legend, bar=_bar(stamps))


def _per_row(values: FloatArray | None, rows: int, name: str) -> FloatArray | None:
    """Check one finite number per row."""
    if values is None:
        return None
    values = np.asarray(values, dtype=np.float64)
    if values.shape != (rows,) or not np.isfinite(values).all():
        raise ValueError(f"{name}: expected {rows} finite numbers, got shape {values.shape}")
    return values


def _runs(lost: BoolArray | None, rows: int) -> list[slice]:
    """The stretches of poses in a row that are marked."""
    if lost is None:
        return []
    if np.shape(lost) != (rows,):
        raise ValueError(f"lost: expected {rows} truths, got shape {np.shape(lost)}")
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def _draw_lost(canvas: MapCanvas, poses: FloatArray, runs: list[slice]) -> None:
    """A band beneath the track, and a disc where each begins: a stretch of one pose has no length."""
    pixels = canvas.to_pixel(poses)
    for run in runs:
        marks.stroke(canvas.image, pixels[run], _LOST, 11.0)
        marks.disc(canvas.image, pixels[run.start], 6.5, _LOST, _LOST)


def _draw_line(
    canvas: MapCanvas,
    poses: FloatArray,
    stamps: FloatArray | None,
    segments: IntArray | None,
) -> None:
    """Track with a pale edge, so that it stands out from walls; pieces between segments are left out."""
    pixels = canvas.to_pixel(poses)
    breaks = np.zeros(0, dtype=np.intp) if segments is None else np.flatnonzero(np.diff(segments)) + 1
    if stamps is None or not len(stamps):
        colors = np.broadcast_to(np.array(_TRACK, dtype=np.uint8), (len(poses), 3))
    else:
        colors = palette.pick(palette.ramp("time"), stamps, stamps.min(), stamps.max())
    pieces = list(zip(np.split(pixels, breaks), np.split(colors, breaks), strict=True))
    for piece, _ in pieces:
        marks.stroke(canvas.image, piece, palette.HALO, 5.0)
    for piece, ink in pieces:
        marks.stroke_ramp(canvas.image, piece, ink, 3.0)


def _draw_ends(canvas: MapCanvas, poses: FloatArray) -> None:
    pixels = canvas.to_pixel(poses)
    if len(poses) > 1:
        marks.disc(canvas.image, pixels[0], 7.5, palette.HALO, palette.INK)
    if len(poses):
        marks.arrow(canvas.image, pixels[-1], float(poses[-1, 2]), palette.INK)


def _draw_cloud(canvas: MapCanvas, cloud: FloatArray, weights: FloatArray | None) -> bool:
    """Particles as translucent dots, heavier ones darker; tells whether their 2σ ellipse could be drawn."""
    if not len(cloud):
        return False
    share = np.full(len(cloud), 1.0) if weights is None or not weights.sum() > 0 else weights / weights.mean()
    opacity = 0.3 * min(1.0, 500.0 / len(cloud)) ** 0.3  # a dense cloud must still show its core
    marks.soft_dots(canvas.image, canvas.to_pixel(cloud), np.clip(opacity * share, 0.02, 0.9), palette.AMBER)
    outline = canvas.to_pixel(_ellipse(cloud[:, :2], share))
    size = float(np.ptp(outline, axis=0).max())
    # Around several clusters an ellipse says nothing; under the arrow it is not seen.
    seen = 24.0 < size < 0.3 * canvas.view.width
    if seen:
        marks.stroke(canvas.image, outline, _SPREAD, 1.6)
    return seen


def _ellipse(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Outline (73, 2) of the 2σ ellipse of weighted points (P, 2)."""
    share = weights / weights.sum()
    mean = share @ points
    apart = points - mean
    values, axes = np.linalg.eigh((share[:, np.newaxis] * apart).T @ apart)
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return np.asarray(mean + 2.0 * (circle * np.sqrt(np.maximum(values, 0.0))) @ axes.T, dtype=np.float64)


def _legend(
    poses: FloatArray,
    stamps: FloatArray | None,
    truth: FloatArray,
    belief: FloatArray,
    cloud: FloatArray,
    *,
    spread: bool,
    lost: bool,
) -> list[LegendItem]:
    """Entries for what is on the picture, and nothing else."""
    track = LegendItem("line", "track", _TRACK) if stamps is None else LegendItem("ramp", "track")
    entries = [
        (len(poses) > 1, track),
        (lost, LegendItem("line", "probably lost", _LOST)),
        (len(truth) > 0, LegendItem("dashes", "reference", palette.CRIMSON)),
        (len(belief) > 0, LegendItem("dashes", "what the robot believed", palette.AMBER)),
        (len(poses) > 1, LegendItem("ring", "start")),
        (len(poses) > 0, LegendItem("arrow", "end" if len(poses) > 1 else "pose")),
        (len(cloud) > 0, LegendItem("dots", f"{len(cloud):,} particles at the end", palette.AMBER)),
        (spread, LegendItem("ellipse", "their 2 sigma", _SPREAD)),
    ]
    return [item for shown, item in entries if shown]


def _bar(stamps: FloatArray | None) -> page.ColorBar | None:
    if stamps is None or not len(stamps):
        return None
    ticks = page.linear_ticks(float(stamps.min()), float(stamps.max()))
    return page.ColorBar("time [s]", palette.ramp("time"), ticks)
