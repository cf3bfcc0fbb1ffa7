"""Slow, obvious counterparts of the simulator's fast code, written from the definitions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from samples.sim.layouts import corridors
from samples.sim.recording import Scenario
from samples.sim.sensors import Camera, Lidar, Mount

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray

ROOT = Path(__file__).resolve().parents[2]
BEARINGS = "mcl_msgs/msg/LandmarkBearings"

_store = get_typestore(Stores.ROS2_JAZZY)
_store.register(get_types_from_msg("std_msgs/Header header\nstring[] ids\nfloat64[] bearings\n", BEARINGS))


class Decoded(NamedTuple):
    topic: str
    type: str
    log_ns: int
    stamp_ns: int
    message: Any


def ray_length(occupied: BoolArray, side: float, x: float, y: float, angle: float) -> float:
    """Shortest distance to the square of any occupied cell: the slab test, cell by cell."""
    best = math.inf
    dx, dy = math.cos(angle), math.sin(angle)
    for row, line in enumerate(occupied):
        for column, full in enumerate(line):
            if full:
                entry, leave = _slab(x, dx, column * side, side)
                entry_y, leave_y = _slab(y, dy, row * side, side)
                near, far = max(entry, entry_y, 0.0), min(leave, leave_y)
                if near <= far:
                    best = min(best, near)
    return best


def _slab(start: float, direction: float, low: float, side: float) -> tuple[float, float]:
    if direction == 0.0:
        return (-math.inf, math.inf) if low <= start <= low + side else (math.inf, -math.inf)
    a, b = (low - start) / direction, (low + side - start) / direction
    return min(a, b), max(a, b)


def read_log(path: Path) -> list[Decoded]:
    """Every message of an MCAP file in file order, checksums verified."""
    found = []
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            assert schema is not None
            decoded = _store.deserialize_cdr(message.data, schema.name)
            found.append(Decoded(channel.topic, schema.name, message.log_time, message.publish_time, decoded))
    return found


def by_topic(messages: list[Decoded]) -> dict[str, list[Decoded]]:
    topics: dict[str, list[Decoded]] = {}
    for message in messages:
        topics.setdefault(message.topic, []).append(message)
    return topics


def small_scenario(**changes: Any) -> Scenario:
    """A drive of a few seconds through two corridors."""
    fields: dict[str, Any] = {
        "name": "small",
        "mapped": corridors(seed=1, count=2, origin=(-2.0, 1.0, 0.4)),
        "tours": (("mouth1", "mouth2"),),
        "lidar": Lidar(Mount(0.1, 0.02, 0.2, yaw=0.3), beams=90, angle_increment=math.tau / 90),
        "camera": Camera(Mount(0.1, 0.0, 0.5)),
        "walks": (("mouth2", "end2"),),
        "seed": 5,
    }
    return Scenario(**(fields | changes))
