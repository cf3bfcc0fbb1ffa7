"""Short drives of made-up robots, as the messages of their logs: a lap through an empty room, with lidar and odometry.

Everything is a function of the time ``t`` [s]. A log is a list of messages of ``tests.cli.support``; what a test wants
to be odd about it, it changes in ``Drive``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.geometry import se2
from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.recording.survey import LogSurvey, survey_log
from mclcli.world.occupancy import FREE, OCCUPIED, OccupancyGrid
from tests.cli.support import START_NS, Message, made
from tests.support import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Pose = tuple[float, float, float]

SCAN, ODOMETRY, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
GRID = "nav_msgs/msg/OccupancyGrid"
WIDTH, HEIGHT = 8.0, 5.0
WALL = 0.025  # how deep a beam goes into the cells that border the map
MOUNT = (0.12, 0.03, 0.4)
NO_COVARIANCE = np.zeros(36)


def pose(t: float) -> Pose:
    """Where the robot is in the room: an ellipse, off its middle."""
    a = 0.3 * t
    return 4.4 + 2.2 * math.cos(a), 2.3 + 1.4 * math.sin(a), math.atan2(1.4 * math.cos(a), -2.2 * math.sin(a))


def odom(t: float) -> Pose:
    """The same as odometry tells it, from where it began."""
    x, y, yaw = se2.between(pose(0.0), pose(t)).tolist()
    return x, y, yaw


def room() -> OccupancyGrid:
    """Map of the room, its corner at the origin, 5 cm cells."""
    cells = np.full((round(HEIGHT / 0.05), round(WIDTH / 0.05)), FREE, np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    return OccupancyGrid(cells, 0.05, np.zeros(3))


def stamped(t: float, frame: str) -> dict[str, Any]:
    ns = START_NS + round(t * SECOND)
    return {"stamp": {"sec": ns // SECOND, "nanosec": ns % SECOND}, "frame_id": frame}


def oriented(where: Pose) -> dict[str, Any]:
    x, y, yaw = where
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn}


def transform(t: float, parent: str, child: str, where: Pose) -> dict[str, Any]:
    own = oriented(where)
    placed = {"translation": own["position"], "rotation": own["orientation"]}
    return {"transforms": [{"header": stamped(t, parent), "child_frame_id": child, "transform": placed}]}


def odometry(
    t: float, where: Pose, frame: str = "odom", child: str = "base_link", speed: float = 0.0
) -> dict[str, Any]:
    linear, angular = {"x": speed, "y": 0.0, "z": 0.0}, dict.fromkeys("xyz", 0.0)
    return {
        "header": stamped(t, frame),
        "child_frame_id": child,
        "pose": {"pose": oriented(where), "covariance": NO_COVARIANCE},
        "twist": {"twist": {"linear": linear, "angular": angular}, "covariance": NO_COVARIANCE},
    }


def scan(
    t: float, mount: Pose, frame: str, half: float = 2.0, beams: int = 81, range_max: float = 12.0
) -> dict[str, Any]:
    """What a lidar that looks ``half`` [rad] to each side sees of the walls."""
    x, y, yaw = se2.compose(pose(t), mount).tolist()
    angles = yaw + np.linspace(-half, half, beams)
    with np.errstate(divide="ignore"):
        across = np.where(np.cos(angles) > 0, WIDTH - WALL - x, WALL - x) / np.cos(angles)
        along = np.where(np.sin(angles) > 0, HEIGHT - WALL - y, WALL - y) / np.sin(angles)
    return {
        "header": stamped(t, frame),
        "angle_min": -half,
        "angle_max": half,
        "angle_increment": 2.0 * half / (beams - 1),
        "range_min": 0.05,
        "range_max": range_max,
        "ranges": np.minimum(across, along).astype(np.float32),
        "intensities": np.zeros(0, np.float32),
    }


def grid(frame: str = "map", columns: int | None = None) -> dict[str, Any]:
    """The room's map as a message, or its first columns."""
    whole = room()
    cells = whole.cells[:, : columns or whole.width]
    info = {
        "map_load_time": {"sec": 0, "nanosec": 0},
        "resolution": whole.resolution,
        "width": cells.shape[1],
        "height": cells.shape[0],
        "origin": oriented((0.0, 0.0, 0.0)),
    }
    return {"header": stamped(0.0, frame), "info": info, "data": np.ascontiguousarray(cells).ravel()}


@dataclass(frozen=True)
class Drive:
    """A robot's log: topics in ``space``, frames with ``prefix``; it drives ``lead`` seconds ahead of others."""

    space: str = ""
    prefix: str = ""
    lead: float = 0.0
    mount: Pose = MOUNT
    seconds: float = 10.0
    tf_space: str | None = None
    with_odometry: bool = True
    with_tf: bool = True
    odom: Callable[[float], Pose] = odom
    speed: float = 0.0

    def messages(self) -> list[Message]:
        """All messages, in order of log time."""
        base, tf = f"{self.prefix}base_link", self.space if self.tf_space is None else self.tf_space
        result = [at(0.0, f"{tf}/tf_static", TF, transform(0.0, base, f"{self.prefix}laser", self.mount))]
        for i in range(round(20 * self.seconds)):
            t = i / 20
            where = self.odom(t + self.lead)
            if self.with_odometry:
                told = odometry(t, where, f"{self.prefix}odom", base, self.speed)
                result.append(at(t, f"{self.space}/odom", ODOMETRY, told))
            if self.with_tf:
                result.append(at(t, f"{tf}/tf", TF, transform(t, f"{self.prefix}odom", base, where)))
            if i % 4 == 1:
                seen = scan(t + self.lead, self.mount, f"{self.prefix}laser") | {
                    "header": stamped(t, f"{self.prefix}laser")
                }
                result.append(at(t, f"{self.space}/scan", SCAN, seen))
        return result


def at(t: float, topic: str, kind: str, values: Any) -> Message:
    """A message that is recorded at a time."""
    return made(topic, kind, values, START_NS + round(t * SECOND))


def every(step: float, seconds: float, make: Callable[[float], Message]) -> list[Message]:
    """A message every ``step`` seconds."""
    return [make(i * step) for i in range(round(seconds / step))]


def in_order(*logs: Iterable[Message]) -> list[Message]:
    """Several logs as one."""
    return sorted((message for log in logs for message in log), key=lambda message: message.log_ns)


def surveyed(*logs: Iterable[Message]) -> LogSurvey:
    """What a first look through them finds."""
    channels: dict[str, Channel] = {}
    raw = []
    for message in in_order(*logs):
        channel = channels.setdefault(
            message.topic, Channel(message.topic, message.type, "cdr", message.definition.decode())
        )
        raw.append(RawMessage(channel, message.log_ns, message.data))
    return survey_log(raw)
