"""A recorded log through the filter: messages in, track points out.

``replay`` is the loop; ``Setup`` says what takes part. ``mclcli.assemble`` makes one from a log and a map.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli import rng, se2, se3
from mclcli.filter import policies
from mclcli.filter.localizer import FilterState, initial_state
from mclcli.motion.odometry import OdometryPath
from mclcli.records import Estimate, LandmarkSightings, LaserScan, Odometry, StepRecord, TrackPoint, Transform
from mclcli.sensors.instruments import combine

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from mclcli.filter.localizer import Localizer
    from mclcli.filter.start import Start
    from mclcli.io.frames import TransformTree
    from mclcli.sensors import Measurement
    from mclcli.sensors.instruments import Instrument, Reading

    Seen = tuple[str, Reading, NDArray[np.float64], NDArray[np.float64] | None]  # topic; odometry and mount back then

_GAP_NS = 1_000_000_000
_KEEP_NS = 2_000_000_000  # odometry older than this before the last reading is forgotten


@final
@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """What takes part in a replay.

    ``instruments`` by topic; the first one's readings trigger updates. ``odometry`` is a topic, or ``tf``. ``mounts``
    (4, 4) by frame overrule the log's transforms; ``frames`` are those known before the first message. ``window_ns``
    bounds the stamps of the readings used. ``transform_topics`` are needed to know the odometry or a moving mount.
    """

    localizer: Localizer
    instruments: Mapping[str, Instrument]
    start: Start
    odometry: str
    odom_frame: str
    base_frame: str
    frames: TransformTree
    mounts: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    window_ns: tuple[int, int] = (-(2**63), 2**63 - 1)
    transform_topics: tuple[str, ...] = ()

    @property
    def topics(self) -> set[str]:
        """Topics whose messages the replay needs."""
        return {*self.instruments, self.odometry, *self.transform_topics} - {"tf"}


@final
@dataclass(slots=True)
class ReplayTally:
    """What became of the readings and of the odometry, counted while a replay runs."""

    used: Counter[str] = field(default_factory=Counter)
    skipped: Counter[tuple[str, str]] = field(default_factory=Counter)
    updates: int = 0
    degenerate: int = 0
    distance: float = 0.0
    odometry_gaps: int = 0
    longest_gap_ns: int = 0


def replay(
    events: Iterable[tuple[str, object]], setup: Setup, tally: ReplayTally | None = None
) -> Iterator[TrackPoint]:
    """Filter the decoded messages of a log, (topic, record) in the order of the log; one point per trigger reading.

    Readings wait until odometry has passed their stamp, so that it is interpolated, never extrapolated. Readings
    outside the odometry's span are counted in ``tally.skipped``.
    """
    run = _Run(setup, tally or ReplayTally())
    for topic, record in events:
        run.take(topic, record)
        yield from run.ready()
        if run.finished:
            break
    run.close()


@final
@dataclass(slots=True)
class _Belief:
    """The filter's state after an update, and the odometry it belongs to."""

    state: FilterState
    odom_from_base: NDArray[np.float64]
    estimate: Estimate | None


