"""A message of landmarks: one landmark by name, and where it is from the sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.io.messages.conversion import frame_name, read_only
from mclcli.io.messages.sightings import VisionMessage
from mclcli.records import LandmarkSightings

if TYPE_CHECKING:
    from mclcli.io.messages.conversion import Context, Parsed

KIND, TEXT = "toy_msgs/msg/Seen", "std_msgs/Header header\nstring landmark\nfloat64 x\nfloat64 y\n"


def convert(value: Parsed, context: Context) -> LandmarkSightings:
    """The one sighting."""
    rays = read_only(np.array([[value.x, value.y, 0.0]]))
    return LandmarkSightings(context.stamp(value.header), frame_name(value.header.frame_id), (value.landmark,), rays)


TOY = VisionMessage("rays", convert, {KIND: TEXT})
