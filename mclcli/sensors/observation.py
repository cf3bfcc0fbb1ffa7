"""A reading together with all that is needed to use it later: when, from where, through which mount."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.instruments import Reading


@final
@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One reading of ``topic``, at ``reading.stamp_ns``.

    ``odom_from_base`` (3,) is the interpolated odometry at its stamp: the base moved by ``se2.between`` of two of them.
    ``base_from_sensor`` (4, 4) is the sensor's mount on the base then, with its full rotation.
    """

    topic: str
    reading: Reading
    odom_from_base: FloatArray
    base_from_sensor: FloatArray
