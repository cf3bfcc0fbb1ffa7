"""What a run is held against: a reference (--truth), and what the robot itself believed (--versus)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.cli.clock import clock_text
from mclcli.cli.eval import report
from mclcli.evaluate.evaluation import Evaluation, Protocol, evaluate
from mclcli.evaluate.events import APART
from mclcli.evaluate.versus import Comparison, carried, compare, composed
from mclcli.text import clean

if TYPE_CHECKING:
    from mclcli.evaluate.events import Loss
    from mclcli.geometry.trajectory import Track, Trajectory
    from mclcli.io.recording.recorded_poses import RecordedPoses
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.to_map import MapFrame
    from mclcli.replay.loop import Setup


@final
@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """How a run compares: ``truth`` with ``evaluation`` against it, and ``comparison`` with the robot's own belief.

    ``believed``: that belief against the reference, where there are both. ``origin_ns`` is the log's first message.
    """

    truth: Trajectory | None
    evaluation: Evaluation | None
    comparison: Comparison | None
    believed: Evaluation | None
    source: str
    origin_ns: int


@final
class References:
    """Collects what --truth and --versus name while the log goes by: it is read once, and may be a pipe.

    ``topics`` are those needed for it.
    """

    def __init__(
        self, truth: str | None, versus: str | None, recording: Recording, setup: Setup, frame: MapFrame
    ) -> None:
        from mclcli.io.recording.recorded_poses import RecordedPoses, read_trajectory

        self._versus_name, self._origin_ns = versus or "", recording.first_ns
        self._file: Trajectory | None = None
        self._truth: RecordedPoses | None = None
        self._versus: RecordedPoses | None = None
        if truth is not None and _is_stated(truth, recording):
            self._truth = RecordedPoses(truth, recording.survey, setup.base_frame, frame)
        elif truth is not None:
            self._file = read_trajectory(truth, map_frame_id=frame.names[0] if frame.names else "")
        self._of_odometry = versus is not None and _is_of_odometry(versus, setup.odom_frame)
        if versus is not None:
            child = setup.odom_frame if self._of_odometry else setup.base_frame
            self._versus = RecordedPoses(versus, recording.survey, child, frame)
        collectors = [collector for collector in (self._truth, self._versus) if collector is not None]
        self._collectors = tuple(collectors)
        self.topics: frozenset[str] = frozenset().union(*(collector.topics for collector in collectors))

    def take(self, topic: str, record: object) -> None:
        """Take one decoded message in, of whichever topic."""
        for collector in self._collectors:
            collector.take(topic, record)

    def findings(self, track: Track) -> Findings:
        """Hold the track against what was collected.

        Raises
        ------
        InputError
            If a reference states nothing, or nothing at the time of the run.

        """
        truth = self._truth.trajectory() if self._truth is not None else self._file
        mine = track.trajectory
        evaluation = None if truth is None else evaluate(mine, truth)
        belief = None if self._versus is None else self._belief(self._versus.trajectory(), track)
        comparison = None if belief is None else compare(mine, belief)
        believed = None if belief is None or truth is None else evaluate(belief, truth)
        return Findings(truth, evaluation, comparison, believed, self._versus_name, self._origin_ns)

    def _belief(self, belief: Trajectory, track: Track) -> Trajectory:
        return (composed if self._of_odometry else carried)(belief, track.odometry)


def _is_of_odometry(source: str, odom_frame: str) -> bool:
    """Whether --versus tells where odometry's frame is, to be composed with it: ``tf:FRAME``, ``tf:FRAME:odom``."""
    kind, _, rest = source.partition(":")
    return kind == "tf" and rest.partition(":")[2].lstrip("/") in {"", odom_frame}


def _is_stated(text: str, recording: Recording) -> bool:
    """Whether --truth names something within the log itself."""
    from mclcli.cli.run.start import names_topic

    return names_topic(text, recording)


def lines_of(findings: Findings) -> list[str]:
    """One line on the reference, and some on what the robot believed."""
    lines = []
    if findings.evaluation is not None:
        lines.append(f"against the reference: {_headline(findings.evaluation)}")
    if findings.comparison is not None:
        lines += _versus_lines(findings.comparison, findings.source, findings.origin_ns)
    if findings.believed is not None:
        lines.append(f"what the robot believed, against the reference: {_headline(findings.believed)}")
    return lines


def report_of(findings: Findings) -> str:
    """The report of ``mcl eval`` on the run; empty without a reference."""
    if findings.evaluation is None:
        return ""
    return report.describe(findings.evaluation, Protocol(), findings.origin_ns, "into the log")


def _headline(e: Evaluation) -> str:
    return (
        f"RMSE {e.translation.rmse:.3f} m, {math.degrees(e.yaw.rmse):.2f}°, "
        f"largest {e.translation.max:.3f} m, at {e.translation.count} of {e.pairs.total} stamps"
    )


def _versus_lines(comparison: Comparison, source: str, origin_ns: int) -> list[str]:
    """How far apart the two were, and since when."""
    d = comparison.differences
    worst = int(d.translation.argmax())
    average = f"{d.translation_rmse:.3f} m, {math.degrees(d.yaw_rmse):.2f}° apart (RMSE)"
    largest = f"at most {d.translation[worst]:.3f} m at {_when(int(d.stamps_ns[worst]), origin_ns)}"
    lines = [f"versus {clean(source)}: {average}, {largest}; {d.stamps_ns.size} of {d.total} poses compared"]
    rule = f"over {APART.translation:g} m or {math.degrees(APART.yaw):.4g}° for at least {APART.seconds:g} s"
    if not comparison.apart:
        return [*lines, f"versus {clean(source)}: never apart ({rule})"]
    first, *others = report.told(comparison.apart)
    start = " from the start" if first.from_start else ""
    lines.append(f"versus {clean(source)}: first apart{start} at {_lasted(first, origin_ns)} ({rule})")
    again = [f"versus {clean(source)}: again at {_lasted(loss, origin_ns)}" for loss in others]
    return [*lines, *again, *report.rest(comparison.apart)]


def _lasted(loss: Loss, origin_ns: int) -> str:
    return report.moment(loss, origin_ns, "into the log")


def _when(stamp_ns: int, origin_ns: int) -> str:
    return f"{clock_text(stamp_ns)} ({(stamp_ns - origin_ns) * 1e-9:.1f} s into the log)"
