"""Everything that is decided before the first message: settings, roles, map, start."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

from mclcli.errors import AmbiguousRobotError, InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from mclcli.cli.chosen import Chosen
    from mclcli.cli.run.options import RunOptions
    from mclcli.cli.run.references import References
    from mclcli.cli.run.start import OperatorPoses
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles
    from mclcli.io.recording.to_map import MapFrame
    from mclcli.records import Transform
    from mclcli.replay.loop import ReplayTally, Setup
    from mclcli.settings.profiles import Settings
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid


@final
@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A log with the settings and the map that it is run with; ``told`` are the poses of an operator to follow."""

    recording: Recording
    settings: Settings
    parts: Roles
    frame: MapFrame
    told: OperatorPoses | None
    grid: OccupancyGrid | None
    setup: Setup
    landmarks: Landmarks | None

    def events(
        self, references: References, pass_on: Callable[[tuple[Transform, ...]], None] | None = None
    ) -> Iterator[tuple[str, object]]:
        """Decoded messages that take part; moving transforms are passed on where somebody keeps them.

        Poses that an operator ``told`` come in the map's frame; those that cannot be brought there do not come.
        """
        own, told = frozenset(self.parts.transform_topics), self.told
        needed = self.setup.topics | references.topics
        if pass_on is not None:
            needed = needed | own
        for topic, record in self.recording.events(needed):
            if pass_on is not None and isinstance(record, tuple) and topic in own:
                pass_on(record)
            references.take(topic, record)
            usable = told.take(record) if told is not None and topic == told.topic else record
            if usable is not None:
                yield topic, usable


def prepare(options: RunOptions) -> Prepared:
    """Open the log, and decide what takes part; says so where there was a choice."""
    from mclcli.cli import console
    from mclcli.cli.chosen import choose_settings, tell_refused
    from mclcli.cli.run.start import operator_poses

    chosen = choose_settings(options.parameters, {}, _from_flags(options))
    recording = _open(options)
    for strand in recording.strands[1:]:
        console.warn(f"{strand.why}: a segment of its own, in which the filter begins anew")
    parts = _assign_roles(options, recording, chosen)
    frame = _frame_of_map(recording, parts, chosen)
    told = operator_poses(recording, frame) if options.follow_initialpose else None
    grid, setup, landmarks = _set_up(options, recording, parts, chosen, frame, told)
    tell_refused(recording)
    return Prepared(recording, chosen.settings, parts, frame, told, grid, setup, landmarks)


def require_updates(tally: ReplayTally, setup: Setup, recording: Recording) -> None:
    """Refuse a run that made no update.

    Raises
    ------
    InputError
        Saying why no reading could be used.

    """
    if tally.updates:
        return
    trigger = next(iter(setup.instruments))
    unread = {(topic, why): n for topic in setup.topics for why, n in recording.tally.skipped.get(topic, {}).items()}
    skipped = (tally.skipped + Counter(unread)).most_common(3)
    reasons = "; ".join(f"{count} {topic}: {why}" for (topic, why), count in skipped)
    raise InputError(f"no message of {trigger} could be used ({reasons or 'there is none'}); `mcl info` shows the log")


def _from_flags(options: RunOptions) -> dict[str, object]:
    given = {"particles": options.particles, "recovery": options.recovery}
    return {name: value for name, value in given.items() if value is not None}


def _open(options: RunOptions) -> Recording:
    from mclcli.cli import console
    from mclcli.io.logs import open_log
    from mclcli.io.recording.recording import Recording

    stdin = sys.stdin.buffer if "-" in options.logs else None
    return Recording(open_log(options.logs, stdin=stdin), strict=options.strict, watch=console.look)


def _assign_roles(options: RunOptions, recording: Recording, chosen: Chosen) -> Roles:
    """Roles of the log's topics and frames; says so where there was a choice."""
    from mclcli.cli.chosen import assigned, names_in
    from mclcli.io.recording import roles

    topics = options.topics
    if topics.vision and topics.landmarks is None:
        raise UsageError("--vision needs --landmarks: where the landmarks stand")
    overruled = {"scan_topic"} if topics.scans else set[str]()
    if options.map_file is not None:
        overruled.add("map_topic")
    names = names_in(recording.survey, chosen, overruled)
    requested = roles.RequestedRoles(
        scan=topics.scans or ((names["scan_topic"],) if names["scan_topic"] else ()),
        odometry=topics.odom or "",
        vision=topics.vision,
        map=names["map_topic"],
        base_frame=names["base_frame_id"],
        odom_frame=names["odom_frame_id"],
        map_frame=chosen.settings.frames.global_frame_id,
        robot=topics.robot or "",
    )
    try:
        parts = assigned(recording, requested)
    except AmbiguousRobotError as error:
        parts = assigned(recording, replace(requested, robot=_robot_at_start(options, recording, error)))
    return parts


