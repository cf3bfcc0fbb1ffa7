"""What ``mcl run`` tells its user: progress, a summary, a picture."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.cli import console
from mclcli.evaluate.metrics import PoseErrors, absolute_pose_errors
from mclcli.evaluate.trajectory import Trajectory
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from mclcli.cli.run_outputs import Outputs, Track
    from mclcli.io.recording import Recording
    from mclcli.records import TrackPoint
    from mclcli.replay import ReplayTally, Setup
    from mclcli.world.occupancy import OccupancyGrid

_REDRAW_S = 0.1


def read_truth(text: str | None, recording: Recording) -> Trajectory | None:
    """Reference named by --truth: a topic of the log or a file."""
    from mclcli.cli.run_start import names_topic, stated_poses
    from mclcli.io.tum import read_tum

    if text is None:
        return None
    if not names_topic(text, recording):
        stated = read_tum(text)
        return Trajectory(stated.stamps_ns, stated.poses)
    poses = {pose.stamp_ns: pose.pose for pose in stated_poses(recording, text)}
    stamps = sorted(poses)
    return Trajectory(np.array(stamps, dtype=np.int64), np.array([poses[stamp] for stamp in stamps]))


@contextmanager
def progress(recording: Recording) -> Iterator[Callable[[TrackPoint], None]]:
    """Live progress on stderr while it is a terminal: percent of the log, × real time, ESS, pose."""
    span = recording.found.span_ns
    if span is None or not console.is_live():
        yield lambda _: None
        return
    from rich.live import Live
    from rich.text import Text

    began = time.perf_counter()
    first_ns, last_ns = span
    drawn = 0.0
    ess = ""
    with Live(console=console.stderr(), transient=True, auto_refresh=False) as live:

        def show(point: TrackPoint) -> None:
            nonlocal drawn, ess
            if point.step is not None:
                ess = f"ESS {point.step.ess:.0f} of {len(point.step.weights)}"
            now = time.perf_counter()
            if now - drawn < _REDRAW_S:
                return
            drawn = now
            part = (point.stamp_ns - first_ns) * 1e-9
            share = (
                f"{100 * (point.stamp_ns - first_ns) / max(last_ns - first_ns, 1):3.0f} %  "
                if recording.log.seekable
                else ""
            )
            x, y, yaw = point.estimate.pose
            speed = part / max(now - began, 1e-9)
            pose = f"x {x:.2f} m  y {y:.2f} m  yaw {np.degrees(yaw):.0f}°"
            line = f"{share}{part:.1f} s of the log  {speed:.0f} × real time  {ess}  {pose}"
            live.update(Text(line, no_wrap=True, overflow="ellipsis"), refresh=True)

        yield show


@final
@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """Lines for the user, and the errors against the reference where there is one."""

    lines: tuple[str, ...]
    errors: PoseErrors | None


def summarise(
    recording: Recording, setup: Setup, tally: ReplayTally, track: Track, truth: Trajectory | None, seconds: float
) -> Summary:
    """What the run did, in a few lines."""
    stamps = track.stamps_ns
    driven = (int(stamps[-1]) - int(stamps[0])) * 1e-9 if stamps.size else 0.0
    speed = f"{seconds:.2f} s ({driven / seconds:.0f} × real time)"
    lines = [f"{tally.updates} updates over {driven:.1f} s and {tally.distance:.1f} m in {speed}"]
    for topic, instrument in setup.instruments.items():
        lines.append(f"{instrument.name} {clean(topic)}: {tally.used[topic]} used{_skipped(tally, topic)}")
    if tally.degenerate:
        lines.append(f"{tally.degenerate} updates ignored their measurement: no weight was left (degenerate)")
    if tally.odometry_gaps:
        lines.append(
            f"odometry {clean(setup.odometry)}: {tally.odometry_gaps} gaps over 1 s, the longest "
            f"{tally.longest_gap_ns * 1e-9:.1f} s; interpolated"
        )
    lines += _events_of(setup, tally) + _unread(recording)
    errors = None
    if truth is not None:
        errors = absolute_pose_errors(Trajectory(stamps, track.poses), truth)
        lines.append(
            f"against the reference: RMSE {errors.translation_rmse:.3f} m, {np.degrees(errors.yaw_rmse):.2f}°, "
            f"largest {errors.translation.max():.3f} m, at {errors.translation.size} of {errors.total} stamps"
        )
    return Summary(tuple(lines), errors)


def _events_of(setup: Setup, tally: ReplayTally) -> list[str]:
    """What happened that a user should know of."""
    odometry = clean(setup.odometry)
    told = {
        f"odometry {odometry}: {{}} jumps, taken for resets and not for motion": tally.odometry_jumps,
        f"{clean(setup.follow)}: {{}} poses stated, the filter began anew at each": tally.restarts,
        "time jumped back {} times; the filter began anew in each segment": tally.segments - 1,
        "{} particles drawn anew": tally.injected,
    }
    return [text.format(count) for text, count in told.items() if count]


def show(summary: Summary) -> None:
    """Print the summary on stderr."""
    for line in summary.lines:
        console.remark(line)


def draw(
    target: str,
    inputs: Sequence[Path],
    grid: OccupancyGrid | None,
    outputs: Outputs,
    truth: Trajectory | None,
    title: str,
    summary: Summary,
) -> None:
    """Picture of map, track, reference and final particles."""
    from mclcli.cli import pictures
    from mclcli.render.track import draw_track

    track = outputs.track
    stamps = track.stamps_ns
    last = outputs.last_step
    picture = draw_track(
        grid if grid is not None else _blank(track.poses),
        track.poses,
        stamps_s=(stamps - stamps[0]) * 1e-9,
        truth=None if truth is None else _during(truth, stamps),
        cloud=None if last is None else last.poses,
        cloud_weights=None if last is None else last.weights,
        title=title,
        subtitle=summary.lines[-1] if summary.errors else summary.lines[0],
    )
    pictures.save(picture, target, inputs)


def _blank(poses: NDArray[np.float64]) -> OccupancyGrid:
    """Empty floor around a track, for runs without a map."""
    from mclcli.world.occupancy import OccupancyGrid

    low, high = poses[:, :2].min(axis=0) - 2.0, poses[:, :2].max(axis=0) + 2.0
    columns, rows = np.ceil((high - low) / 0.1).astype(int)
    return OccupancyGrid(np.zeros((rows, columns), np.int8), 0.1, np.array([*low, 0.0]))


def _during(truth: Trajectory, stamps: NDArray[np.int64]) -> NDArray[np.float64]:
    first, last = np.searchsorted(truth.stamps_ns, [stamps[0], stamps[-1] + 1])
    return truth.poses[first:last]


def _skipped(tally: ReplayTally, topic: str) -> str:
    reasons = [(why, count) for (name, why), count in sorted(tally.skipped.items()) if name == topic]
    return "".join(f", {count} skipped: {clean(why)}" for why, count in reasons)


def _unread(recording: Recording) -> list[str]:
    """Messages of the log that could not be read."""
    lines = []
    for topic, reasons in sorted(recording.tally.skipped.items()):
        lines += [f"{clean(topic)}: {count} messages not read: {clean(why)}" for why, count in sorted(reasons.items())]
    return lines
