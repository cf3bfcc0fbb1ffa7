"""What was seen since the last update, as measurements from where the robot is now."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2, se3
from mclcli.records import LaserScan
from mclcli.sensors.instruments import combine

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import FloatArray
    from mclcli.motion.odometry import OdometryPath
    from mclcli.replay.intake import Setup
    from mclcli.sensors import Measurement
    from mclcli.sensors.beams import Sweep
    from mclcli.sensors.instruments import Reading
    from mclcli.sensors.observation import Observation


def measure(
    setup: Setup, path: OdometryPath, observations: Sequence[Observation], odom: FloatArray
) -> list[Measurement]:
    """One measurement per instrument; earlier readings are seen from where the base was at their stamps.

    ``odom`` (3,) is the odometry now.
    """
    parts: dict[str, list[Measurement]] = {topic: [] for topic in setup.instruments}
    for observation in observations:
        instrument, reading = setup.instruments[observation.topic], observation.reading
        sweep = sweep_of(setup, path, reading, odom)
        if sweep is None:
            now_from_then = se3.from_planar(se2.between(odom, observation.odom_from_base))
            measured = instrument.measure(reading, now_from_then @ observation.base_from_sensor)
            measured = dataclasses.replace(measured, sweep=_lasting(reading))
        else:
            measured = instrument.measure(reading, observation.base_from_sensor, sweep)
        parts[observation.topic].append(measured)
    return [combine(setup.instruments[topic], measured) for topic, measured in parts.items()]


def sweep_of(setup: Setup, path: OdometryPath, reading: Reading, odom: FloatArray) -> Sweep | None:
    """Where the base was at each beam of a scan, seen from the update's base; None if all count as at the stamp."""
    if not isinstance(reading, LaserScan) or setup.until_ns(reading) == reading.stamp_ns:
        return None
    increment_ns = reading.time_increment * 1e9
    return lambda beams: se2.between(
        odom, path.along(reading.stamp_ns + np.round(beams * increment_ns).astype(np.int64))
    )


def _lasting(reading: Reading) -> float:
    """Seconds that a scan takes, 0 if it does not say."""
    seconds = abs(reading.time_increment) * reading.ranges.size if isinstance(reading, LaserScan) else 0.0
    return seconds if math.isfinite(seconds) else 0.0


def has_moved(increment: FloatArray, min_d: float, min_a: float) -> bool:
    """Whether the base moved (Euclidean, [m]) or turned [rad] far enough since the last update for another one."""
    return math.hypot(increment[0], increment[1]) >= min_d or abs(float(increment[2])) >= min_a


def has_moved_on_an_axis(difference: FloatArray, min_d: float, min_a: float) -> bool:
    """nav2_amcl's gate: x, y [m] or yaw [rad] of the odometry's own frame differ by more than the thresholds."""
    yaw = math.remainder(difference[2], 2.0 * math.pi)
    return abs(difference[0]) > min_d or abs(difference[1]) > min_d or abs(yaw) > min_a
