"""A robot in a room and its messages in memory, for tests of the replay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.filter.kld import KldParameters
from mclcli.filter.localizer import Localizer
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.start import AroundPose
from mclcli.geometry import se3
from mclcli.geometry.frames import TransformTree
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.replay.loop import ReplayTally, Setup, replay
from mclcli.sensors.beams import BeamSelection
from mclcli.sensors.bearing import BearingModel, BearingParameters
from mclcli.sensors.instruments import Camera, Lidar
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world import distance_field
from mclcli.world.landmarks import Landmarks
from tests.support import SECOND, level, odometry, scan_of, sightings, transform
from tests.worlds import drawn

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.arrays import FloatArray
    from mclcli.records import TrackPoint

    Event = tuple[str, object]

FIELD = distance_field.compute(drawn("############\n" + "#..........#\n" * 6 + "############"), "exact", 2.0)
LANDMARK = (6.0, 3.0)
LIDAR = Lidar("lidar", LikelihoodField(FIELD, LikelihoodFieldParameters()), BeamSelection(max_beams=0))
MODEL = BearingModel(BearingParameters(sigma_bearing=0.1))
CAMERA = Camera("vision", MODEL, Landmarks(("post",), np.array([[*LANDMARK, 0.0]])))
START = np.array([2.0, 3.0, 0.0])
QUIET = DifferentialMotion(DifferentialParameters(0.0, 0.0, 0.0, 0.0))
NOISY = DifferentialMotion(DifferentialParameters())
BOTH = {"/scan": LIDAR, "/camera": CAMERA}


def tree(*edges: tuple[str, str, FloatArray]) -> TransformTree:
    frames = TransformTree()
    for parent, child, matrix in edges:
        frames.add(transform(0, parent, child, matrix, static=True))
    return frames


MOUNTED = tree(("base_link", "laser", se3.from_planar([0.1, 0, 0])), ("base_link", "camera", np.eye(4)))


def setup(**changes: Any) -> Setup:
    fields: dict[str, Any] = {
        "localizer": Localizer(QUIET, FilterParameters(update_min_d=0.5, update_min_a=0.3), 0, KldParameters(3, 3)),
        "instruments": {"/scan": LIDAR},
        "start": AroundPose(START, np.zeros((3, 3))),
        "odometry": "/odom",
        "odom_frame": "odom",
        "base_frame": "base_link",
        "frames": MOUNTED,
        "transform_topics": ("/tf",),
    }
    return Setup(**(fields | changes))


def ns(seconds: float) -> int:
    return round(seconds * SECOND)


def odom(seconds: float, x: float, y: float = 0.0, yaw: float = 0.0, child: str = "base_link") -> Event:
    return "/odom", odometry(ns(seconds), x, y, yaw, child=child)


def scan(seconds: float, topic: str = "/scan", **changes: Any) -> Event:
    return topic, scan_of([1.0, 2.0, 1.5], **({"stamp_ns": ns(seconds)} | changes))


def seen(seconds: float, bearing: float = 0.0, frame: str = "camera") -> Event:
    return "/camera", sightings(ns(seconds), ["post"], level(bearing), frame)


def run(events: Iterable[Event], **changes: Any) -> tuple[list[TrackPoint], ReplayTally]:
    tally = ReplayTally()
    return list(replay(events, setup(**changes), tally)), tally


def drive(seconds: int, speed: float = 1.0) -> list[Event]:
    """Odometry at 2 Hz, straight ahead, each with a scan 0.1 s later where odometry goes on."""
    events: list[Event] = []
    for half in range(2 * seconds + 1):
        events += [odom(half / 2, speed * half / 2), scan(half / 2 + 0.1)]
    return events
