"""What ``mcl run`` shows while it goes."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from mclcli.cli import console
from mclcli.cli.run import beginnings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mclcli.arrays import FloatArray
    from mclcli.io.recording.recording import Recording
    from mclcli.records import TrackPoint
    from mclcli.replay.loop import ReplayTally

_REDRAW_S = 0.1


@contextmanager
def progress(recording: Recording, tally: ReplayTally) -> Iterator[Callable[[TrackPoint], None]]:
    """Starts that were searched for, and live progress while stderr is a terminal: percent, × real time, ESS, pose."""
    told = 0

    def tell(_: TrackPoint) -> None:
        nonlocal told
        told = beginnings.tell(recording, tally, told)

    if recording.survey.span_ns is None or not console.is_live():
        yield tell
        return
    began = time.perf_counter()
    first_ns, last_ns = recording.first_ns, recording.last_ns
    drawn = 0.0
    ess = (0, 0)
    with console.live_line() as draw:

        def show(point: TrackPoint) -> None:
            nonlocal drawn, ess
            tell(point)
            if point.step is not None:
                ess = round(point.step.ess), len(point.step.weights)
            now = time.perf_counter()
            if now - drawn < _REDRAW_S:
                return
            drawn = now
            part = (point.stamp_ns - first_ns) * 1e-9
            done = min(1.0, (point.stamp_ns - first_ns) / max(last_ns - first_ns, 1))
            share = f"{100 * done:3.0f} %" if recording.log.seekable else ""
            draw(forms(share, part, part / max(now - began, 1e-9), ess, point.estimate.pose))

        yield show


def forms(share: str, seconds: float, speed: float, ess: tuple[int, int], pose: FloatArray) -> tuple[str, ...]:
    """The line of progress, the fullest first; one of them fits every screen, and none is cut."""
    x, y, yaw = (float(value) for value in pose)
    degrees = float(np.degrees(yaw))
    head = f"{share}  " if share else ""
    where = f"x {x:.2f} m  y {y:.2f} m  yaw {degrees:.0f}°"
    return (
        f"{head}{seconds:.1f} s of the log  {speed:.0f} × real time  ESS {ess[0]} of {ess[1]}  {where}",
        f"{head}{seconds:.1f} s  {speed:.0f} ×  ESS {ess[0]} of {ess[1]}  {x:.2f} m  {y:.2f} m  {degrees:.0f}°",
        f"{head}{seconds:.1f} s  {speed:.0f} ×  {x:.2f} m  {y:.2f} m  {degrees:.0f}°",
        f"{head}{seconds:.1f} s  {speed:.0f} ×",
        share or f"{seconds:.0f} s",
    )
