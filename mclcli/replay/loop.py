"""A recorded log through the filter: messages in, track points out.

``replay`` is the loop; ``Setup`` says what takes part. ``mclcli.replay.setup`` makes one from a log and a map.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

from mclcli import rng
from mclcli.filter import particles
from mclcli.filter.localizer import FilterState, initial_state
from mclcli.filter.recovery import Situation
from mclcli.filter.start import Opening, Patience, Placed, carried, spread_of
from mclcli.geometry import se2
from mclcli.records import Estimate, LandmarkSightings, LaserScan, StampedPose, StepRecord, TrackPoint
from mclcli.replay.intake import Intake, Setup
from mclcli.replay.measuring import has_moved, has_moved_on_an_axis, measure
from mclcli.replay.tally import ReplayTally, Reset
from mclcli.world.occupancy import OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.arrays import FloatArray
    from mclcli.filter.recovery import Propose
    from mclcli.sensors import Measurement
    from mclcli.sensors.observation import Observation

__all__ = ["ReplayTally", "Setup", "replay"]

_LOOKED_BACK = 12  # updates that a search for a lost robot looks at
_WATCHED = 5  # updates after doubtful odometry that say whether it was motion


def replay(
    events: Iterable[tuple[str, object]], setup: Setup, tally: ReplayTally | None = None
) -> Iterator[TrackPoint]:
    """Filter the decoded messages of a log, (topic, record) in the order of the log; one point per trigger reading.

    Readings wait until odometry has passed their stamp, so that it is interpolated, never extrapolated. Readings
    outside the odometry's span are counted in ``tally.skipped``.
    """
    tally = tally or ReplayTally()
    intake = Intake(setup, tally)
    run = _Run(setup, tally, intake)
    for topic, record in events:
        if topic == setup.map_topic and isinstance(record, OccupancyGrid):
            run.change_map(record)
        intake.take(topic, record)
        for usable in intake.ready():
            yield from run.take(usable)
        if intake.finished:
            break
    intake.close()
    yield from run.close()


@final
@dataclass(slots=True)
class _Belief:
    """The filter's state after an update, and the odometry it belongs to."""

    state: FilterState
    odom_from_base: FloatArray
    estimate: Estimate | None


@final
@dataclass(frozen=True, slots=True)
class _Update:
    """What an update made of a belief, from what."""

    state: FilterState
    record: StepRecord
    observations: tuple[Observation, ...]
    measurements: list[Measurement]
    increment: FloatArray


@final
@dataclass(slots=True)
class _Watch:
    """Odometry that was reset, or may have been, the belief before it, and the updates that are still to tell."""

    reset: Reset
    before: _Belief
    left: int = _WATCHED


