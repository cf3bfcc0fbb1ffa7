"""From evaluations and comparisons to pictures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli.render.evaluation import Errors, draw_evaluation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from PIL.Image import Image

    from mclcli.arrays import FloatArray
    from mclcli.evaluate.evaluation import Evaluation, Protocol
    from mclcli.evaluate.events import Loss, Rule
    from mclcli.geometry.trajectory import Trajectory
    from mclcli.render.evaluation import Levels
    from mclcli.world.occupancy import OccupancyGrid


def picture_of(
    grid: OccupancyGrid | None,
    evaluations: Sequence[Evaluation],
    truth: Trajectory,
    truth_name: str,
    protocol: Protocol,
) -> Image:
    """Picture of tracks over their reference, with their errors over time since the first compared pose of all."""
    first = min(int(e.pairs.stamps_ns[0]) for e in evaluations)
    last = max(int(e.pairs.stamps_ns[-1]) for e in evaluations)
    if len(evaluations) == 1:
        e = evaluations[0]
        name, subtitle = Path(e.name).name, one_line(e)
    else:
        medians = float(np.median([e.translation.rmse for e in evaluations]))
        name, subtitle = f"{len(evaluations)} tracks", f"median APE {medians:.3f} m (RMSE)"
    return draw_evaluation(
        grid,
        [errors_to_draw(e, first) for e in evaluations],
        during(truth, first, last),
        levels=levels_of(protocol.converged, protocol.lost),
        title=f"{name} against {truth_name}",
        subtitle=subtitle,
    )


def one_line(e: Evaluation) -> str:
    """The figures that matter most, in a line."""
    lost = f"lost {len(e.losses)} x" if e.losses else "never lost"
    if e.found_after != 0.0:
        lost = "never found" if e.found_after is None else f"found after {e.found_after:.1f} s, {lost}"
    yaw = math.degrees(e.yaw.rmse)
    return f"APE {e.translation.rmse:.3f} m, {yaw:.2f} deg (RMSE), at most {e.translation.max:.3f} m; {lost}"


def errors_to_draw(e: Evaluation, first_ns: int) -> Errors:
    """One evaluation's errors over seconds since ``first_ns``, its losses marked."""
    seconds = np.asarray((e.pairs.stamps_ns - first_ns) * 1e-9, dtype=np.float64)
    shades = shades_of(e.losses, first_ns, float(seconds[-1]))
    name, pieces = Path(e.name).name, e.pairs.pieces
    return Errors(name, e.pairs.estimated, seconds, e.errors.translation, e.errors.yaw, pieces, shades)


def shades_of(losses: Sequence[Loss], first_ns: int, last: float) -> tuple[tuple[float, float], ...]:
    """Losses as stretches of seconds since ``first_ns``; those that did not end reach to ``last``."""
    return tuple(
        ((loss.start_ns - first_ns) * 1e-9, last if loss.end_ns is None else (loss.end_ns - first_ns) * 1e-9)
        for loss in losses
    )


def during(truth: Trajectory, first_ns: int, last_ns: int) -> FloatArray:
    """Poses of a reference (K, 3) from one stamp to another."""
    first, last = np.searchsorted(truth.stamps_ns, [first_ns, last_ns + 1])
    return truth.poses[first:last]


def levels_of(*rules: Rule) -> Levels:
    """Lines to hold errors against: the bounds of rules."""
    return tuple(rule.translation for rule in rules), tuple(rule.yaw for rule in rules)
