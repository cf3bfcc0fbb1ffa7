"""Messages in, readings out when their time has come: what waits for odometry, what cannot be used, and why.

A log's time may jump back, where a recording was started again: then a new segment begins, with odometry and moving
transforms of its own. Odometry that was set back begins a new segment too, in which the robot may be elsewhere.
"""

from __future__ import annotations

import dataclasses
import heapq
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, final

from mclcli.geometry import se2, se3
from mclcli.motion.odometry import OdometryParameters, OdometryPath
from mclcli.records import LandmarkSightings, LaserScan, NextLog, Odometry, StampedPose, Transform
from mclcli.replay.tally import ReplayTally, Reset
from mclcli.sensors.observation import Observation

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from mclcli.arrays import FloatArray
    from mclcli.filter.localizer import Localizer
    from mclcli.filter.recovery import Proposal
    from mclcli.filter.start import Start
    from mclcli.geometry.frames import TransformTree
    from mclcli.motion.odometry import Jump
    from mclcli.sensors.instruments import Instrument, Reading
    from mclcli.world.occupancy import OccupancyGrid

_GAP_NS = 1_000_000_000
_JUMP_NS = 1_000_000_000  # time going back so far is a new segment; less is disorder
_STEADY_NS = 1_000_000_000  # jumps that follow each other so fast are no resets
_KEEP_NS = 2_000_000_000  # odometry older than this before the last reading is forgotten
_ALWAYS = (-(2**63), 2**63 - 1)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """What takes part in a replay.

    ``instruments`` by topic; the first one's readings trigger updates. ``odometry`` is a topic, or ``tf``. ``mounts``
    (4, 4) by frame overrule the log's transforms; ``frames`` are those known before the first message. ``window_ns``
    bounds the stamps of the readings used. ``transform_topics`` are needed to know the odometry or a moving mount.
    ``follow`` is a topic of poses that an operator states, or empty. ``scan_offset_ns`` is added to the stamps of laser
    scans. With ``deskew`` each beam is scored from where the base was at its own time. ``proposal`` says where a robot
    that seems lost may be; without it no particle is drawn anew. ``search`` places particles where the robot may be
    anywhere once odometry was reset: ``start`` itself if that presupposes nothing; without it the filter goes on.
    Where ``map_topic`` is named, each grid that comes on it is the map from then on: ``over`` makes the instruments.
    """

    localizer: Localizer
    instruments: Mapping[str, Instrument]
    start: Start
    odometry: str
    odom_frame: str
    base_frame: str
    frames: TransformTree
    mounts: Mapping[str, FloatArray] = field(default_factory=dict)
    window_ns: tuple[int, int] = _ALWAYS
    transform_topics: tuple[str, ...] = ()
    follow: str = ""
    scan_offset_ns: int = 0
    deskew: bool = False
    odometry_limits: OdometryParameters = field(default_factory=OdometryParameters)
    proposal: Proposal | None = None
    search: Start | None = None
    map_topic: str = ""
    over: Callable[[OccupancyGrid], Mapping[str, Instrument]] | None = None

    @property
    def topics(self) -> set[str]:
        """Topics whose messages the replay needs."""
        return {*self.instruments, self.odometry, *self.transform_topics, self.follow, self.map_topic} - {"tf", ""}

    def until_ns(self, reading: Reading) -> int:
        """Stamp of the last thing that is scored of a reading: with ``deskew`` of a scan's last beam."""
        if not self.deskew or not isinstance(reading, LaserScan) or not sweeps_briefly(reading):
            return reading.stamp_ns
        return reading.stamp_ns + max(0, round((reading.ranges.size - 1) * reading.time_increment * 1e9))


class Item(NamedTuple):
    """Something that waited for odometry to pass it: a reading, or an operator's pose."""

    stamp_ns: int
    rank: int
    arrival: int
    topic: str
    record: Reading | StampedPose
    until_ns: int


