"""Which grid of a log is its map, and which of its messages: SLAM publishes one that grows."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from mclcli.io.recording.kinds import MAP
from mclcli.text import clean
from mclcli.world.occupancy import OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from mclcli.io.recording.robots import Robot
    from mclcli.io.recording.survey import LogSurvey, TopicSurvey
    from mclcli.world import MapUpdate

_NO_MAP = re.compile(
    r"cost_?map|mask|submap|keep_?out|speed|filter|inflat|obstacle|local|elevation|travers|height|probab|slope|layer",
    re.IGNORECASE,
)
_SAME_SIZE = 1e-6
_KNOWN_AGAIN, _AS_BEFORE = 0.9, 0.6
_WALL = 50  # cells above are rather occupied than free
_SHIFTED_M = 0.15  # walls that a loop closure moves by no more are the same ones


def choose(survey: LogSurvey, robot: Robot, map_frames: Collection[str], robots: Sequence[Robot]) -> tuple[str, str]:
    """The topic of the map and the reason, both empty if no grid may be one.

    Costmaps, masks and submaps never are, nor what is told in a frame of odometry or of the robot.
    """
    grids = survey.of_type(*MAP)
    foreign = [other.namespace for other in robots if other is not robot and other.namespace != "/"]
    usable = [topic for topic in grids if not _unlike_a_map(topic, robot)]
    own = [topic for topic in usable if not any(topic.channel.topic.startswith(space) for space in foreign)]
    if not own:
        return "", ""
    best = min(own, key=lambda topic: _rank(topic, robot, map_frames))
    name = best.channel.topic
    others = [topic.channel.topic for topic in grids if topic is not best]
    return name, f"of the grids the one that is named and framed like a map; not {', '.join(others)}" if others else ""


def _unlike_a_map(topic: TopicSurvey, robot: Robot) -> bool:
    name = topic.channel.topic
    if _NO_MAP.search(name.removeprefix(robot.namespace)):
        return True
    frame = _frame(topic)
    chain = robot.frames.ancestors(robot.base) if robot.base else []
    return bool(frame) and (frame in chain[:-1] or "odom" in frame)


def _rank(topic: TopicSurvey, robot: Robot, map_frames: Collection[str]) -> tuple[bool, bool, bool, int, str]:
    name = topic.channel.topic
    last = name.rpartition("/")[2].lower()
    return (
        not last.startswith("map") and not last.endswith("map"),
        _frame(topic) not in map_frames,
        robot.namespace != "/" and not name.startswith(robot.namespace),
        len(name),
        name,
    )


def _frame(topic: TopicSurvey) -> str:
    return topic.sample.frame_id if isinstance(topic.sample, OccupancyGrid) else ""


def pick(name: str, grids: Sequence[OccupancyGrid], update: MapUpdate, warn: Callable[[str], None]) -> OccupancyGrid:
    """The message to use of a map's topic, of all that can be used, at least one, in order of time."""
    first, last = grids[0], grids[-1]
    if update == "follow":
        return next((grid for grid in grids if grid.occupied.any()), first)
    if update == "first" or len(grids) == 1:
        return first
    if update == "last" or contains(last, first):
        return last
    warn(
        f"{clean(name)}: {len(grids)} maps, and the last does not go on from the first; the first is used "
        "(--set map_update=last or follow uses others)"
    )
    return first


def which(grid: OccupancyGrid, grids: Sequence[OccupancyGrid]) -> str:
    """What to say of a message that was picked, empty where it is the only one."""
    if len(grids) == 1:
        return ""
    place = next(number for number, other in enumerate(grids) if other is grid)
    names = {0: "the first", len(grids) - 1: "the last"}
    return f", {names.get(place, f'number {place + 1}')} of {len(grids)} messages"


def contains(later: OccupancyGrid, earlier: OccupancyGrid) -> bool:
    """Whether a map has grown from an earlier one: same frame and cell size, what was known is, and walls still are."""
    from scipy import ndimage

    if abs(later.resolution - earlier.resolution) > _SAME_SIZE * earlier.resolution:
        return False
    if later.frame_id != earlier.frame_id or abs(later.origin[2] - earlier.origin[2]) > 1e-9:
        return False
    rows, columns = np.nonzero(earlier.cells >= 0)
    if not rows.size:
        return True
    at = np.floor(later.to_cells(earlier.to_map(np.stack([columns + 0.5, rows + 0.5], axis=-1)))).astype(np.int64)
    inside = ((at >= 0) & (at < [later.width, later.height])).all(axis=1)
    columns, rows, at = columns[inside], rows[inside], at[inside]
    if np.mean(inside) < _KNOWN_AGAIN or np.mean(later.cells[at[:, 1], at[:, 0]] >= 0) < _KNOWN_AGAIN:
        return False
    walls = at[earlier.cells[rows, columns] >= _WALL]
    reach = max(1, round(_SHIFTED_M / later.resolution))
    near_walls = ndimage.binary_dilation(later.cells >= _WALL, np.ones((3, 3), np.bool_), iterations=reach)
    return not len(walls) or bool(np.mean(near_walls[walls[:, 1], walls[:, 0]]) >= _AS_BEFORE)
