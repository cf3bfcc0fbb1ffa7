"""Tracks over their reference, and their errors over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.render import marks, page, palette
from mclcli.render.canvas import open_canvas, points_of
from mclcli.render.chart import Curve, Panel, draw_charts, stack
from mclcli.render.page import LegendItem
from mclcli.render.track import draw_track

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from PIL import Image

    from mclcli.arrays import FloatArray
    from mclcli.world.occupancy import OccupancyGrid

_NAMED = 6  # more tracks than this are not told apart by colour in the legend

Levels = tuple[tuple[float, ...], tuple[float, ...]]  # of translation [m] and of yaw [rad]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Errors of M poses of one track: ``seconds`` (M,), ``translation`` (M,) [m], ``yaw`` (M,) [rad].

    ``pieces`` (M,) number the stretches without a hole; ``shades`` are stretches of time [s] to mark.
    """

    name: str
    poses: FloatArray
    seconds: FloatArray
    translation: FloatArray
    yaw: FloatArray
    pieces: NDArray[np.intp] | None = None
    shades: tuple[tuple[float, float], ...] = ()


def draw_evaluation(
    grid: OccupancyGrid | None,
    tracks: Sequence[Errors],
    truth: FloatArray,
    *,
    levels: Levels = ((), ()),
    title: str,
    subtitle: str = "",
) -> Image.Image:
    """Picture of one or more tracks over their reference (K, 3), and below it their errors over time.

    ``levels`` are drawn as lines to hold the errors against.

    Raises
    ------
    ValueError
        If there is no track, or a number is not finite.

    """
    truth = points_of(truth, 3, "truth")
    everything = np.concatenate([truth, *(track.poses for track in tracks)])
    floor = floor_around(everything) if grid is None else grid
    if len(tracks) == 1:
        one = tracks[0]
        upper = draw_track(floor, one.poses, stamps_s=one.seconds, truth=truth, title=title, subtitle=subtitle)
    else:
        upper = _draw_many(floor, tracks, truth, title, subtitle)
    return with_errors(upper, tracks, "error", "lost", levels)


def with_errors(
    picture: Image.Image, tracks: Sequence[Errors], what: str, marked: str, levels: Levels = ((), ())
) -> Image.Image:
    """Picture with panels of translation and yaw over time below it.

    ``what`` is what they show, ``error`` say; ``marked`` what the shades of a single track mean.
    """
    shades = tracks[0].shades if len(tracks) == 1 else ()
    note = f"shaded: {marked}" if shades else ""
    drawn = list(zip(tracks, colors_of(len(tracks)), strict=True))
    translation = tuple(Curve(t.seconds, t.translation, color, t.pieces) for t, color in drawn)
    yaw = tuple(Curve(t.seconds, np.degrees(np.abs(t.yaw)), color, t.pieces) for t, color in drawn)
    panels = (
        Panel(f"translation {what} [m]", translation, levels[0], shades, note),
        Panel(f"yaw {what} [deg]", yaw, tuple(np.degrees(levels[1]).tolist()), shades, note),
    )
    return stack(picture, draw_charts(panels, width=picture.width))


def colors_of(count: int) -> list[palette.Color]:
    """Colours of so many curves."""
    if count == 1:
        return [palette.TEAL]
    return [(int(r), int(g), int(b)) for r, g, b in palette.ramp("time", count)]


def floor_around(poses: FloatArray) -> OccupancyGrid:
    """Empty floor around poses (N, 2 or more), for pictures without a map; at most some million cells."""
    from mclcli.world.occupancy import OccupancyGrid

    low, high = poses[:, :2].min(axis=0) - 2.0, poses[:, :2].max(axis=0) + 2.0
    cell = max(0.1, float((high - low).max()) / 1000.0)
    columns, rows = np.ceil((high - low) / cell).astype(int)
    return OccupancyGrid(np.zeros((rows, columns), np.int8), cell, np.array([*low, 0.0]))


def _draw_many(
    grid: OccupancyGrid, tracks: Sequence[Errors], truth: FloatArray, title: str, subtitle: str
) -> Image.Image:
    canvas = open_canvas(grid, np.concatenate([truth, *(track.poses for track in tracks)])[:, :2])
    colors = colors_of(len(tracks))
    for track, color in zip(tracks, colors, strict=True):
        marks.stroke(canvas.image, canvas.to_pixel(points_of(track.poses, 3, "poses")), color, 1.8)
    marks.stroke_dashed(canvas.image, canvas.to_pixel(truth), palette.CRIMSON, 1.7)
    named = [LegendItem("line", track.name, color) for track, color in zip(tracks, colors, strict=True)]
    legend = named if len(tracks) <= _NAMED else [LegendItem("ramp", f"{len(tracks)} tracks")]
    return page.compose(
        canvas, title=title, subtitle=subtitle, legend=[*legend, LegendItem("dashes", "reference", palette.CRIMSON)]
    )
