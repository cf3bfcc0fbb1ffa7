"""One particle of an omnidirectional robot, in the frame of the map as nav2_amcl writes it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tests.reference.filter import wrap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.reference.filter import Pose


def omnidirectional(
    pose: Sequence[float], increment: Sequence[float], alphas: Sequence[float], normals: Sequence[float]
) -> Pose:
    """Move by a noisy distance along the bearing of the increment and by noise across it, then turn."""
    dx, dy, dyaw = increment
    a1, a2, a3, a4, a5 = alphas
    distance = math.hypot(dx, dy)
    bearing = pose[2] + (math.atan2(dy, dx) if distance > 0.0 else 0.0)
    along = distance + normals[0] * math.sqrt(a3 * distance**2 + a4 * dyaw**2)
    turn = dyaw + normals[1] * math.sqrt(a1 * dyaw**2 + a2 * distance**2)
    across = normals[2] * math.sqrt(a4 * dyaw**2 + a5 * distance**2)
    return (
        pose[0] + along * math.cos(bearing) + across * math.sin(bearing),
        pose[1] + along * math.sin(bearing) - across * math.cos(bearing),
        wrap(pose[2] + turn),
    )
