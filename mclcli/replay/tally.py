"""What became of everything that a replay read, in numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.filter.start import Placed
    from mclcli.motion.odometry import Jump
    from mclcli.records import StepRecord
    from mclcli.sensors import Measurement


@final
@dataclass(slots=True)
class Reset:
    """Odometry that was set back, or jumped.

    ``doubtful``: it may have been motion, but what was seen after it does not fit. ``searched``: the robot was searched
    for again, else the filter went on.
    """

    jump: Jump
    doubtful: bool = False
    searched: bool = False

    @property
    def divides(self) -> bool:
        """Whether it begins a segment whatever is seen: the robot may have been carried meanwhile."""
        return self.jump.in_gap and not self.doubtful


@final
@dataclass(slots=True)
class Stretch:
    """Updates in a row at which the robot was probably lost, from stamp to stamp.

    ``first`` and ``last`` (2,) are x, y [m] as stated there; ``reliability`` is the least of them.
    """

    first_ns: int
    last_ns: int
    first: tuple[float, float]
    last: tuple[float, float]
    reliability: float
    updates: int = 1


@final
@dataclass(slots=True)
class ReplayTally:
    """What became of the readings (by topic) and of the odometry, and what was scored (by sensor).

    ``segments`` begin where time jumped back (``time_jumps``), with ``further_logs`` that follow none, and at
    ``resets`` in gaps or after which the robot was lost; ``odometry_jumps`` counts all steps of odometry that cannot
    be motion. ``found`` are the starts for which the robot was searched, each with its stamp; ``undecided`` says, by
    the number of the start, when the last update was at which several of its places were kept alive, and how many.
    """

    used: Counter[str] = field(default_factory=Counter)
    skipped: Counter[tuple[str, str]] = field(default_factory=Counter)
    updates: int = 0
    degenerate: int = 0
    injected: int = 0
    restarts: int = 0
    found: list[tuple[int, Placed]] = field(default_factory=list)
    undecided: dict[int, tuple[int, int]] = field(default_factory=dict)
    segments: int = 1
    maps: int = 0
    time_jumps: int = 0
    further_logs: int = 0
    distance: float = 0.0
    odometry_gaps: int = 0
    odometry_jumps: int = 0
    resets: list[Reset] = field(default_factory=list)
    longest_gap_ns: int = 0
    scored: Counter[str] = field(default_factory=Counter)
    unknown: Counter[str] = field(default_factory=Counter)
    independent: dict[str, float] = field(default_factory=dict)
    lost: list[Stretch] = field(default_factory=list)
    _losing: bool = False

    def take_update(self, record: StepRecord, measurements: Sequence[Measurement]) -> None:
        """Count one update: by sensor the beams or sightings scored, those of unknown ids, and Σ α·K."""
        self.updates += 1
        self.degenerate += record.degenerate
        self.injected += record.injected
        if record.modes:
            self.undecided[len(self.found) - 1] = (record.stamp_ns, record.modes)
        for measurement, alpha in zip(measurements, record.alphas, strict=True):
            name = measurement.sensor
            self.scored[name] += measurement.count
            self.unknown[name] += measurement.unknown
            self.independent[name] = self.independent.get(name, 0.0) + alpha * measurement.count

    def judge(self, record: StepRecord) -> None:
        """Note an update at which the robot is probably lost: the next of a stretch, or the first of a new one."""
        before, self._losing = self._losing, record.lost
        if not record.lost:
            return
        x, y, _ = record.estimate.pose.tolist()
        if not before:
            self.lost.append(Stretch(record.stamp_ns, record.stamp_ns, (x, y), (x, y), record.reliability))
            return
        stretch = self.lost[-1]
        stretch.last_ns, stretch.last = record.stamp_ns, (x, y)
        stretch.reliability = min(stretch.reliability, record.reliability)
        stretch.updates += 1
