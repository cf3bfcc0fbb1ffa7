"""Landmarks found in images: which camera took them, and the rays that its calibration gives.

A topic of pixels is paired with one of sensor_msgs/CameraInfo: first of the same frame, among those the one that shares
the longest namespace; without the same frame, one in the same namespace or above it.
"""

from __future__ import annotations

import logging
import re
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import pinhole
from mclcli.io.messages.conversion import read_only
from mclcli.io.messages.sightings import types_with
from mclcli.io.messages.vision import NOT_FINITE
from mclcli.records import CameraModel, LandmarkSightings, PixelSightings

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.io.logs.base import Tally
    from mclcli.io.recording.survey import LogSurvey

PIXELS = types_with("pixels")
RAYS = types_with("rays")
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_RECTIFIED = re.compile(r"(^|[/_])rect(ified)?([/_]|$)", re.IGNORECASE)
_KEPT = 64  # calibrations that a zoom camera changed through lately


@final
@dataclass(frozen=True, slots=True)
class Pairing:
    """Topic ``info`` calibrates the camera of a topic; ``rectified`` if its pixels are those of rectified images."""

    info: str
    rectified: bool
    reason: str


def pair(survey: LogSurvey, topic: str) -> Pairing | None:
    """The calibration that belongs to a topic of pixels, None if the log has none that does."""
    frame = getattr(survey.topics[topic].sample, "frame_id", "")
    infos = {info.channel.topic: getattr(info.sample, "frame_id", "") for info in survey.of_type(CAMERA_INFO)}
    same = [name for name, of in infos.items() if of == frame != ""]
    names = same or [name for name in infos if _namespace(topic)[: len(_namespace(name))] == _namespace(name)]
    if not names:
        return None
    info = max(names, key=lambda name: (_shared(name, topic), name.endswith("/camera_info"), -len(name)))
    says = next((name for name in (topic, info) if _RECTIFIED.search(name)), "")
    how = f"P of {info} (rectified, as the name {says} says)" if says else f"K and D of {info} (raw images)"
    return Pairing(info, bool(says), f"{topic} through {how}")


def is_without_calibration(survey: LogSurvey, topic: str) -> bool:
    """Whether a topic tells pixels, of a camera that nothing is known of."""
    return survey.topics[topic].channel.type in PIXELS and pair(survey, topic) is None


def explain(survey: LogSurvey, topics: Iterable[str], reasons: dict[str, str]) -> None:
    """Say in ``reasons['vision']`` through which calibration each topic of pixels is read."""
    pairings = {topic: pair(survey, topic) for topic in topics if survey.topics[topic].channel.type in PIXELS}
    if pairings:
        told = (pairing.reason if pairing else f"{topic}: {_missing(topic)}" for topic, pairing in pairings.items())
        reasons["vision"] = "; ".join(told)


def _missing(topic: str) -> str:
    return f"no sensor_msgs/CameraInfo on {'/'.join(['', *_namespace(topic), 'camera_info'])}, nor of its frame"


def _namespace(topic: str) -> list[str]:
    return topic.strip("/").split("/")[:-1]


def _shared(a: str, b: str) -> int:
    """How many names two topics' namespaces have in common from the root."""
    pairs = list(zip(_namespace(a), _namespace(b), strict=False))
    return next((depth for depth, (x, y) in enumerate(pairs) if x != y), len(pairs))


@final
class Cameras:
    """Calibrations in, rays out: the way of some topics' messages to a replay.

    ``topics`` are those of the calibrations needed. What cannot be used is counted in ``tally`` and warned of once.
    """

    def __init__(self, survey: LogSurvey, wanted: Iterable[str], tally: Tally) -> None:
        self._tally = tally
        pixels = [topic for topic in wanted if topic in survey.topics and survey.topics[topic].channel.type in PIXELS]
        self._pairings = {topic: pairing for topic in pixels if (pairing := pair(survey, topic))}
        self._models: dict[str, deque[CameraModel]] = {}
        for pairing in self._pairings.values():
            first = survey.topics[pairing.info].sample
            assert isinstance(first, CameraModel)  # noqa: S101 - goes by type
            self._models[pairing.info] = deque([first], maxlen=_KEPT)

    @property
    def topics(self) -> frozenset[str]:
        """Topics of the calibrations that are needed."""
        return frozenset(self._models)

    def see(self, topic: str, record: object) -> object | None:
        """Take one record in: pixels come back as rays, None if they cannot; everything else as it is."""
        if isinstance(record, CameraModel) and topic in self._models:
            models = self._models[topic]
            if not _same(models[-1], record):
                models.append(record)
        return self._rays(topic, record) if isinstance(record, PixelSightings) else record

    def _rays(self, topic: str, seen: PixelSightings) -> LandmarkSightings | None:
        pairing = self._pairings.get(topic)
        if pairing is None:
            self._reject(topic, _missing(topic))
            return None
        model = self._model(pairing.info, seen.stamp_ns)
        problem = pinhole.problem(model, rectified=pairing.rectified)
        if problem:
            self._reject(topic, f"{pairing.info}: {problem}")
            return None
        rays = pinhole.rays(model, seen.pixels, rectified=pairing.rectified)
        good = np.isfinite(rays).all(axis=1)
        if not good.all():
            self._note(topic, int((~good).sum()))
        ids = tuple(seen.ids[row] for row in np.flatnonzero(good))
        return LandmarkSightings(seen.stamp_ns, seen.frame_id, ids, read_only(rays[good]))

    def _model(self, info: str, stamp_ns: int) -> CameraModel:
        """The latest calibration at or before a stamp, or the first."""
        models = self._models[info]
        return next((model for model in reversed(models) if model.stamp_ns <= stamp_ns), models[0])

    def _reject(self, topic: str, reason: str) -> None:
        if self._tally.reject(topic, reason) == 1:
            logging.getLogger("mclcli").warning("%s: messages cannot be used: %s", topic, reason)

    def _note(self, topic: str, count: int) -> None:
        if self._tally.note(topic, NOT_FINITE, count) == count:
            logging.getLogger("mclcli").warning("%s: %s", topic, NOT_FINITE)


def _same(a: CameraModel, b: CameraModel) -> bool:
    """Whether two calibrations differ in their stamps at most."""
    plain = (a.distortion_model, a.binning, a.offset) == (b.distortion_model, b.binning, b.offset)
    arrays = ((a.distortion, b.distortion), (a.k, b.k), (a.r, b.r), (a.p, b.p))
    return plain and all(np.array_equal(x, y) for x, y in arrays)
