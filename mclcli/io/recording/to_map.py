"""Poses stated in whatever frame, brought to the map's frame by the log's own transforms at their stamps."""

from __future__ import annotations

import logging
from collections import Counter, deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry import se3
from mclcli.records import StampedPose

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.arrays import FloatArray
    from mclcli.geometry.frames import TransformTree
    from mclcli.io.recording.roles import Roles
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.records import Transform

    Relation = Literal["the map's", "joined", "taken", "loose"]
    Fate = Literal["brought", "missing", "taken", "loose"]

_USUAL = "map"  # REP-105
_JUMP_NS = 1_000_000_000  # time going back so far is another drive; less is disorder
_KEEP_NS = 60_000_000_000  # poses may come so much later than the transforms of their stamp
_FEW = 0.1  # share of poses left out above which it is worth a warning


@final
@dataclass(frozen=True, slots=True)
class MapFrame:
    """What the map's frame is called in a log.

    ``names``: what says so (the user, the map's topic), besides the usual ``map``. ``target``: the frame of the log's
    transforms that poses are brought to, empty if there is none. ``odom`` and ``base`` are the robot's own frames;
    with ``own_may_be`` poses in these are taken for the map's where there is no target: simulators say so of the truth.
    ``cure`` ends the message about poses that cannot be brought there.
    """

    names: tuple[str, ...]
    target: str
    odom: str
    base: str
    cure: str = ""
    own_may_be: bool = True

    def relation(self, tree: TransformTree, frame: str) -> Relation:
        """How a frame relates to the map's: it is the same, ``joined`` by transforms, ``taken`` for it, or none.

        A frame that no transform knows is taken for the map's where the log tells of no other one.
        """
        if frame in {"", self.target, *self.names}:
            return "the map's"
        if self.target and tree.connected(self.target, frame):
            return "joined"
        if frame == _USUAL:
            return "the map's"
        own = frame in {self.odom, self.base} or tree.connected(self.base, frame)
        return "loose" if self.target or (own and not self.own_may_be) else "taken"


def map_frame(survey: LogSurvey, roles: Roles, given: str = "", cure: str = "") -> MapFrame:
    """The map's frame: the one ``given``, else that of the map's topic, else ``map``; without all of them the root.

    The root of the transforms above odometry counts where none of the names is among the log's frames: ``world``, say.
    A grid in a frame of the robot's own, or one that moves in ``map``, is no map of the building: a local costmap.
    """
    tree, known = survey.frames, set(survey.frames.frames)
    grid = survey.topics[roles.map].sample if roles.map in survey.topics else None
    drawn: str = getattr(grid, "frame_id", "")
    moves = tree.connected(_USUAL, drawn) and tree.moves_between(_USUAL, drawn)
    if moves or drawn in {roles.odom_frame, roles.base_frame}:
        drawn = ""
    stated = (given.lstrip("/"), drawn)
    names = tuple(dict.fromkeys(name for name in stated if name and name != _USUAL))
    target = next((name for name in (*names, _USUAL) if name in known), "")
    if not target and roles.base_frame in known:
        root = tree.ancestors(roles.base_frame)[-1]
        target = "" if root in {roles.base_frame, roles.odom_frame} or "odom" in root.lower() else root
    return MapFrame(names, target, roles.odom_frame, roles.base_frame, cure)


