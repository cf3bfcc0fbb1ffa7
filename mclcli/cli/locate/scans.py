"""The scans that ``mcl locate`` looks at, each with what was seen before it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.cli import console
from mclcli.errors import InputError, UsageError
from mclcli.records import LaserScan, StampedPose
from mclcli.sensors.observation import Observation

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.arrays import FloatArray
    from mclcli.cli.chosen import Chosen
    from mclcli.cli.locate.options import LocateOptions
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles
    from mclcli.replay.intake import Setup
    from mclcli.settings.profiles import Settings
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid

    Moment = tuple[Observation, ...]

_SIGHTINGS_NS = 500_000_000  # how old sightings of landmarks may be that count without --window


@final
@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Moments to look at, in order; ``recording`` is the log they are from."""

    moments: Iterable[Moment]
    recording: Recording | None = None

    def __iter__(self) -> Iterator[Moment]:
        return iter(self.moments)

    @property
    def lossy(self) -> bool:
        """Whether something that was needed of the log was damaged."""
        return self.recording is not None and self.recording.tally.lossy


def find(
    options: LocateOptions,
    chosen: Chosen,
    grid: OccupancyGrid,
    landmarks: Landmarks | None,
) -> Moments:
    """What SCAN, --at, --index, --every and --window name.

    Raises
    ------
    UsageError
        If options contradict each other or the kind of SCAN.
    InputError
        If the log has no scan, or no odometry where it is needed.

    """
    from mclcli.cli import one_scan

    at, index, every_ns, window_ns = options.source.at, options.source.index, options.every_ns, options.window_ns or 0
    if every_ns is not None and (at is not None or index is not None):
        raise UsageError("--every looks at the whole log; leave --at and --index out")
    source = options.source.scan
    if source == "-" or not Path(source).exists() or not one_scan.is_log(Path(source)):
        return _one_scan(options, chosen)
    if options.bearings is not None:
        raise UsageError("--bearings go with a single scan; in a log the landmarks' own topic is used")
    recording, parts = one_scan.open_for_scan(options.source, chosen, options.odom)
    if not window_ns and every_ns is None and landmarks is None:
        scan = one_scan.scan_of_log(recording, parts, at, index)
        mount = one_scan.mount_in_log(recording, parts, scan, options.sensors.mounts)
        return Moments([_alone(scan, mount)], recording)
    setup = _setup(options, chosen.settings, grid, landmarks, recording, parts)
    moments = _moments(recording, setup, window_ns)
    if every_ns is not None:
        return Moments(thinned(moments, max(every_ns, 1)), recording)
    if at is None and index is None:
        return Moments(_first_whole(moments, window_ns), recording)
    wanted = one_scan.scan_of_log(recording, parts, at, index)
    return Moments([_that_of(moments, wanted, source)], recording)


def _alone(scan: LaserScan, mount: FloatArray, topic: str = "scan") -> Moment:
    return (Observation(topic, scan, np.zeros(3), mount),)


def _one_scan(options: LocateOptions, chosen: Chosen) -> Moments:
    """A scan as text, and the bearings that belong to it."""
    from mclcli.cli.one_scan import find_scan
    from mclcli.io.tables.landmarks_file import read_bearings

    for_logs = {"--window": options.window_ns, "--every": options.every_ns, "--odom": options.odom}
    for option, value in for_logs.items():
        if value is not None:
            raise UsageError(f"{option}: {options.source.scan} is one scan, not a log; leave the option out")
    if (options.landmarks is None) != (options.bearings is None):
        raise UsageError("--landmarks and --bearings go together: where the landmarks are, and what was seen of them")
    mounted = find_scan(options.source, options.sensors.mounts, chosen)
    moment = _alone(mounted.scan, mounted.base_from_sensor)
    if options.bearings is not None:
        camera = options.sensors.mounts.get("camera", np.eye(4))
        moment = (Observation("bearings", read_bearings(options.bearings), np.zeros(3), camera), *moment)
    return Moments([moment])


def _setup(
    options: LocateOptions,
    settings: Settings,
    grid: OccupancyGrid,
    landmarks: Landmarks | None,
    recording: Recording,
    parts: Roles,
) -> Setup:
    """What takes part, as for a run: scans need odometry to be joined."""
    from mclcli.io.maps.field_cache import cached_field
    from mclcli.io.recording.unusable import no_scan
    from mclcli.replay import setup as assemble

    for line in parts.doubts:
        console.warn(f"odometry: {line}")
    if not parts.scan:
        raise InputError(f"{options.source.scan}: {no_scan(recording.survey)}")
    return assemble.prepare(
        recording.survey,
        parts,
        grid=grid,
        landmarks=landmarks,
        settings=settings,
        mounts=options.sensors.mounts,
        make_field=lambda *what, **how: cached_field(*what, **how)[0],
    )


def _moments(recording: Recording, setup: Setup, window_ns: int) -> Iterator[Moment]:
    """Every scan of the first lidar, after all that was seen within the window before it."""
    from mclcli.replay.intake import Intake
    from mclcli.replay.tally import ReplayTally

    intake = Intake(setup, ReplayTally())
    seen: deque[Observation] = deque()
    segment = 0
    for topic, record in recording.events(setup.topics):
        intake.take(topic, record)
        if intake.segment != segment:
            seen.clear()
            segment = intake.segment
        for usable in intake.ready():
            if isinstance(usable, StampedPose):
                continue
            seen.append(usable)
            stamp_ns = usable.reading.stamp_ns
            while seen[0].reading.stamp_ns < stamp_ns - max(window_ns, _SIGHTINGS_NS):
                seen.popleft()
            if intake.triggers(usable.topic):
                yield tuple(o for o in seen if _counts(o, stamp_ns, window_ns))
                intake.forget(stamp_ns)


def _counts(observation: Observation, now_ns: int, window_ns: int) -> bool:
    scan = isinstance(observation.reading, LaserScan)
    return observation.reading.stamp_ns >= now_ns - (window_ns if scan else max(window_ns, _SIGHTINGS_NS))


def thinned(moments: Iterable[Moment], every_ns: int) -> Iterator[Moment]:
    """The first moment, and after it the first of each ``every_ns`` > 0, counted from the first one's stamp."""
    due: int | None = None
    for moment in moments:
        stamp_ns = moment[-1].reading.stamp_ns
        due = stamp_ns if due is None else due
        if stamp_ns >= due:
            yield moment
            due += every_ns * ((stamp_ns - due) // every_ns + 1)


def _first_whole(moments: Iterator[Moment], window_ns: int) -> Iterator[Moment]:
    """The first moment that has a whole window behind it; the last one of a log that is shorter."""
    first_ns: int | None = None
    moment: Moment | None = None
    for moment in moments:
        stamp_ns = moment[-1].reading.stamp_ns
        first_ns = stamp_ns if first_ns is None else first_ns
        if stamp_ns >= first_ns + window_ns:
            break
    if moment is not None:
        yield moment


def _that_of(moments: Iterator[Moment], wanted: LaserScan, source: str) -> Moment:
    for moment in moments:
        if moment[-1].reading.stamp_ns >= wanted.stamp_ns:
            return moment
    raise InputError(
        f"{source}: the scan lies outside the log's odometry, so none can be joined to it; leave --window out"
    )
