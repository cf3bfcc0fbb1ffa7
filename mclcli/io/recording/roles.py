"""Which topic plays which part, by type, frames and names, and why."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, final

from mclcli.errors import AmbiguousRobotError, InputError, UsageError, nearest_name
from mclcli.geometry.frames import TransformTree
from mclcli.io.recording import cameras, lidars, map_topics, odometry_sources
from mclcli.io.recording.kinds import MAP, ODOMETRY, POSES, SCAN, SIGHTINGS, TF, is_truth
from mclcli.io.recording.robots import Robot, find_robots
from mclcli.io.recording.unusable import problem
from mclcli.records import Odometry
from mclcli.text import clean
from mclcli.world.occupancy import OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.io.recording.odometry_sources import Source
    from mclcli.io.recording.survey import LogSurvey, TopicSurvey

ALL = "all"
"""In place of a topic of laser scans: every lidar of the robot."""


@final
@dataclass(frozen=True, slots=True)
class Roles:
    """Who does what in a log. Topics are empty where nobody plays the part; ``reasons`` says why, role by role.

    ``odometry`` is a topic or ``tf``; ``odom_frame`` and ``base_frame`` are the ends of the odometry used. ``robot`` is
    whose roles these are, where there are several; its ``frames`` have the transforms of ``transform_topics``.
    ``doubts`` are lines about what is used although something speaks against it.
    """

    scan: tuple[str, ...] = ()
    odometry: str = ""
    vision: tuple[str, ...] = ()
    truth: str = ""
    map: str = ""
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    reasons: dict[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    robot: str = ""
    namespace: str = "/"
    frames: TransformTree = field(default_factory=lambda: TransformTree(keep_history=False), compare=False)
    transform_topics: tuple[str, ...] = ()


@final
@dataclass(frozen=True, slots=True)
class RequestedRoles:
    """What the user named; everything else is found. ``scan`` may be ``all`` alone."""

    scan: tuple[str, ...] = ()
    odometry: str = ""
    vision: tuple[str, ...] = ()
    map: str = ""
    base_frame: str = ""
    odom_frame: str = ""
    map_frame: str = "map"
    robot: str = ""


def assign(survey: LogSurvey, requested: RequestedRoles = RequestedRoles()) -> Roles:
    """Give out the roles, all of them to one robot.

    Raises
    ------
    UsageError
        If a topic or robot the user named is not in the log, or not of a type that fits, or if there are several robots
        and nothing says which one is meant.
    InputError
        If the frame of odometry that the user named is not above the base.

    """
    requested = _as_recorded(survey, requested)
    named = (requested.odometry,) if requested.odometry not in {"", TF} else ()
    scans = () if requested.scan == (ALL,) else requested.scan
    mapped = (requested.map,) if requested.map else ()
    for names, types in ((scans, SCAN), (requested.vision, SIGHTINGS), (named, ODOMETRY), (mapped, MAP)):
        for name in names:
            _check(survey, name, types)
    _settle_parents(survey, requested.odom_frame)
    robots = find_robots(survey, requested.base_frame, {*scans, *requested.vision, *named})
    robot, reasons = _choose(robots, requested)
    robot = _with_scans(robot, robots, scans)
    order, why = lidars.by_view(survey, robot) if robot.scans else ([], "")
    scan = scans or tuple(order if requested.scan else order[:1])
    if why and not requested.scan:
        reasons["scan"] = why
    chosen_map, why = map_topics.choose(survey, robot, {"map", requested.map_frame}, robots)
    if why and not requested.map:
        reasons["map"] = why
    if robot.joined:
        reasons["frames"] = f"transforms of {' and '.join(map(clean, robot.joined))} joined: one way needs both"
    source, doubts = _odometry(survey, robot, requested, requested.map or chosen_map, reasons)
    vision = requested.vision or _by_calibration(survey, robot)
    cameras.explain(survey, vision, reasons)
    return Roles(
        scan=scan,
        odometry=source.name if source else "",
        vision=vision,
        truth=_find_truth(survey, robot, robots, reasons),
        map=requested.map or chosen_map,
        odom_frame=(source.frame if source else "") or requested.odom_frame or "odom",
        base_frame=_base_frame(robot, requested, source),
        reasons=reasons,
        doubts=doubts,
        robot=robot.name if len(robots) > 1 else "",
        namespace=robot.namespace,
        frames=robot.frames,
        transform_topics=robot.transform_topics,
    )


def _as_recorded(survey: LogSurvey, requested: RequestedRoles) -> RequestedRoles:
    """The request with its topics named as the log names them."""
    named = survey.topic_named
    return replace(
        requested,
        scan=requested.scan if requested.scan == (ALL,) else tuple(map(named, requested.scan)),
        odometry=TF if requested.odometry == TF else named(requested.odometry),
        vision=tuple(map(named, requested.vision)),
        map=named(requested.map),
    )


def initialpose(survey: LogSurvey, namespace: str = "/") -> str:
    """Topic on which an operator told the robot where it was, empty if there is none.

    One in the robot's namespace goes before others; of several names the shortest counts.
    """
    names = [topic.channel.topic for topic in survey.of_type("geometry_msgs/msg/PoseWithCovarianceStamped")]
    topics = sorted(name for name in names if name.rpartition("/")[2] == "initialpose")
    return min(topics, key=lambda name: (not name.startswith(namespace), len(name)), default="")


def _settle_parents(survey: LogSurvey, odom_frame: str) -> None:
    """Choose one parent for each frame that is stated below several by turns: the one that odometry is told in."""
    told = [t.sample.frame_id for t in survey.of_type(*ODOMETRY) if isinstance(t.sample, Odometry)]
    for space in survey.transforms.values():
        for child, parents in space.tree.contested.items():
            seen = {parent: space.sampled[parent, child].seen for parent in parents if (parent, child) in space.sampled}
            best = max(
                parents, key=lambda name: (name == odom_frame, name in told, "odom" in name, seen.get(name, 0), name)
            )
            space.tree.choose_parent(child, best)


def _choose(robots: Sequence[Robot], requested: RequestedRoles) -> tuple[Robot, dict[str, str]]:
    """The robot that is meant, and why it is this one where there are others."""
    if requested.robot:
        exact = [robot for robot in robots if robot.name == requested.robot]
        meant = exact or [robot for robot in robots if robot.answers_to(requested.robot)]
        if len(meant) != 1:
            names = ", ".join(robot.name for robot in robots)
            raise UsageError(
                f"--robot: no robot '{requested.robot}' in the log; it has {names or 'one without a name'}"
            )
        return meant[0], {}
    implied = [robot for robot in robots if _is_implied(robot, requested)] or list(robots)
    complete = [robot for robot in implied if robot.is_complete]
    if len(robots) == 1 or len(implied) == 1 or len(complete) == 1:
        robot = implied[0] if len(implied) == 1 else complete[0] if complete else robots[0]
        others = ", ".join(other.name for other in robots if other is not robot)
        how = "the one that is named" if len(implied) < len(robots) else "the only one with sensors and odometry"
        return robot, {"robot": f"{how}; not {others}"} if others else {}
    if not complete:
        return implied[0], {}
    raise AmbiguousRobotError([clean(robot.name) for robot in complete])


def _is_implied(robot: Robot, requested: RequestedRoles) -> bool:
    """Whether everything that is named fits this robot."""
    own = {*robot.scans, *robot.vision}
    sensors = [name for name in (*requested.scan, *requested.vision) if name != ALL]
    return (
        all(name in own for name in sensors[:1])
        and requested.base_frame in {"", robot.base}
        and (requested.odometry in {"", TF} or requested.odometry in robot.odometry or bool(sensors))
        and (not requested.odom_frame or sensors != [] or requested.odom_frame in robot.frames.ancestors(robot.base))
    )


def _with_scans(robot: Robot, robots: Sequence[Robot], scans: tuple[str, ...]) -> Robot:
    """The robot with transforms of others, if scans are named that others have."""
    others = [other for other in robots if other is not robot and set(other.scans) & set(scans)]
    if not others:
        return robot
    topics = dict.fromkeys(topic for one in (robot, *others) for topic in one.transform_topics)
    frames = TransformTree.union([robot.frames, *(other.frames for other in others)])
    return replace(robot, frames=frames, transform_topics=tuple(topics))


def _odometry(
    survey: LogSurvey, robot: Robot, requested: RequestedRoles, map_topic: str, reasons: dict[str, str]
) -> tuple[Source | None, tuple[str, ...]]:
    """The source named, else the best one; with what speaks against it."""
    above = _odom_ancestor(robot, requested)
    grid = survey.topics[map_topic].sample if map_topic else None
    frames = {"map", requested.map_frame, grid.frame_id if isinstance(grid, OccupancyGrid) else ""} - {""}
    named = requested.odometry
    if named not in {"", TF, *robot.odometry}:
        robot = replace(robot, odometry=(*robot.odometry, named))
    sources = odometry_sources.sources_of(survey, robot, above, frames)
    if named:
        source = next((source for source in sources if source.name == named), None)
        if source is None:
            raise InputError(_no_transforms(robot, named))
    else:
        source = sources[0] if sources else None
        reasons |= {"odometry": _why(source, sources[1:])} if source else {}
    if source is None:
        return None, ()
    if requested.odom_frame and source.name != TF:
        source = replace(source, frame=requested.odom_frame)
    better = [other.name for other in sources if other.weight < min(source.weight, 2)]
    cure = f"{better[0]} has no such fault (--odom {better[0]})" if better else "the log has no better source"
    what = "transforms above the base" if source.name == TF else clean(source.name)
    return source, tuple(f"{what}: {doubt.what}; {cure}" for doubt in source.doubts if doubt.weight > 1)


def _why(source: Source, others: Sequence[Source]) -> str:
    """Why a source was chosen."""
    topics = [other for other in others if other.name != TF]
    if source.name == TF:
        what = "transforms above the base"
        return what + (f"; not {_doubted(topics)}" if topics else " (no odometry topic)")
    if not others or (not topics and not others[0].doubts):
        return "the only odometry topic"
    worse = [other for other in others if other.weight > source.weight]
    if worse:
        return f"the odometry with the least against it; not {_doubted(others)}"
    return f"of the odometry topics nearest to 'odom'; not {_doubted(topics)}"


def _doubted(sources: Sequence[Source]) -> str:
    told = []
    for source in sources:
        doubt = max(source.doubts, key=lambda doubt: doubt.weight, default=None)
        name = "tf" if source.name == TF else clean(source.name)
        told.append(f"{name} ({doubt.what})" if doubt else name)
    return ", ".join(told)


def _no_transforms(robot: Robot, named: str) -> str:
    if named == TF:
        frames = ", ".join(map(clean, robot.frames.frames)) or "none"
        return (
            f"--odom tf: no transform moves the base '{clean(robot.base or 'base_link')}'; frames in the log: {frames}"
        )
    return f"--odom: topic '{clean(named)}' has no message that can be used"


def _by_calibration(survey: LogSurvey, robot: Robot) -> tuple[str, ...]:
    """A robot's topics of landmarks; last those whose camera is not known: the first may have to trigger updates."""
    return tuple(sorted(sorted(robot.vision), key=lambda name: cameras.is_without_calibration(survey, name)))


