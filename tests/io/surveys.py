"""Surveys of logs that were never written: topics with a sample each, and moving transforms."""

from __future__ import annotations

import numpy as np

from mclcli.io.logs.base import Channel
from mclcli.io.recording.survey import LogSurvey, TopicSurvey
from mclcli.records import Odometry, StampedPose
from tests.support import level, scan_of, sightings, transform

LASER, ODOM = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
POSE, MARKERS = "geometry_msgs/msg/PoseStamped", "ros2_aruco_interfaces/msg/ArucoMarkers"
SAMPLES: dict[str, object] = {
    LASER: scan_of([1.0]),
    ODOM: Odometry(0, "odom", "base_footprint", np.zeros(3)),
    POSE: StampedPose(0, "map", np.zeros(3)),
    MARKERS: sightings(0, ["1"], level(0.0)),
    "nav_msgs/msg/OccupancyGrid": object(),
}


def log_of(*topics: tuple[str, str], moving: tuple[tuple[str, str], ...] = ()) -> LogSurvey:
    """Survey with these topics and these moving transforms, parent and child."""
    survey = LogSurvey()
    for name, kind in topics:
        survey.topics[name] = TopicSurvey(Channel(name, kind, "cdr"), count=1, sample=SAMPLES.get(kind))
    for parent, child in moving:
        for stamp in (0, 1):
            matrix = np.eye(4)
            matrix[0, 3] = stamp
            survey.of_transforms("/tf").add("/tf", [transform(stamp, parent, child, matrix)])
    return survey
