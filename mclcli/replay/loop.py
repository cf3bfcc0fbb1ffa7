"""A recorded log through the filter: messages in, track points out.

``replay`` is the loop; ``Setup`` says what takes part. ``mclcli.replay.setup`` makes one from a log and a map.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import rng
from mclcli.filter import fit, particles
from mclcli.filter.localizer import FilterState, initial_state
from mclcli.filter.recovery import Situation
from mclcli.filter.start import Opening, Patience, carried, spread_of
from mclcli.geometry import se2, se3
from mclcli.records import Estimate, LandmarkSightings, LaserScan, StampedPose, StepRecord, TrackPoint
from mclcli.replay.intake import Intake, ReplayTally, Setup
from mclcli.sensors.instruments import combine

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.filter.recovery import Propose
    from mclcli.sensors import Measurement
    from mclcli.sensors.beams import Sweep
    from mclcli.sensors.instruments import Reading
    from mclcli.sensors.observation import Observation

__all__ = ["ReplayTally", "Setup", "replay"]

_LOOKED_BACK = 12  # updates that a search for a lost robot looks at


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
class _Run:
    """The filter between two readings."""

    def __init__(self, setup: Setup, tally: ReplayTally, intake: Intake) -> None:
        self._setup = setup
        self._tally = tally
        self._intake = intake
        self._segment = 0
        self._next_step = 0
        self._told: StampedPose | None = None
        self._held: list[Observation] = []
        self._since_update: list[Observation] = []
        self._astray: deque[tuple[Observation, ...]] = deque(maxlen=_LOOKED_BACK)
        self._belief: _Belief | None = None

    def take(self, usable: Observation | StampedPose) -> Iterator[TrackPoint]:
        """Use one reading, or a pose that somebody gave: the next trigger begins anew around it."""
        if self._intake.segment != self._segment:
            yield from self.close()
            self._segment, self._told = self._intake.segment, None
            self._restart()
        if isinstance(usable, StampedPose):
            self._told = usable
            self._tally.restarts += 1
            self._restart()
        else:
            yield from self._begin(usable) if self._belief is None else self._process(usable)

    def close(self) -> Iterator[TrackPoint]:
        """No more readings will come: a start that holds some has to answer now."""
        if self._held:
            yield from self._open(complete=True)
        for observation in self._held:
            self._tally.skipped[observation.topic, "before the start was found"] += 1
        self._held.clear()

    def _restart(self) -> None:
        """Forget where the robot was believed to be."""
        self._belief = None
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
        self._belief = _Belief(initial_state(poses, self._next_step), first.odom_from_base, None)
        for observation in held:
            yield from self._process(observation)

    def _place(self, opening: Opening) -> FloatArray | Patience:
        """First particles: around the operator's last pose, else where the start says."""
        localizer = self._setup.localizer
        n, draws = localizer.size.max_particles, rng.stream(localizer.seed, rng.Purpose.INITIALISE, self._next_step)
        if self._told is None:
            return self._setup.start.place(opening, n, draws)
        pose = carried(self._told, opening.stamp_ns, opening.path)
        return particles.gaussian(pose, spread_of(self._told), n, draws)

    def _process(self, observation: Observation) -> Iterator[TrackPoint]:
        """Use one reading: the first instrument's trigger an update where the gate lets them, others wait for it."""
        belief = self._belief
        assert belief is not None  # noqa: S101 - the callers made one
        self._tally.used[observation.topic] += 1
        if not self._intake.triggers(observation.topic):
            self._since_update.append(observation)
            return
        reading, record = observation.reading, None
        if self._is_due(belief, observation):
            belief, record = self._update(belief, observation)
            self._belief = belief
        yield self._point(belief, observation, record)
        self._intake.forget(reading.stamp_ns)

    def _is_due(self, belief: _Belief, observation: Observation) -> bool:
        if belief.estimate is None:
            return True
        p, before, odom = self._setup.localizer.parameters, belief.odom_from_base, observation.odom_from_base
        if isinstance(observation.reading, LandmarkSightings):
            return has_moved(se2.between(before, odom), p.vision_min_d, p.vision_min_a)
        if p.gate == "per_axis":
            return has_moved_on_an_axis(odom - before, p.update_min_d, p.update_min_a)
        return has_moved(se2.between(before, odom), p.update_min_d, p.update_min_a)

    def _update(self, belief: _Belief, observation: Observation) -> tuple[_Belief, StepRecord]:
        odom = observation.odom_from_base
        increment = se2.between(belief.odom_from_base, odom)
        observations = (*self._since_update, observation)
        self._since_update.clear()
        measurements = self._measure(observations, odom)
        state, record = self._setup.localizer.step(
            belief.state,
            increment,
            measurements,
            observation.reading.stamp_ns,
            self._segment,
            self._proposer(observations, odom),
        )
        lost = record.reliability < fit.PROBABLY_LOST
        if not lost:
            self._astray.clear()
        elif self._setup.proposal is not None:
            self._astray.append(observations)
        self._next_step = state.step
        self._tally.take_update(record, measurements)
        self._tally.judge(record, lost=lost)
        self._tally.distance += math.hypot(increment[0], increment[1])
        return _Belief(state, odom, record.estimate), record

    def _proposer(self, observations: tuple[Observation, ...], odom: FloatArray) -> Propose | None:
        """The proposal, told what this update has seen, and those just before it that did not fit either."""
        proposal, path = self._setup.proposal, self._intake.path
        if proposal is None:
            return None
        seen = (*itertools.chain(*self._astray), *observations)
        return lambda record, n, draws: proposal(Situation(record, seen, odom, path), n, draws)

    def _measure(self, observations: Sequence[Observation], odom: FloatArray) -> list[Measurement]:
        """One measurement per instrument; earlier readings are seen from where the base was at their stamps."""
        parts: dict[str, list[Measurement]] = {topic: [] for topic in self._setup.instruments}
        for observation in observations:
            instrument, reading = self._setup.instruments[observation.topic], observation.reading
            sweep = self._sweep(reading, odom)
            if sweep is None:
                now_from_then = se3.from_planar(se2.between(odom, observation.odom_from_base))
                measured = instrument.measure(reading, now_from_then @ observation.base_from_sensor)
            else:
                measured = instrument.measure(reading, observation.base_from_sensor, sweep)
            parts[observation.topic].append(measured)
        return [combine(self._setup.instruments[topic], measured) for topic, measured in parts.items()]

    def _sweep(self, reading: Reading, odom: FloatArray) -> Sweep | None:
        """Where the base was at each beam of a scan, seen from the update's base; None if all count as at the stamp."""
        if not isinstance(reading, LaserScan) or self._setup.until_ns(reading) == reading.stamp_ns:
            return None
        path, increment_ns = self._intake.path, reading.time_increment * 1e9
        return lambda beams: se2.between(
            odom, path.along(reading.stamp_ns + np.round(beams * increment_ns).astype(np.int64))
        )

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


def has_moved(increment: FloatArray, min_d: float, min_a: float) -> bool:
    """Whether the base moved (Euclidean, [m]) or turned [rad] far enough since the last update for another one."""
    return math.hypot(increment[0], increment[1]) >= min_d or abs(float(increment[2])) >= min_a


def has_moved_on_an_axis(difference: FloatArray, min_d: float, min_a: float) -> bool:
    """nav2_amcl's gate: x, y [m] or yaw [rad] of the odometry's own frame differ by more than the thresholds."""
    yaw = math.remainder(difference[2], 2.0 * math.pi)
    return abs(difference[0]) > min_d or abs(difference[1]) > min_d or abs(yaw) > min_a