@final
class ToMap:
    """Poses of one source on their way to the map, in the order in which they came.

    Each waits until the transforms of its stamp are known; nothing is extrapolated. What became of the poses of other
    frames is counted: brought, without a transform at their stamp, taken for the map's, in a frame that nothing joins.
    """

    def __init__(self, survey: LogSurvey, target: MapFrame, source: str) -> None:
        self._survey, self._map, self._source = survey, target, source
        self._tree = survey.frames.replayed()
        self._relations: dict[str, Relation] = {}
        self._waiting: deque[StampedPose] = deque()
        self._done: deque[StampedPose | None] = deque()
        self._newest_ns: dict[str, int] = {}
        self._since_forgotten = 0
        self._fates: Counter[tuple[Fate, str]] = Counter()

    def topics_for(self, frames: Iterable[str]) -> frozenset[str]:
        """Topics that have to be read for poses of these frames: those of transforms if one on the way may move."""
        survey, target = self._survey, self._map.target
        joined = [frame for frame in frames if self._relation(frame) == "joined"]
        moving = any(survey.frames.moves_between(target, frame) or not survey.complete for frame in joined)
        return frozenset(survey.transform_topics if moving else ())

    def require(self, frame: str) -> None:
        """Refuse a frame that cannot be brought to the map.

        Raises
        ------
        InputError
            If no transform of the log joins the two.

        """
        if self._relation(frame) == "loose":
            raise InputError(f"{self._subject} poses in frame '{frame}'; {self._why(frame)}")

    def take(self, pose: StampedPose) -> None:
        """Take one pose in."""
        self._waiting.append(pose)

    def take_transforms(self, transforms: Iterable[Transform]) -> None:
        """Take transforms in; where their time jumps back, poses from before the jump have seen all of theirs."""
        for transform in transforms:
            newest_ns = self._newest_ns.get(transform.child)
            if not transform.static:
                if newest_ns is not None and transform.stamp_ns < newest_ns - _JUMP_NS:
                    self._done.extend(self._settled(complete=True))
                    self._tree = self._survey.frames.replayed()
                    self._newest_ns.clear()
                self._newest_ns[transform.child] = transform.stamp_ns
                self._since_forgotten += 1
            self._tree.add(transform)
        if self._since_forgotten > 1000:
            first_ns = min((pose.stamp_ns for pose in self._waiting), default=2**63 - 1)
            self._tree.forget_before(min(first_ns, max(self._newest_ns.values())) - _KEEP_NS)
            self._since_forgotten = 0

    def ready(self, *, complete: bool = False) -> Iterator[StampedPose | None]:
        """Poses in the map's frame, None for each that has no way there; ``complete``: no more transforms come."""
        while self._done:
            yield self._done.popleft()
        yield from self._settled(complete=complete)

    def tell(self) -> None:
        """Say what was done to the poses; nothing where they were in the map's frame."""
        for (fate, frame), count in sorted(self._fates.items()):
            many = fate == "missing" and count > _FEW * (count + self._fates["brought", frame])
            level = logging.WARNING if many or fate == "loose" else logging.INFO
            text = f"{_poses(count)} in frame '{frame}' {self._story(fate, frame)}"
            logging.getLogger("mclcli").log(level, "%s: %s", self._source, text)

    @property
    def nothing(self) -> str:
        """What became of the first poses that were left out, for a message; empty if none was."""
        left_out = ((key, count) for key, count in self._fates.items() if key[0] in {"missing", "loose"})
        return next((f"{_poses(n)} in frame '{frame}' {self._story(fate, frame)}" for (fate, frame), n in left_out), "")

    def _story(self, fate: Fate, frame: str) -> str:
        target = self._map.target
        stories: dict[Fate, str] = {
            "brought": f"brought to '{target}' by the transforms at their stamps",
            "missing": f"left out: no transform to '{target}' at their stamps",
            "taken": "taken for the map's: the log knows no other",
            "loose": f"left out: {self._why(frame)}",
        }
        return stories[fate]

    @property
    def _subject(self) -> str:
        return f"{self._source} states" if self._source.startswith("tf:") else f"topic '{self._source}' states"

    def _why(self, frame: str) -> str:
        names = ", ".join(self._survey.frames.frames) or "none"
        target = self._map.target or next(iter(self._map.names), _USUAL)
        ends = f"; {self._map.cure.format(frame=frame)}" if self._map.cure else ""
        return f"no transform joins '{target}' and '{frame}'; frames in the log: {names}{ends}"

    def _relation(self, frame: str) -> Relation:
        if frame not in self._relations:
            self._relations[frame] = self._map.relation(self._tree, frame)
        return self._relations[frame]

    def _settled(self, *, complete: bool) -> Iterator[StampedPose | None]:
        while self._waiting:
            pose = self._waiting[0]
            relation = self._relation(pose.frame_id)
            result = None if relation == "loose" else pose
            if relation == "joined":
                result = self._brought(pose)
                if result is None and not complete and self._may_come(pose):
                    return
                self._fates["missing" if result is None else "brought", pose.frame_id] += 1
            elif relation != "the map's":
                self._fates[relation, pose.frame_id] += 1
            self._waiting.popleft()
            yield result

    def _brought(self, pose: StampedPose) -> StampedPose | None:
        map_from_frame = self._tree.lookup(self._map.target, pose.frame_id, pose.stamp_ns)
        return None if map_from_frame is None else moved(pose, map_from_frame, self._map.target)

    def _may_come(self, pose: StampedPose) -> bool:
        """Whether transforms of a pose's stamp may still arrive."""
        known_ns = self._tree.latest_common(self._map.target, pose.frame_id)
        return known_ns is None or known_ns < pose.stamp_ns


def moved(pose: StampedPose, map_from_frame: FloatArray, target: str) -> StampedPose:
    """A pose told in another frame, ``map_from_frame`` (4, 4) away; its covariance turns along."""
    in_frame = se3.from_planar(pose.pose) if pose.matrix is None else pose.matrix
    matrix = map_from_frame @ in_frame
    turn = np.eye(3)
    c, s = np.cos(yaw := float(se3.to_planar(map_from_frame)[2])), np.sin(yaw)
    turn[:2, :2] = [[c, -s], [s, c]]
    spread = None if pose.covariance is None else turn @ pose.covariance @ turn.T
    return StampedPose(pose.stamp_ns, target, se3.to_planar(matrix), spread, matrix)


def _poses(count: int) -> str:
    return "1 pose" if count == 1 else f"{count} poses"
