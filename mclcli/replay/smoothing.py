"""From a filter's run over a log to the best track of it: what the smoother needs is gathered while the filter runs."""

from __future__ import annotations

import dataclasses
from array import array
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry import se2, se3
from mclcli.records import Estimate, LaserScan, StampedPose, TrackPoint
from mclcli.replay.intake import Intake
from mclcli.replay.measuring import sweep_of
from mclcli.replay.tally import ReplayTally
from mclcli.sensors import beams
from mclcli.sensors.instruments import Lidar
from mclcli.smooth import best_track
from mclcli.smooth.scans import Drive, Scans
from mclcli.smooth.surface import Surface
from mclcli.world import distance_field

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.replay.intake import Setup
    from mclcli.sensors.observation import Observation
    from mclcli.smooth.best_track import BestTrack
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.occupancy import OccupancyGrid

    FieldMaker = Callable[..., DistanceField]

_MAX_DIST = 2.0  # [m]
_MOST_BEAMS = 60  # of a scan: more see the same cells, and what their errors repeat would pass for knowledge


class _Seen(NamedTuple):
    """Where beams end and where they point (B, 2), the odometry (3,), and the way to the middle of the sweep (3,)."""

    ends: NDArray[np.float32]
    directions: NDArray[np.float32]
    odometry: FloatArray
    sweep: FloatArray


