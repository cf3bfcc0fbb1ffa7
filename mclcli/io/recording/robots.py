"""The robots of a log: which sensors sit on the same base, and which transforms and odometry are theirs.

Topics in one namespace, and frames that transforms connect, belong together. Transforms of two namespaces are joined
only where the way from a sensor to its base needs both.
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.geometry.frames import TransformTree
from mclcli.io.recording.kinds import ODOMETRY, SCAN, SIGHTINGS, is_truth, shared_namespace
from mclcli.records import Odometry

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from mclcli.io.recording.survey import LogSurvey

_MOST = 48  # topics of a kind, and namespaces, that are compared with each other
_MOST_FRAMES = 1000
_BASES = frozenset({"base_link", "base_footprint", "base"})


@final
@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """One robot of a log.

    ``name`` tells it from the others. ``base`` is its base frame, empty if nothing says. ``namespace`` begins its
    topics (``/robot1/``, or ``/`` for all). ``frames`` hold the transforms of ``transform_topics``, which came in the
    namespaces ``joined``. ``scans``, ``vision`` and ``odometry`` are topics.
    """

    name: str = ""
    base: str = ""
    namespace: str = "/"
    frames: TransformTree = field(default_factory=lambda: TransformTree(keep_history=False))
    transform_topics: tuple[str, ...] = ()
    joined: tuple[str, ...] = ()
    scans: tuple[str, ...] = ()
    vision: tuple[str, ...] = ()
    odometry: tuple[str, ...] = ()

    @property
    def moves(self) -> bool:
        """Whether transforms move the base."""
        return any(self.frames.moves(frame) for frame in self.frames.ancestors(self.base))

    @property
    def is_complete(self) -> bool:
        """Whether it has a sensor, and something that may be its odometry."""
        return bool((self.scans or self.vision) and (self.odometry or self.moves))

    def answers_to(self, name: str) -> bool:
        """Whether ``name`` means this robot: its namespace, base frame, or the prefix of that."""
        plain = name.strip("/")
        return bool(plain) and plain in {self.namespace.strip("/"), self.base, _prefix(self.base)}


@final
@dataclass(frozen=True, slots=True)
class _Place:
    """Where a sensor sits: namespaces of the transforms that lead to its base, and that base; empty if unknown."""

    namespaces: tuple[str, ...] = ()
    base: str = ""


def find_robots(survey: LogSurvey, base_frame: str = "", named: Collection[str] = ()) -> list[Robot]:
    """The robots of a log that have a sensor, by name; one without, if none has.

    ``base_frame`` is a base whatever it is called. Of very many topics those ``named`` are looked at, others beside
    them, and those with most messages.
    """
    survey = _bounded(survey, named)
    sensors = [topic.channel.topic for topic in survey.of_type(*SCAN, *SIGHTINGS)]
    odometry = {t.channel.topic: t.sample for t in survey.of_type(*ODOMETRY) if not is_truth(t.channel.topic)}
    told = [sample for sample in odometry.values() if isinstance(sample, Odometry)]
    bases = {o.child_frame_id for o in told} - {"", *(o.frame_id for o in told)}
    places = {topic: _place(survey, topic, bases, base_frame) for topic in sensors}
    groups = _groups(places, list(odometry)) if sensors else [(_without_sensor(survey, bases, base_frame), [])]
    robots = [_robot(survey, place, topics, many=len(groups) > 1) for place, topics in groups]
    robots = [dataclasses.replace(robot, odometry=_odometry_of(robot, robots, survey)) for robot in robots]
    return sorted(robots, key=lambda robot: robot.name)


def _bounded(survey: LogSurvey, named: Collection[str]) -> LogSurvey:
    """The survey with so few topics of each part that all may be compared with all."""
    topics, spaces = dict(survey.topics), {name.rpartition("/")[0] for name in named}
    for types in ((*SCAN, *SIGHTINGS), ODOMETRY):
        names = {topic.channel.topic: topic.count for topic in survey.of_type(*types)}
        found = sorted(names, key=lambda n: (n not in named, n.rpartition("/")[0] not in spaces, -names[n], n))
        for name in found[_MOST:]:
            del topics[name]
    if len(topics) == len(survey.topics) and len(survey.transforms) <= _MOST:
        return survey
    near = [space for space in survey.transforms if any(name.startswith(space) for name in topics)]
    kept = dict.fromkeys([*near, *survey.transforms][:_MOST])
    return dataclasses.replace(survey, topics=topics, transforms={name: survey.transforms[name] for name in kept})


def _place(survey: LogSurvey, topic: str, bases: set[str], asked: str) -> _Place:
    """Where the sensor of a topic sits; transforms of its own namespace count before those of namespaces around it."""
    frame = getattr(survey.topics[topic].sample, "frame_id", "")
    near = sorted((name for name in survey.transforms if topic.startswith(name)), key=len, reverse=True)
    sensors = [other.channel.topic for other in survey.of_type(*SCAN, *SIGHTINGS)]
    others = (name for name in sorted(survey.transforms) if name not in near)
    free = [name for name in others if not any(other.startswith(name) for other in sensors)]
    choices = [*((name,) for name in near), tuple(near), *((name,) for name in free), (*near, *free)]
    trees = {names: _tree(survey, names) for names in choices}
    is_base = frame == asked or frame in bases or _plain(frame) in _BASES
    found = (
        *(_Place(names, _base_above(tree, frame, bases, asked)) for names, tree in trees.items()),
        _Place(tuple(near[:1]), frame if is_base else ""),
        *(_Place(names, _rigid_root(tree, frame)) for names, tree in trees.items()),
        *(_Place(names, _only_base(tree, frame, bases, asked)) for names, tree in trees.items()),
    )
    return next((place for place in found if place.base), _Place())


def _without_sensor(survey: LogSurvey, bases: set[str], asked: str) -> _Place:
    """Where there is no sensor, all transforms are of one robot."""
    names = tuple(sorted(survey.transforms))
    return _Place(names, _only_base(_tree(survey, names), "", bases, asked))


def _tree(survey: LogSurvey, namespaces: Iterable[str]) -> TransformTree:
    trees = [survey.transforms[name].tree for name in namespaces]
    return trees[0] if len(trees) == 1 else TransformTree.union(trees)


def _base_above(tree: TransformTree, frame: str, bases: set[str], asked: str) -> str:
    """The base at or above a frame: the one asked for, else the highest by odometry or by its name; empty if none."""
    chain = tree.ancestors(frame)
    if asked in chain:
        return asked
    if len(chain) == 1:
        return ""
    return next((f for f in reversed(chain) if f in bases or _plain(f) in _BASES), "")


def _only_base(tree: TransformTree, frame: str, bases: set[str], asked: str) -> str:
    """The base of a sensor that nothing joins to it, where there is one base alone with the prefix of its frame."""
    frames = tree.frames
    if len(frames) > _MOST_FRAMES:
        return ""
    tops = {_base_above(tree, other, bases, asked) for other in frames} - {""}
    tops = {top for top in tops if _prefix(top) == _prefix(frame)} if len(tops) > 1 else tops
    return tops.pop() if len(tops) == 1 else ""


def _rigid_root(tree: TransformTree, frame: str) -> str:
    """The frame that moves and carries another one; empty if nothing moves."""
    return next((f for f in tree.ancestors(frame) if tree.moves(f)), "")


def _plain(frame: str) -> str:
    return frame.rpartition("/")[2]


def _prefix(frame: str) -> str:
    return frame.rpartition("/")[0].strip("/")


def _groups(places: dict[str, _Place], odometry: list[str]) -> list[tuple[_Place, list[str]]]:
    """Sensors by the base that they sit on; those of no known base go with their namespace."""
    groups: list[tuple[_Place, list[str]]] = []
    for topic, place in places.items():
        if not place.base:
            continue
        same = [group for group in groups if group[0].base == place.base and _overlap(group[0], place)]
        names = {name: None for group, _ in same for name in group.namespaces} | dict.fromkeys(place.namespaces)
        topics = [*(topic for _, others in same for topic in others), topic]
        groups = [group for group in groups if group not in same] + [(_Place(tuple(names), place.base), topics)]
    loose = [topic for topic, place in places.items() if not place.base]
    if not groups:
        return _by_namespace(loose, odometry)
    for topic in loose:
        shared = {number: max(_shared(topic, other) for other in group[1]) for number, group in enumerate(groups)}
        near = max(shared, key=lambda number: shared[number])
        if len(groups) == 1 or shared[near] > 1:
            groups[near][1].append(topic)
    return groups


def _overlap(a: _Place, b: _Place) -> bool:
    return not a.namespaces or not b.namespaces or bool(set(a.namespaces) & set(b.namespaces))


def _by_namespace(sensors: list[str], odometry: list[str]) -> list[tuple[_Place, list[str]]]:
    """Sensors of which no transform tells: two namespaces with odometry of their own are two robots."""
    spaces: dict[str, list[str]] = defaultdict(list)
    for topic in sensors:
        shared = (shared_namespace([topic, other]) for other in odometry)
        spaces[max(shared, key=len, default="")].append(topic)
    if sum(bool(space) for space in spaces) < 2:
        return [(_Place(), sensors)] if sensors else []
    return [(_Place(), topics) for space, topics in spaces.items() if space]


def _shared(a: str, b: str) -> int:
    """Length of the namespace that two topics share; 1 for the slash that all do."""
    return len(shared_namespace([a, b])) + 1


def _robot(survey: LogSurvey, place: _Place, sensors: list[str], *, many: bool) -> Robot:
    folder = shared_namespace(sensors)
    own = next((name for name in place.namespaces if name != "/"), "")
    prefix = _prefix(place.base)
    if many and not own:
        # Two robots share their transforms: namespaces of topics tell them apart, or prefixes of frames.
        own = f"{folder}/" if folder else f"/{prefix}/" if prefix else ""
    name = own.strip("/") or prefix or ("/" if many else "")
    scans = {topic.channel.topic for topic in survey.of_type(*SCAN)}
    topics = [topic for space in place.namespaces for topic in survey.transforms[space].topics]
    return Robot(
        name=name,
        base=place.base,
        namespace=own or "/",
        frames=_tree(survey, place.namespaces),
        transform_topics=tuple(topics),
        joined=place.namespaces if len(place.namespaces) > 1 and sensors else (),
        scans=tuple(topic for topic in sensors if topic in scans),
        vision=tuple(topic for topic in sensors if topic not in scans),
    )


def _odometry_of(robot: Robot, robots: list[Robot], survey: LogSurvey) -> tuple[str, ...]:
    """Topics of odometry that may be a robot's: not those of another one's namespace, or of another one's frames."""
    spaces = {other.namespace for other in robots} | set(survey.transforms)
    foreign = {space for space in spaces if not robot.namespace.startswith(space)} - {robot.namespace}
    result = []
    for topic in survey.of_type(*ODOMETRY):
        name, sample = topic.channel.topic, topic.sample
        assert isinstance(sample, Odometry)  # noqa: S101 - by type
        if is_truth(name) or (any(name.startswith(space) for space in foreign) and len(spaces) > 1):
            continue
        if len(robots) == 1 or robot in _owners(name, sample.child_frame_id, robots):
            result.append(name)
    return tuple(result)


def _owners(topic: str, child: str, robots: list[Robot]) -> list[Robot]:
    """Robots, of several, that a topic of odometry may be of: of its own namespace, with its frame, or all."""
    around = max((other.namespace for other in robots if topic.startswith(other.namespace)), key=len, default="")
    near = [other for other in robots if other.namespace == around] or robots
    return [other for other in near if _carries(other, child)] or near


def _carries(robot: Robot, frame: str) -> bool:
    """Whether a frame is a robot's base, or one that transforms join to it."""
    return frame == robot.base or (frame in robot.frames.frames and robot.base in robot.frames.ancestors(frame))
