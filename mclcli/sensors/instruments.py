"""Sensors as mounted on a robot: a model with its settings, turning messages into measurements."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, final

import numpy as np

from mclcli.quantity import FARTHEST
from mclcli.records import LandmarkSightings, LaserScan
from mclcli.sensors import Measurement, beams, bearing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.sensors import Temperature
    from mclcli.sensors.beams import Beams, BeamSelection, Sweep
    from mclcli.sensors.bearing import BearingModel
    from mclcli.world.landmarks import Landmarks

Reading = LaserScan | LandmarkSightings


class Instrument(Protocol):
    """Something that reads the world; ``name`` is its column in every trace, ``alpha`` its temperature."""

    @property
    def name(self) -> str:
        """Column name, such as ``lidar``."""
        ...

    @property
    def alpha(self) -> Temperature:
        """Temperature in (0, 1], ``auto`` or ``ess``."""
        ...

    def problem(self, reading: Reading) -> str:
        """Why a reading cannot be used, empty if it can."""
        ...

    def measure(self, reading: Reading, base_from_sensor: FloatArray, sweep: Sweep | None = None) -> Measurement:
        """Measurement of a reading, through the sensor's mount (4, 4) on the base at the update's stamp.

        With ``sweep`` the mount is that on the base at each beam's time, see ``beams.select``.
        """
        ...


class LidarModel(Protocol):
    """A likelihood of beams, over one map."""

    def measure(self, sensor: str, beams: Beams, alpha: Temperature = 1.0) -> Measurement:
        """Measurement that scores poses against these beams."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """A model, and the beams it takes, that tells how well a scan fits whatever the lidar's own model makes of it."""

    model: LidarModel
    selection: BeamSelection


@final
@dataclass(frozen=True, slots=True, eq=False)
class Lidar:
    """A planar lidar scored by one of the lidar models."""

    name: str
    model: LidarModel
    selection: BeamSelection
    alpha: Temperature = 1.0
    check: Check | None = None

    def problem(self, reading: Reading) -> str:
        """Why a scan cannot be used: its geometry makes no sense."""
        if not isinstance(reading, LaserScan):
            return "not a laser scan"
        if not reading.range_max > 0.0:
            return f"scan with range_max {reading.range_max:g}"
        if math.isnan(reading.range_min):
            return "scan with range_min nan"
        if reading.ranges.size > 1 and not abs(reading.angle_increment) > 0.0:
            return f"scan with angle_increment {reading.angle_increment:g}"
        return beams.problem_of(reading)

    def measure(self, reading: Reading, base_from_sensor: FloatArray, sweep: Sweep | None = None) -> Measurement:
        """Measurement of a scan."""
        assert isinstance(reading, LaserScan)  # noqa: S101 - see problem()
        chosen = beams.select(reading, base_from_sensor, self.selection, sweep)
        measured = self.model.measure(self.name, chosen, self.alpha)
        if self.check is None:
            return measured
        judged = beams.select(reading, base_from_sensor, self.check.selection, sweep)
        return replace(measured, check=self.check.model.measure(self.name, judged))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Whatever sees landmarks, scored by their bearings."""

    name: str
    model: BearingModel
    landmarks: Landmarks
    alpha: Temperature = 1.0

    def problem(self, reading: Reading) -> str:
        """Why sightings cannot be used."""
        if not isinstance(reading, LandmarkSightings):
            return "not a sighting of landmarks"
        if (np.abs(reading.rays) <= FARTHEST).all():
            return ""
        return f"sighting with a position that is not finite, or beyond {FARTHEST:g} m"

    def measure(self, reading: Reading, base_from_sensor: FloatArray, sweep: Sweep | None = None) -> Measurement:
        """Measurement of the sightings in one image, made at one moment."""
        del sweep
        assert isinstance(reading, LandmarkSightings)  # noqa: S101 - see problem()
        return self.model.measure(self.name, bearing.observe(reading, base_from_sensor, self.landmarks), self.alpha)


def combine(instrument: Instrument, measurements: Sequence[Measurement]) -> Measurement:
    """One measurement for all readings of an instrument since the last update; none at all scores 0."""

    def log_likelihood(poses: FloatArray) -> FloatArray:
        total = np.zeros(poses.shape[0])
        for measurement in measurements:
            total += measurement.log_likelihood(poses)
        return total

    count = sum(m.count for m in measurements)
    peak = sum(m.log_peak for m in measurements)
    floor = sum(m.log_floor for m in measurements)
    each, sweep = (measurements[-1].each, measurements[-1].sweep) if measurements else (None, 0.0)
    unknown = sum(m.unknown for m in measurements)
    checks = [m.check for m in measurements if m.check is not None]
    return Measurement(
        instrument.name,
        log_likelihood,
        count,
        peak,
        instrument.alpha,
        each,
        unknown,
        check=combine(instrument, checks) if checks else None,
        log_floor=floor,
        sweep=sweep,
    )