@final
class _Run:
    """The filter between two readings."""

    def __init__(self, setup: Setup, tally: ReplayTally, intake: Intake) -> None:
        self._setup = setup
        self._tally = tally
        self._intake = intake
        self._segment = 0
        self._seen_segment = 0
        self._start = setup.start
        self._doubted: Reset | None = None
        self._watch: _Watch | None = None
        self._lost = False
        self._next_step = 0
        self._told: StampedPose | None = None
        self._held: list[Observation] = []
        self._since_update: list[Observation] = []
        self._astray: deque[tuple[Observation, ...]] = deque(maxlen=_LOOKED_BACK)
        self._belief: _Belief | None = None
        self._map = ""

    def take(self, usable: Observation | StampedPose) -> Iterator[TrackPoint]:
        """Use one reading, or a pose that somebody gave: the next trigger begins anew around it."""
        if self._intake.segment != self._seen_segment:
            yield from self._begin_segment()
        elif self._intake.doubt is not self._doubted:
            self._doubted = self._intake.doubt
            self._watch_out(self._doubted)
        if isinstance(usable, StampedPose):
            self._told = usable
            self._tally.restarts += 1
            self._restart()
        else:
            yield from self._begin(usable) if self._belief is None else self._process(usable)

    def change_map(self, grid: OccupancyGrid) -> None:
        """Score over another map from here on; one without an obstacle is counted and left."""
        if self._setup.over is None or not grid.occupied.any():
            self._tally.skipped[self._setup.map_topic, "map without an occupied cell"] += 1
            return
        if grid.digest() == self._map:
            return
        self._map, before = grid.digest(), self._map
        if not before:  # the one that the run began with
            return
        self._setup = replace(self._setup, instruments=self._setup.over(grid))
        self._intake.go_on_with(self._setup)
        self._tally.maps += 1

    def close(self) -> Iterator[TrackPoint]:
        """No more readings will come: a start that holds some has to answer now."""
        if self._held:
            yield from self._open(complete=True)
        for observation in self._held:
            self._tally.skipped[observation.topic, "before the start was found"] += 1
        self._held.clear()

    def _begin_segment(self) -> Iterator[TrackPoint]:
        """Begin as at the start, but where odometry was reset, search for the robot or go on."""
        anew = self._intake.anew_in > self._seen_segment
        self._segment += self._intake.segment - self._seen_segment
        self._seen_segment, self._doubted = self._intake.segment, self._intake.doubt
        reset = self._intake.reset
        if anew or reset is None:
            yield from self.close()
            self._start, self._told = self._setup.start, None
            self._restart()
        elif self._searches(reset):
            yield from self.close()
            self._search(reset)
        else:
            self._watch_out(reset)

    def _searches(self, reset: Reset) -> bool:
        """Whether the robot is searched for at once: one that began anywhere and may have been carried, or is lost."""
        search = self._setup.search
        return search is not None and (self._lost or (reset.jump.in_gap and search is self._setup.start))

    def _search(self, reset: Reset) -> None:
        """Begin anew wherever the robot may be."""
        assert self._setup.search is not None  # noqa: S101 - the callers asked
        reset.searched = True
        self._start, self._told = self._setup.search, None
        self._restart()

    def _watch_out(self, reset: Reset | None) -> None:
        """Let the next updates tell whether the robot is where odometry, or standing still, has it."""
        belief = self._belief
        known = belief is not None and belief.estimate is not None and not self._lost
        self._watch = _Watch(reset, belief) if reset is not None and belief is not None and known else None

    def _restart(self) -> None:
        """Forget where the robot was believed to be."""
        self._belief = self._watch = None
        self._lost = False
        self._since_update.clear()
        self._astray.clear()

    def _begin(self, observation: Observation) -> Iterator[TrackPoint]:
        """Ask the start for particles at the first trigger; it may want to see more readings first."""
        if not self._held and not self._intake.triggers(observation.topic):
            self._tally.skipped[observation.topic, "before the first scan used"] += 1
            return
        self._held.append(observation)
        yield from self._open(complete=False)

    def _open(self, *, complete: bool) -> Iterator[TrackPoint]:
        first = self._held[0]
        poses = self._place(Opening(first.reading.stamp_ns, self._intake.path, tuple(self._held), complete))
        if poses is Patience.HOLD:
            return
        held, self._held = self._held, []
        if poses is Patience.SKIP:
            self._tally.skipped[first.topic, "before the first pose given"] += 1
            for observation in held[1:]:
                yield from self._begin(observation)
            return
        if isinstance(poses, Placed):
            self._tally.found.append((first.reading.stamp_ns, poses))
        placed = (poses.poses, poses.modes) if isinstance(poses, Placed) else (poses, None)
        state = initial_state(placed[0], self._next_step, placed[1])
        self._belief = _Belief(state, first.odom_from_base, None)
        for observation in held:
            yield from self._process(observation)

    def _place(self, opening: Opening) -> FloatArray | Placed | Patience:
        """First particles: around the operator's last pose, else where the start says."""
        localizer = self._setup.localizer
        n, draws = localizer.size.max_particles, rng.stream(localizer.seed, rng.Purpose.INITIALISE, self._next_step)
        if self._told is None:
            return self._start.place(opening, n, draws)
        pose = carried(self._told, opening.stamp_ns, opening.path)
        return particles.gaussian(pose, spread_of(self._told), n, draws)

    def _process(self, observation: Observation) -> Iterator[TrackPoint]:
        """Use one reading: the first instrument's trigger an update where the gate lets them, others wait for it."""
        belief = self._belief
        assert belief is not None  # noqa: S101 - the callers made one
        if not self._intake.triggers(observation.topic):
            self._tally.used[observation.topic] += 1
            self._since_update.append(observation)
            return
        record = None
        if self._is_due(belief, observation):
            update = self._update(belief, observation)
            if self._does_not_fit(update.record):
                reset = self._told_by_scans()
                if self._setup.search is not None:
                    self._search(reset)
                    yield from self._begin(observation)
                    return
                update = self._stood_still(update, observation)
            belief, record = self._accept(update), update.record
        self._tally.used[observation.topic] += 1
        yield self._point(belief, observation, record)
        self._intake.forget(observation.reading.stamp_ns)

    def _does_not_fit(self, record: StepRecord) -> bool:
        """Whether an update after doubtful odometry says that the robot is not there."""
        watch = self._watch
        if watch is None:
            return False
        if record.lost:
            return True
        watch.left -= 1
        self._watch = watch if watch.left else None
        return False

    def _told_by_scans(self) -> Reset:
        """The reset that the watched odometry was: a segment begins if it did not yet."""
        watch = self._watch
        assert watch is not None  # noqa: S101 - an update did not fit
        if watch.reset.doubtful:
            self._tally.resets.append(watch.reset)
        if not watch.reset.divides:
            self._tally.segments += 1
            self._segment += 1
        return watch.reset

    def _stood_still(self, update: _Update, observation: Observation) -> _Update:
        """The update as if the robot had not moved in the gap, if that fits; without a search there is nothing else."""
        watch, self._watch = self._watch, None
        assert watch is not None  # noqa: S101 - an update did not fit
        update = dataclasses.replace(update, record=dataclasses.replace(update.record, segment=self._segment))
        jump, before, path = watch.reset.jump, watch.before, self._intake.path
        first = before.state.step == update.record.step and observation.reading.stamp_ns >= jump.after_ns
        if not watch.reset.doubtful or not first:
            return update
        moved = se2.between(before.odom_from_base, path.at(jump.before_ns))
        odom = se2.compose(path.at(jump.after_ns), se2.inverse(moved))  # all but the step in doubt
        other = self._update(dataclasses.replace(before, odom_from_base=odom), observation)
        return update if other.record.lost else other

    def _is_due(self, belief: _Belief, observation: Observation) -> bool:
        if belief.estimate is None:
            return True
        p, before, odom = self._setup.localizer.parameters, belief.odom_from_base, observation.odom_from_base
        if isinstance(observation.reading, LandmarkSightings):
            return has_moved(se2.between(before, odom), p.vision_min_d, p.vision_min_a)
        if p.gate == "per_axis":
            return has_moved_on_an_axis(odom - before, p.update_min_d, p.update_min_a)
        return has_moved(se2.between(before, odom), p.update_min_d, p.update_min_a)

    def _update(self, belief: _Belief, observation: Observation) -> _Update:
        """What an update would make of a belief; nothing is changed yet."""
        odom = observation.odom_from_base
        increment = se2.between(belief.odom_from_base, odom)
        observations = (*self._since_update, observation)
        measurements = measure(self._setup, self._intake.path, observations, odom)
        state, record = self._setup.localizer.step(
            belief.state,
            increment,
            measurements,
            observation.reading.stamp_ns,
            self._segment,
            self._proposer(observations, odom),
        )
        return _Update(state, record, observations, measurements, increment)

    def _accept(self, update: _Update) -> _Belief:
        """Make an update the belief."""
        record, increment = update.record, update.increment
        self._since_update.clear()
        self._lost = record.lost
        if not self._lost:
            self._astray.clear()
        elif self._setup.proposal is not None:
            self._astray.append(update.observations)
        self._next_step = update.state.step
        self._tally.take_update(record, update.measurements)
        self._tally.judge(record)
        self._tally.distance += math.hypot(increment[0], increment[1])
        self._belief = _Belief(update.state, update.observations[-1].odom_from_base, record.estimate)
        return self._belief

    def _proposer(self, observations: tuple[Observation, ...], odom: FloatArray) -> Propose | None:
        """The proposal, told what this update has seen, and those just before it that did not fit either."""
        proposal, path = self._setup.proposal, self._intake.path
        if proposal is None:
            return None
        seen = (*itertools.chain(*self._astray), *observations)
        return lambda record, n, draws: proposal(Situation(record, seen, odom, path), n, draws)

    def _point(self, belief: _Belief, observation: Observation, record: StepRecord | None) -> TrackPoint:
        """Where the robot is: the last estimate, carried on by odometry since."""
        assert belief.estimate is not None  # noqa: S101 - the first trigger always updates
        reading = observation.reading
        estimate, now = belief.estimate, observation.odom_from_base
        if record is None:
            moved = se2.between(belief.odom_from_base, now)
            estimate = Estimate(se2.compose(estimate.pose, moved), estimate.covariance)
        scan = reading if isinstance(reading, LaserScan) else None
        odom = self._intake.path.recorded(reading.stamp_ns, now)
        return TrackPoint(reading.stamp_ns, estimate, self._segment, odom, record, scan)