def _robot_at_start(options: RunOptions, recording: Recording, error: AmbiguousRobotError) -> str:
    """Name of the robot whose first scan fits where the run starts.

    Raises
    ------
    AmbiguousRobotError
        If no pose and no map is given, or not one robot alone fits.

    """
    from mclcli.cli import console
    from mclcli.cli.run.robot_at_start import robot_at
    from mclcli.cli.run.start import pose_of
    from mclcli.io.recording.robots import find_robots

    pose = pose_of(options.init)
    if options.map_file is None or pose is None:
        raise error
    robots = [robot for robot in find_robots(recording.survey) if robot.name in error.names]
    robot = robot_at(pose, robots, recording.survey, options.map_limits.load(options.map_file))
    if robot is None:
        raise error
    console.remark(f"robot: {robot.name}, the only one whose first scan fits at --init (--robot names one)")
    return robot.name


def _frame_of_map(recording: Recording, parts: Roles, chosen: Chosen) -> MapFrame:
    """What the map's frame is called, by the settings and the log."""
    from mclcli.io.recording.to_map import map_frame

    cure = "--set global_frame_id={frame} says that it is the map's"
    return map_frame(recording.survey, parts, chosen.settings.frames.global_frame_id, cure)


def _set_up(
    options: RunOptions,
    recording: Recording,
    parts: Roles,
    chosen: Chosen,
    frame: MapFrame,
    told: OperatorPoses | None,
) -> tuple[OccupancyGrid | None, Setup, Landmarks | None]:
    from mclcli.cli.chosen import warn_of_turned_map
    from mclcli.cli.run.start import read_start, start_of_file, window_ns
    from mclcli.cli.searching import search_for
    from mclcli.io.maps.field_cache import cached_field
    from mclcli.replay import setup as assemble

    frames = chosen.settings.frames
    grid = _find_map(options, recording, parts, chosen.settings)
    warn_of_turned_map(grid, chosen.settings)
    landmarks = _read_landmarks(options.topics.landmarks)
    if options.init is None:
        start = start_of_file(chosen, grid)
    else:
        start = read_start(options.init, recording, parts.base_frame, frame)
    anywhere = start is None and options.init != "uniform" and not options.follow_initialpose
    start, proposal, search = search_for(chosen.settings, grid, landmarks, parts, start, anywhere=anywhere)
    setup = assemble.prepare(
        recording.survey,
        parts,
        grid=grid,
        landmarks=landmarks,
        settings=chosen.settings,
        start=start,
        proposal=proposal,
        search=search,
        follow=told.topic if told else "",
        map_topic=parts.map if options.map_file is None and frames.map_update == "follow" else "",
        deskew=options.deskew,
        scan_offset_ns=options.scan_offset_ns,
        seed=options.seed,
        temperature=options.sensors.temperature,
        mounts=options.sensors.mounts,
        window_ns=window_ns(options.start, options.duration_ns, recording.first_ns),
        make_field=lambda *what, **how: cached_field(*what, **how)[0],
        threads=options.threads,
    )
    return grid, setup, landmarks


def _read_landmarks(path: Path | None) -> Landmarks | None:
    if path is None:
        return None
    from mclcli.io.tables.landmarks_file import read_landmarks

    return read_landmarks(path)


def _find_map(options: RunOptions, recording: Recording, parts: Roles, settings: Settings) -> OccupancyGrid | None:
    """The map asked for, else the one that the log holds."""
    from mclcli.cli import console
    from mclcli.io.recording import map_topics
    from mclcli.world.occupancy import OccupancyGrid

    if options.map_file is not None:
        return options.map_limits.load(options.map_file)
    if not parts.map:
        return None
    topic = recording.survey.topics[parts.map]
    grids = [topic.sample] if topic.count == 1 else recording.records(parts.map)
    usable = [grid for grid in grids if isinstance(grid, OccupancyGrid)]
    grid = map_topics.pick(parts.map, usable, settings.frames.map_update, console.warn)
    console.remark(f"map: from the log's topic {parts.map}{map_topics.which(grid, usable)}")
    for what in recording.survey.tally.notes.get(parts.map, {}):
        console.remark(f"{parts.map}: {what}")
    return grid