@final
class Smoothing:
    """Beams and odometry of every scan that the filter states a pose for, in memory that grows by scans, not particles.

    Messages go through ``passing`` on their way to the filter, its points into ``take``; ``finish`` smooths.
    """

    def __init__(self, setup: Setup) -> None:
        if not any(isinstance(instrument, Lidar) for instrument in setup.instruments.values()):
            raise InputError("smoothing needs a lidar and a map; the log is run with landmarks alone")
        self._setup = setup
        self._intake = Intake(setup, ReplayTally())
        self._since: list[Observation] = []
        self._waiting: dict[int, _Seen] = {}
        self._seen: list[_Seen] = []
        self._r_max = 0.0
        self._stamps, self._segments = array("q"), array("q")
        self._poses, self._recorded = array("d"), array("d")

    def passing(self, events: Iterable[tuple[str, object]]) -> Iterator[tuple[str, object]]:
        """The same messages, after what is needed of them was noted."""
        for topic, record in events:
            self._intake.take(topic, record)
            for usable in self._intake.ready():
                if not isinstance(usable, StampedPose):
                    self._note(usable)
            yield topic, record

    def take(self, point: TrackPoint) -> None:
        """Take in what the filter states for one scan."""
        seen = self._waiting.pop(point.stamp_ns, None)
        if seen is None:
            return
        self._seen.append(seen)
        self._stamps.append(point.stamp_ns)
        self._segments.append(point.segment)
        self._poses.extend(point.estimate.pose)
        self._recorded.extend(point.odom_from_base)

    def finish(self, grid: OccupancyGrid, make_field: FieldMaker = distance_field.compute) -> Smoothed:
        """The best track; ``make_field`` computes, or finds, the distances to the walls' faces.

        Raises
        ------
        InputError
            If there is no scan.

        """
        drive = self.drive()
        surface = Surface.of(make_field(grid, "exact", _MAX_DIST, boundary_only=True))
        best = best_track.smooth(drive, self.start, surface)
        recorded = np.array(self._recorded).reshape(-1, 3)
        return Smoothed(best, self.start, self._stamps, self._segments.tolist(), recorded)

    @property
    def start(self) -> FloatArray:
        """The filter's poses (n, 3)."""
        return np.array(self._poses).reshape(-1, 3)

    def drive(self) -> Drive:
        """What was gathered.

        Raises
        ------
        InputError
            If there is no scan.

        """
        if not self._seen:
            raise InputError("no scan to smooth: the filter stated no pose")
        breaks = np.concatenate([[True], np.diff(np.array(self._segments)) != 0])
        odometry, sweeps = (np.array([getattr(one, name) for one in self._seen]) for name in ("odometry", "sweep"))
        return Drive(self._scans(), odometry, breaks, _twists(odometry, np.array(self._stamps), breaks), sweeps)

    def _scans(self) -> Scans:
        counts = np.array([len(one.ends) for one in self._seen], np.int64)
        shape = (len(counts), max(1, int(counts.max())), 2)
        ends, directions = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        for i, (one, count) in enumerate(zip(self._seen, counts.tolist(), strict=True)):
            ends[i, :count], directions[i, :count] = one.ends, one.directions
        return Scans(ends, directions, counts, self._r_max or 1.0)

    def _note(self, observation: Observation) -> None:
        """Keep a scan; those of other lidars go with the next of the one that makes updates."""
        if isinstance(observation.reading, LaserScan):
            self._since.append(observation)
        if not self._intake.triggers(observation.topic):
            return
        now, stamp_ns = observation.odom_from_base, observation.reading.stamp_ns
        parts = [self._beams(one, now) for one in self._since]
        self._since.clear()
        ends = np.concatenate([np.zeros((0, 2), np.float32), *(part[0] for part in parts)])
        directions = np.concatenate([np.zeros((0, 2), np.float32), *(part[1] for part in parts)])
        self._waiting[stamp_ns] = _Seen(ends, directions, now, parts[-1][2] if parts else np.zeros(3))
        self._intake.forget(stamp_ns)

    def _beams(
        self, observation: Observation, now: FloatArray
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], FloatArray]:
        """Ends and directions (B, 2) of the beams with a return, from the base now; way to the middle of the sweep."""
        instrument, reading = self._setup.instruments[observation.topic], observation.reading
        assert isinstance(instrument, Lidar)  # noqa: S101 - the intake asked it whether it can use the scan
        assert isinstance(reading, LaserScan)  # noqa: S101 - see _note
        asked = instrument.selection
        selection = dataclasses.replace(
            asked,
            max_beams=min(asked.max_beams or _MOST_BEAMS, _MOST_BEAMS),
            max_range="skip",
            short_range="skip",
            beam_origin="sensor",
            range_offset=0.0,
        )
        sweep = sweep_of(self._setup, self._intake.path, reading, now)
        mount = observation.base_from_sensor
        if sweep is None:
            mount = se3.from_planar(se2.between(now, observation.odom_from_base)) @ mount
        chosen = beams.select(reading, mount, selection, sweep).with_return()
        self._r_max = max(self._r_max, chosen.r_max)
        middle = np.zeros(3) if sweep is None else sweep(np.array([reading.ranges.size // 2]))[0]
        return chosen.endpoints.astype(np.float32), chosen.directions.astype(np.float32), middle


def _twists(odometry: FloatArray, stamps_ns: IntArray, breaks: BoolArray) -> FloatArray:
    """Velocities (n, 3) at every scan, from the odometry (n, 3) at its neighbours; 0 of a scan without one."""
    n = len(odometry)
    before = np.maximum(np.arange(n) - 1, 0)
    after = np.minimum(np.arange(n) + 1, n - 1)
    before = np.where(breaks, np.arange(n), before)
    after = np.where(breaks[after], np.arange(n), after)
    seconds = (stamps_ns[after] - stamps_ns[before]) * 1e-9
    moved = se2.between(odometry[before], odometry[after])
    return moved / np.where(seconds > 0.0, seconds, 1.0)[:, np.newaxis] * (seconds > 0.0)[:, np.newaxis]


@final
@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """The best track of a log: ``best`` with the filter's poses (n, 3) that it began with, and when each was.

    ``recorded`` (n, 3) is the odometry as the log has it, ``segments`` the pieces of the log.
    """

    best: BestTrack
    filtered: FloatArray
    stamps_ns: array[int]
    segments: list[int]
    recorded: FloatArray

    def points(self) -> Iterator[TrackPoint]:
        """The track, a point per scan."""
        rows = zip(self.stamps_ns, self.best.poses, self.best.covariances, self.segments, self.recorded, strict=True)
        for stamp_ns, pose, covariance, segment, odometry in rows:
            yield TrackPoint(stamp_ns, Estimate(pose, covariance), segment, odometry, measured=True)