def _find_truth(survey: LogSurvey, robot: Robot, robots: Sequence[Robot], reasons: dict[str, str]) -> str:
    """A topic that is named like a reference, of no other robot."""
    foreign = tuple(other.namespace for other in robots if other is not robot and other.namespace != "/")
    topics: list[TopicSurvey] = [t for t in survey.of_type(*POSES, *ODOMETRY) if is_truth(t.channel.topic)]
    named = [t.channel.topic for t in topics if not t.channel.topic.startswith(foreign)]
    if not named:
        return ""
    reasons["truth"] = "named like a reference; never an input"
    return min(named, key=lambda name: not name.startswith(robot.namespace))


def _check(survey: LogSurvey, name: str, types: tuple[str, ...]) -> None:
    topic = survey.topics.get(name)
    if topic is None:
        names = ", ".join(sorted(survey.topics)) or "none"
        raise UsageError(f"no topic '{name}' in the log{nearest_name(name, list(survey.topics))}; it has {names}")
    if topic.sample is None:
        why = problem(survey, topic) or f"mcl cannot use messages of type {topic.channel.type}"
        raise UsageError(f"topic '{name}': {why}; name another topic")
    if topic.channel.type not in types:
        hint = "give --odom another topic, or tf" if types == ODOMETRY else "name another topic"
        raise UsageError(f"topic '{name}': not of type {' or '.join(types)}; {hint}")