@final
class Intake:
    """One pass over a log. ``path`` and ``segment`` are those of the newest messages.

    ``reset`` is how the newest segment began, None where time jumped back; ``doubt`` the newest one of which what is
    seen after it tells more. ``anew_in`` is the newest segment in which everything begins anew.
    """

    def __init__(self, setup: Setup, tally: ReplayTally) -> None:
        self.path = OdometryPath(setup.odometry_limits)
        self.segment = 0
        self.reset: Reset | None = None
        self.doubt: Reset | None = None
        self.anew_in = 0
        self._setup = setup
        self._tally = tally
        self._tree = setup.frames.replayed()
        self._first_odometry_ns: int | None = None
        self._last_jump_ns = _ALWAYS[0]
        self._odometry_frames = ("", "")
        self._used_until_ns = _ALWAYS[0]
        self._waiting: list[Item] = []
        self._arrivals = 0
        self._ranks = {topic: rank for rank, topic in enumerate(setup.instruments)}
        self._next_segment: list[tuple[str, Reading | StampedPose]] = []

    @property
    def finished(self) -> bool:
        """Whether odometry has passed the end of the window and nothing waits."""
        return not self._waiting and self.path.ends_after(self._setup.window_ns[1])

    def go_on_with(self, setup: Setup) -> None:
        """Take readings in for other instruments on the same topics."""
        self._setup = setup

    def triggers(self, topic: str) -> bool:
        """Whether a topic's readings make updates."""
        return self._ranks.get(topic) == 0

    def take(self, topic: str, record: object) -> None:
        """Sort one message in."""
        if isinstance(record, tuple):
            if topic in self._setup.transform_topics:
                self._take_transforms(record)
        elif isinstance(record, Odometry):
            if topic == self._setup.odometry:
                self._take_odometry(record)
        elif isinstance(record, _READINGS) and topic in self._ranks:
            self._take_reading(topic, self._shifted(record))
        elif isinstance(record, StampedPose) and topic == self._setup.follow:
            self._take_reading(topic, record)
        elif isinstance(record, NextLog):
            self._begin_segment()
            self._tally.further_logs += 1

    def ready(self) -> Iterator[Observation | StampedPose]:
        """What odometry has passed, in the order of stamps; what cannot be used is counted."""
        while self._waiting and self.path.ends_after(self._waiting[0].until_ns - 1):
            item = heapq.heappop(self._waiting)
            usable = self._examine(item)
            if isinstance(usable, str):
                self._tally.skipped[item.topic, usable] += 1
            else:
                yield usable

    def close(self) -> None:
        """Count what was left waiting for odometry that never came."""
        last_ns = self._setup.window_ns[1]
        for item in self._waiting:
            outside = item.stamp_ns > last_ns
            why = "outside --start and --duration" if outside else "after the odometry's end"
            self._tally.skipped[item.topic, why] += 1
        self._waiting.clear()
        self._give_up_next_segment()

    def forget(self, stamp_ns: int) -> None:
        """Let go of what no reading after this trigger needs, unless it comes more than 2 s late."""
        self._used_until_ns = stamp_ns
        self.path.forget_before(stamp_ns - _KEEP_NS)
        self._tree.forget_before(stamp_ns - _KEEP_NS)

    def _mount(self, reading: Reading) -> FloatArray | None:
        """``base_from_sensor`` (4, 4) at the reading's stamp."""
        given = self._setup.mounts.get(reading.frame_id, self._setup.mounts.get(""))
        if given is not None:
            return given
        return self._tree.lookup(self._setup.base_frame, reading.frame_id, reading.stamp_ns)

    def _take_transforms(self, transforms: tuple[Transform, ...]) -> None:
        follows = self._setup.odometry == "tf"
        odom, base = self._setup.odom_frame, self._setup.base_frame
        if follows and any(self._goes_back(t.stamp_ns) for t in transforms if self._carries_odometry(t)):
            self._turn_back()
        for transform in transforms:
            self._tree.add(transform)
        stamp_ns = self._tree.latest_common(odom, base) if follows else None
        if stamp_ns is not None:
            matrix = self._tree.lookup(odom, base, stamp_ns)
            if matrix is not None:
                self._append(stamp_ns, se3.to_planar(matrix))

    def _carries_odometry(self, transform: Transform) -> bool:
        """Whether a transform is a moving edge between odometry's frame and the base."""
        chain = self._tree.ancestors(self._setup.base_frame)
        within = chain[: chain.index(self._setup.odom_frame)] if self._setup.odom_frame in chain else []
        return not transform.static and transform.child in within

    def _take_odometry(self, record: Odometry) -> None:
        if self._goes_back(record.stamp_ns):
            self._turn_back()
        pose = record.pose
        child = record.child_frame_id
        if child and child != self._setup.base_frame:
            child_from_base = self._tree.lookup(child, self._setup.base_frame, record.stamp_ns)
            if child_from_base is not None:
                pose = se2.compose(pose, se3.to_planar(child_from_base))
        frames = record.frame_id, child
        known, self._odometry_frames = self._odometry_frames, frames
        self._append(record.stamp_ns, pose, record.pose, other_frame=frames != known)

    def _goes_back(self, stamp_ns: int) -> bool:
        return self.path.last_ns is not None and stamp_ns < self.path.last_ns - _JUMP_NS

    def _turn_back(self) -> None:
        self._tally.time_jumps += 1
        self._begin_segment()

    def _begin_segment(self) -> None:
        """Leave the old time behind: what still waits in it has no odometry to come."""
        ahead, self._next_segment = self._next_segment, []
        self.close()
        self.path = OdometryPath(self._setup.odometry_limits)
        self._tree = self._setup.frames.replayed()
        self._first_odometry_ns, self._used_until_ns, self._last_jump_ns = None, _ALWAYS[0], _ALWAYS[0]
        self.segment += 1
        self.reset = self.doubt = None
        self.anew_in = self.segment
        self._tally.segments += 1
        for topic, record in ahead:
            self._push(topic, record)

    def _append(
        self, stamp_ns: int, pose: FloatArray, stated: FloatArray | None = None, *, other_frame: bool = False
    ) -> None:
        last_ns = self.path.last_ns
        in_gap = last_ns is not None and stamp_ns - last_ns > _GAP_NS
        if not self.path.append(stamp_ns, pose, stated=stated, other_frame=other_frame and in_gap):
            return
        self._first_odometry_ns = stamp_ns if self._first_odometry_ns is None else self._first_odometry_ns
        if self.path.doubt is not None:
            self.doubt = Reset(self.path.doubt, doubtful=True)
        if self.path.jump is not None:
            self._take_jump(self.path.jump)
        elif last_ns is not None and in_gap:
            self._tally.odometry_gaps += 1
            self._tally.longest_gap_ns = max(self._tally.longest_gap_ns, stamp_ns - last_ns)

    def _take_jump(self, jump: Jump) -> None:
        """Begin a segment where the robot may have been carried.

        Odometry that jumped just before is not reset: it means nothing.
        """
        self._tally.odometry_jumps += 1
        steady = self._last_jump_ns < jump.after_ns - _STEADY_NS
        self._last_jump_ns = jump.after_ns
        if not steady:
            return
        reset = Reset(jump)
        self._tally.resets.append(reset)
        if not reset.divides:
            self.doubt = reset
            return
        self._drop_before(jump.after_ns)
        self.reset, self.doubt = reset, None
        self.segment += 1
        self._tally.segments += 1

    def _drop_before(self, stamp_ns: int) -> None:
        """Count what was seen while odometry was set back: nobody knows where from."""
        kept = [item for item in self._waiting if item.stamp_ns >= stamp_ns]
        for item in self._waiting:
            if item.stamp_ns < stamp_ns:
                self._tally.skipped[item.topic, "while odometry was set back"] += 1
        self._waiting[:] = kept
        heapq.heapify(self._waiting)

    def _shifted(self, reading: Reading) -> Reading:
        if not isinstance(reading, LaserScan) or not self._setup.scan_offset_ns:
            return reading
        return dataclasses.replace(reading, stamp_ns=reading.stamp_ns + self._setup.scan_offset_ns)

    def _take_reading(self, topic: str, record: Reading | StampedPose) -> None:
        """Let a reading wait; one from before the last used one waits for odometry to jump back after it."""
        if record.stamp_ns < self._used_until_ns - _JUMP_NS:
            self._next_segment.append((topic, record))
            return
        self._give_up_next_segment()
        self._push(topic, record)

    def _give_up_next_segment(self) -> None:
        for topic, _ in self._next_segment:
            self._tally.skipped[topic, _TOO_OLD] += 1
        self._next_segment.clear()

    def _push(self, topic: str, record: Reading | StampedPose) -> None:
        self._arrivals += 1
        rank = self._ranks.get(topic, -1)  # an operator's pose comes before readings of its stamp
        until_ns = record.stamp_ns if isinstance(record, StampedPose) else self._setup.until_ns(record)
        heapq.heappush(self._waiting, Item(record.stamp_ns, rank, self._arrivals, topic, record, until_ns))

    def _examine(self, item: Item) -> Observation | StampedPose | str:
        """What is made of something that waited, or why it is not used."""
        problem, record = self._problem(item), item.record
        if problem:
            return problem
        if isinstance(record, StampedPose):
            return record
        mount = self._mount(record)
        if mount is None:
            return f"no transform from '{self._setup.base_frame}' to '{record.frame_id}' at its stamp"
        if self._setup.deskew and isinstance(record, LaserScan) and not sweeps_briefly(record):
            return f"scan with time_increment {record.time_increment:g}"
        problem = self._setup.instruments[item.topic].problem(record)
        return problem or Observation(item.topic, record, self.path.at(item.stamp_ns), mount)

    def _problem(self, item: Item) -> str:
        """Why something cannot be used at its stamp, empty if it can."""
        first_ns, last_ns = self._setup.window_ns
        if not first_ns <= item.stamp_ns <= last_ns:
            return "outside --start and --duration"
        record = item.record
        if isinstance(record, StampedPose):
            own = {self._setup.odom_frame, self._setup.base_frame}
            return f"given in frame '{record.frame_id}', not in the map's" if record.frame_id in own else ""
        if self._first_odometry_ns is None or item.stamp_ns < self._first_odometry_ns:
            return "before the odometry's start"
        too_late = item.rank == 0 and item.stamp_ns <= self._used_until_ns
        if too_late or not self.path.covers(item.stamp_ns):
            return _TOO_OLD
        return ""


def sweeps_briefly(scan: LaserScan) -> bool:
    """Whether a scan's beams are less than a minute apart: a ``time_increment`` that says otherwise is damage."""
    return abs(scan.ranges.size * scan.time_increment) < _LONGEST_SWEEP


_LONGEST_SWEEP = 60.0  # s
_READINGS = (LaserScan, LandmarkSightings)  # told once: a union written where it is asked for is made every time
_TOO_OLD = "stamp older than readings already used"
