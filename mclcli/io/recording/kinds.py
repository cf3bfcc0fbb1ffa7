"""Which types of message may play which part, and what topics' names say."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING

from mclcli.io.messages.sightings import types_with

if TYPE_CHECKING:
    from collections.abc import Iterable

SCAN = ("sensor_msgs/msg/LaserScan",)
ODOMETRY = ("nav_msgs/msg/Odometry",)
SIGHTINGS = (*types_with("rays"), *types_with("pixels"))
POSES = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
MAP = ("nav_msgs/msg/OccupancyGrid",)
TF = "tf"

_TRUTH = re.compile(r"truth|(^|[/_])gt([/_]|$)|mocap|vicon|optitrack", re.IGNORECASE)


def shared_namespace(topics: Iterable[str]) -> str:
    """The namespace that all of some topics are in, such as ``/robot1``; empty for the one around all."""
    paths = [topic.split("/")[:-1] for topic in topics]
    levels = itertools.takewhile(lambda names: len(set(names)) == 1, zip(*paths, strict=False))
    return "/".join(names[0] for names in levels)


def is_truth(topic: str) -> bool:
    """Whether a topic is named like a reference: it is never used as odometry."""
    return bool(_TRUTH.search(topic))