def _base_frame(robot: Robot, requested: RequestedRoles, source: Source | None) -> str:
    """The frame asked for, else odometry's child, else base_link or base_footprint of the robot."""
    if requested.base_frame:
        return requested.base_frame
    child = source.child if source is not None and source.name != TF else ""
    frames = robot.frames.frames
    if child and (not robot.base or (child in frames and robot.frames.connected(child, robot.base))):
        return child
    prefix = robot.base.rpartition("/")[0]
    named = [f"{prefix}/{name}" if prefix else name for name in ("base_link", "base_footprint")]
    rigid = (name for name in named if name in frames and not robot.frames.moves_between(name, robot.base or name))
    return next(rigid, robot.base or "base_link")


def _odom_ancestor(robot: Robot, requested: RequestedRoles) -> str:
    """The frame above the base that odometry is told in: ``odom``, else the highest moving one below ``map``."""
    tree, base = robot.frames, requested.base_frame or robot.base
    chain = tree.ancestors(base) if base else []
    if requested.odom_frame and requested.odometry == TF:
        if requested.odom_frame not in chain:
            raise InputError(f"frame '{requested.odom_frame}' is not above '{base}'; frames: {', '.join(tree.frames)}")
        return requested.odom_frame
    if requested.odom_frame in chain:
        return requested.odom_frame
    maps = {"map", "world", requested.map_frame}
    above = [p for f in chain if (p := tree.parent(f)) and tree.moves(f) and p not in maps]
    return next((frame for frame in above if "odom" in frame), above[-1] if above else "")