@final
class _Run:
    """One pass over a log."""

    def __init__(self, setup: Setup, tally: ReplayTally) -> None:
        self._setup = setup
        self._tally = tally
        self._tree = setup.frames.replayed()
        self._path = OdometryPath()
        self._first_odometry_ns: int | None = None
        self._last_trigger_ns = -(2**63)
        self._waiting: list[tuple[int, int, int, str, Reading]] = []
        self._arrivals = 0
        self._ranks = {topic: rank for rank, topic in enumerate(setup.instruments)}
        self._since_update: list[Seen] = []
        self._belief: _Belief | None = None

    @property
    def finished(self) -> bool:
        """Whether odometry has passed the end of the window and nothing waits."""
        return not self._waiting and self._path.ends_after(self._setup.window_ns[1])

    def take(self, topic: str, record: object) -> None:
        """Sort one message in."""
        if isinstance(record, tuple):
            self._take_transforms(record)
        elif isinstance(record, Odometry):
            if topic == self._setup.odometry:
                self._take_odometry(record)
        elif isinstance(record, LaserScan | LandmarkSightings) and topic in self._ranks:
            self._take_reading(topic, record)

    def ready(self) -> Iterator[TrackPoint]:
        """Process the readings that odometry has passed."""
        while self._waiting and self._path.ends_after(self._waiting[0][0] - 1):
            stamp_ns, _, _, topic, reading = heapq.heappop(self._waiting)
            problem = self._problem(stamp_ns, topic, reading)
            if problem:
                self._tally.skipped[topic, problem] += 1
                continue
            yield from self._process(stamp_ns, topic, reading)

    def close(self) -> None:
        """Count what was left waiting for odometry that never came."""
        for stamp_ns, _, _, topic, _ in self._waiting:
            outside = stamp_ns > self._setup.window_ns[1]
            self._tally.skipped[topic, "outside --start and --duration" if outside else "after the odometry's end"] += 1

    def _take_transforms(self, transforms: tuple[Transform, ...]) -> None:
        for transform in transforms:
            self._tree.add(transform)
        if self._setup.odometry != "tf":
            return
        stamp_ns = self._tree.latest_common(self._setup.odom_frame, self._setup.base_frame)
        if stamp_ns is not None:
            matrix = self._tree.lookup(self._setup.odom_frame, self._setup.base_frame, stamp_ns)
            if matrix is not None:
                self._append(stamp_ns, se3.to_planar(matrix))

    def _take_odometry(self, record: Odometry) -> None:
        pose = record.pose
        child = record.child_frame_id
        if child and child != self._setup.base_frame:
            child_from_base = self._tree.lookup(child, self._setup.base_frame, record.stamp_ns)
            if child_from_base is not None:
                pose = se2.compose(pose, se3.to_planar(child_from_base))
        self._append(record.stamp_ns, pose)

    def _append(self, stamp_ns: int, pose: NDArray[np.float64]) -> None:
        last_ns = self._path.last_ns
        if not self._path.append(stamp_ns, pose):
            return
        self._first_odometry_ns = stamp_ns if self._first_odometry_ns is None else self._first_odometry_ns
        if last_ns is not None and stamp_ns - last_ns > _GAP_NS:
            self._tally.odometry_gaps += 1
            self._tally.longest_gap_ns = max(self._tally.longest_gap_ns, stamp_ns - last_ns)

    def _take_reading(self, topic: str, reading: Reading) -> None:
        self._arrivals += 1
        heapq.heappush(self._waiting, (reading.stamp_ns, self._ranks[topic], self._arrivals, topic, reading))

    def _problem(self, stamp_ns: int, topic: str, reading: Reading) -> str:
        """Why a reading is not used, empty if it is."""
        first_ns, last_ns = self._setup.window_ns
        if not first_ns <= stamp_ns <= last_ns:
            return "outside --start and --duration"
        if self._first_odometry_ns is None or stamp_ns < self._first_odometry_ns:
            return "before the odometry's start"
        too_late = self._ranks[topic] == 0 and stamp_ns <= self._last_trigger_ns
        if too_late or not self._path.covers(stamp_ns):
            return "stamp older than readings already used"
        if self._mount(reading) is None:
            return f"no transform from '{self._setup.base_frame}' to '{reading.frame_id}' at its stamp"
        return self._setup.instruments[topic].problem(reading)

    def _mount(self, reading: Reading) -> NDArray[np.float64] | None:
        """``base_from_sensor`` (4, 4) at the reading's stamp."""
        given = self._setup.mounts.get(reading.frame_id, self._setup.mounts.get(""))
        if given is not None:
            return given
        return self._tree.lookup(self._setup.base_frame, reading.frame_id, reading.stamp_ns)

    def _process(self, stamp_ns: int, topic: str, reading: Reading) -> Iterator[TrackPoint]:
        """Use one reading: the first instrument's trigger an update where the gate lets them, others wait for it."""
        odom = self._path.at(stamp_ns)
        triggers = self._ranks[topic] == 0
        belief = self._belief or (self._begin(stamp_ns, odom) if triggers else None)
        if belief is None:
            self._tally.skipped[
                topic, "before the first stated pose" if triggers else "before the first scan used"
            ] += 1
            return
        self._belief = belief
        self._tally.used[topic] += 1
        if not triggers:
            self._since_update.append((topic, reading, odom, self._mount(reading)))
            return
        self._forget(stamp_ns)
        record = None
        if self._is_due(belief, odom, reading):
            belief, record = self._update(belief, stamp_ns, odom, topic, reading)
            self._belief = belief
        yield _point(belief, stamp_ns, odom, record, reading)

    def _begin(self, stamp_ns: int, odom: NDArray[np.float64]) -> _Belief | None:
        localizer = self._setup.localizer
        draws = rng.stream(localizer.seed, rng.Purpose.INITIALISE)
        poses = self._setup.start.place(stamp_ns, self._path, localizer.size.max_particles, draws)
        return None if poses is None else _Belief(initial_state(poses), odom, None)

    def _is_due(self, belief: _Belief, odom: NDArray[np.float64], reading: Reading) -> bool:
        if belief.estimate is None:
            return True
        p = self._setup.localizer.parameters
        if isinstance(reading, LandmarkSightings):
            return policies.has_moved(se2.between(belief.odom_from_base, odom), p.vision_min_d, p.vision_min_a)
        if p.gate == "per_axis":
            return policies.has_moved_on_an_axis(odom - belief.odom_from_base, p.update_min_d, p.update_min_a)
        return policies.has_moved(se2.between(belief.odom_from_base, odom), p.update_min_d, p.update_min_a)

    def _update(
        self, belief: _Belief, stamp_ns: int, odom: NDArray[np.float64], topic: str, reading: Reading
    ) -> tuple[_Belief, StepRecord]:
        increment = se2.between(belief.odom_from_base, odom)
        readings: list[Seen] = [*self._since_update, (topic, reading, odom, self._mount(reading))]
        self._since_update.clear()
        measurements = self._measure(readings, odom)
        state, record = self._setup.localizer.step(belief.state, increment, measurements, stamp_ns)
        self._tally.updates += 1
        self._tally.degenerate += record.degenerate
        self._tally.distance += math.hypot(increment[0], increment[1])
        return _Belief(state, odom, record.estimate), record

    def _measure(self, readings: list[Seen], odom: NDArray[np.float64]) -> list[Measurement]:
        """One measurement per instrument; earlier readings are seen from where the base was at their stamps."""
        parts: dict[str, list[Measurement]] = {topic: [] for topic in self._setup.instruments}
        for topic, reading, odom_then, mount in readings:
            if mount is not None:
                now_from_then = se3.from_planar(se2.between(odom, odom_then))
                parts[topic].append(self._setup.instruments[topic].measure(reading, now_from_then @ mount))
        return [combine(self._setup.instruments[topic], measured) for topic, measured in parts.items()]

    def _forget(self, stamp_ns: int) -> None:
        """Let go of what no reading from here on needs, unless it comes more than 2 s late."""
        self._last_trigger_ns = stamp_ns
        self._path.forget_before(stamp_ns - _KEEP_NS)
        self._tree.forget_before(stamp_ns - _KEEP_NS)


def _point(
    belief: _Belief, stamp_ns: int, odom: NDArray[np.float64], record: StepRecord | None, reading: Reading
) -> TrackPoint:
    """Where the robot is: the last estimate, carried on by odometry since."""
    assert belief.estimate is not None  # noqa: S101 - the first trigger always updates
    pose = se2.compose(belief.estimate.pose, se2.between(belief.odom_from_base, odom))
    estimate = belief.estimate if record else Estimate(pose, belief.estimate.covariance)
    scan = reading if isinstance(reading, LaserScan) else None
    return TrackPoint(stamp_ns, estimate, 0, odom, record, scan)
