"""Updates of a run over time: reliability, effective sample size, particles, errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from mclcli.render import lettering, palette
from mclcli.render.chart import Curve, Panel, draw_charts, stack
from mclcli.render.lettering import TITLE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.render.evaluation import Errors

_WIDTH, _HEAD = 1100, 56


def draw_updates(
    seconds: FloatArray,
    *,
    ess: FloatArray,
    particles: FloatArray,
    reliability: FloatArray | None = None,
    lost: BoolArray | None = None,
    lost_below: float = 0.8,
    pieces: NDArray[np.intp] | None = None,
    errors: Errors | None = None,
    title: str,
) -> Image.Image:
    """Panels of N updates at ``seconds`` (N,) since the first one, below each other.

    ``reliability`` (N,) has a line at ``lost_below``; where ``lost`` (N,) is set, time is shaded. ``pieces`` (N,)
    number the stretches that belong together. ``errors`` are those against a reference.

    Raises
    ------
    ValueError
        If there is no update.

    """
    shades = () if lost is None else _stretches(seconds, lost)
    note = "shaded: probably lost" if shades else ""

    def panel(heading: str, values: FloatArray, levels: tuple[float, ...] = ()) -> Panel:
        return Panel(heading, (Curve(seconds, values, palette.TEAL, pieces),), levels, shades, note)

    panels = [] if reliability is None else [panel("reliability", reliability, (lost_below,))]
    panels += [panel("effective sample size (ESS)", ess), panel("particles", particles)]
    if errors is not None:
        degrees = np.degrees(np.abs(errors.yaw))
        for heading, values in (("translation error [m]", errors.translation), ("yaw error [deg]", degrees)):
            curve = Curve(errors.seconds, values, palette.TEAL, errors.pieces)
            panels.append(Panel(heading, (curve,), (), errors.shades, "shaded: lost" if errors.shades else ""))
    head = Image.new("RGB", (_WIDTH, _HEAD), palette.PAGE)
    lettering.write(head, (22, 38), lettering.printable(title), TITLE, palette.INK)
    return stack(head, draw_charts(panels, width=_WIDTH, time_text="seconds since the first update"))


def _stretches(seconds: FloatArray, marked: BoolArray) -> tuple[tuple[float, float], ...]:
    """From the first to the last marked time of each row of them."""
    steps = np.diff(np.concatenate([[0], marked.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1
    return tuple(zip(seconds[begins].tolist(), seconds[ends].tolist(), strict=True))
