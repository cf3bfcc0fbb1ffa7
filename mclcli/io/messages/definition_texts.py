"""Fields of message types that rosbags' stores lack, in our own words; where a type changed, every known version.

``OWN`` holds for ROS 1 and ROS 2, ``ROS1`` and ``ROS2`` for one of them. ``OLDER`` are earlier ROS 2 versions of the
types in ``OWN`` and ``ROS2``: each replaces those of the same name.
"""

from __future__ import annotations

Texts = dict[str, str]

_HEADER = "std_msgs/Header header\n"

# https://github.com/ros-perception/vision_msgs: 4.0 (Humble and later), 3.0 (Galactic), 2.0 (Foxy), 0.0 (ROS 1)
_DETECTIONS = {
    "vision_msgs/msg/Detection2DArray": f"{_HEADER}vision_msgs/Detection2D[] detections\n",
    "vision_msgs/msg/Detection3DArray": f"{_HEADER}vision_msgs/Detection3D[] detections\n",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
}
_BOX_2D = "float64 size_x\nfloat64 size_y\n"
_GEOMETRY_BOX = {"vision_msgs/msg/BoundingBox2D": f"geometry_msgs/Pose2D center\n{_BOX_2D}"}
_HYPOTHESES = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
}
_FLAT_HYPOTHESIS = "float64 score\ngeometry_msgs/PoseWithCovariance pose\n"


def _detection(dimensions: int, tail: str) -> Texts:
    results = "vision_msgs/ObjectHypothesisWithPose[] results\n"
    box = f"vision_msgs/BoundingBox{dimensions}D bbox\n"
    return {f"vision_msgs/msg/Detection{dimensions}D": f"{_HEADER}{results}{box}{tail}"}


_VISION_4 = {
    **_DETECTIONS,
    **_HYPOTHESES,
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y\n",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "vision_msgs/msg/BoundingBox2D": f"vision_msgs/Pose2D center\n{_BOX_2D}",
    **_detection(2, "string id\n"),
    **_detection(3, "string id\n"),
}
_VISION_3 = {
    **_DETECTIONS,
    **_HYPOTHESES,
    **_GEOMETRY_BOX,
    **_detection(2, "string id\n"),
    **_detection(3, "string id\n"),
}
_VISION_2 = {
    **_DETECTIONS,
    **_GEOMETRY_BOX,
    "vision_msgs/msg/ObjectHypothesisWithPose": f"string id\n{_FLAT_HYPOTHESIS}",
    **_detection(2, "sensor_msgs/Image source_img\nbool is_tracking\nstring tracking_id\n"),
    **_detection(3, "sensor_msgs/PointCloud2 source_cloud\nbool is_tracking\nstring tracking_id\n"),
}
_VISION_ROS1 = {
    **_DETECTIONS,
    **_GEOMETRY_BOX,
    "vision_msgs/msg/ObjectHypothesisWithPose": f"int64 id\n{_FLAT_HYPOTHESIS}",
    **_detection(2, "sensor_msgs/Image source_img\n"),
    **_detection(3, "sensor_msgs/PointCloud2 source_cloud\n"),
}

# https://github.com/christianrauch/apriltag_msgs: centre and corners were plain arrays once
_TAG = "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
_APRILTAG = {
    "apriltag_msgs/msg/AprilTagDetectionArray": f"{_HEADER}apriltag_msgs/AprilTagDetection[] detections\n",
    "apriltag_msgs/msg/AprilTagDetection": (
        f"{_TAG}apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography\n"
    ),
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y\n",
}
_APRILTAG_ARRAYS = {
    "apriltag_msgs/msg/AprilTagDetectionArray": _APRILTAG["apriltag_msgs/msg/AprilTagDetectionArray"],
    "apriltag_msgs/msg/AprilTagDetection": (f"{_TAG}float64[2] centre\nfloat64[8] corners\nfloat64[9] homography\n"),
}

OWN: Texts = {
    # https://github.com/JMU-ROBOTICS-VIVA/ros2_aruco, ros2_aruco_interfaces/msg/ArucoMarkers.msg
    "ros2_aruco_interfaces/msg/ArucoMarkers": f"{_HEADER}int64[] marker_ids\ngeometry_msgs/Pose[] poses\n",
    # https://github.com/fictionlab/ros_aruco_opencv, aruco_opencv_msgs/msg: MarkerDetection became ArucoDetection
    # when boards were added
    "aruco_opencv_msgs/msg/ArucoDetection": (
        f"{_HEADER}aruco_opencv_msgs/MarkerPose[] markers\naruco_opencv_msgs/BoardPose[] boards\n"
    ),
    "aruco_opencv_msgs/msg/MarkerDetection": f"{_HEADER}aruco_opencv_msgs/MarkerPose[] markers\n",
    "aruco_opencv_msgs/msg/MarkerPose": "uint16 marker_id\ngeometry_msgs/Pose pose\n",
    "aruco_opencv_msgs/msg/BoardPose": "string board_name\ngeometry_msgs/Pose pose\n",
    **_APRILTAG,
    "mcl_msgs/msg/LandmarkBearings": f"{_HEADER}string[] ids\nfloat64[] bearings\n",
    "mcl_msgs/msg/Step": (
        f"{_HEADER}uint32 step\nuint32 n\nfloat64 ess\nfloat64 log_evidence\nbool resampled\n"
        "bool degenerate\nuint32 beams_used\nstring[] sensors\nfloat64[] alphas\nfloat32[] log_likelihoods\n"
    ),
    # https://github.com/ros-navigation/navigation2, nav2_msgs/msg
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight\n",
    "nav2_msgs/msg/ParticleCloud": f"{_HEADER}nav2_msgs/Particle[] particles\n",
}
ROS1: Texts = {
    # https://github.com/ros/geometry2 and https://github.com/ros/geometry
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "tf/msg/tfMessage": "geometry_msgs/TransformStamped[] transforms\n",
    **_VISION_ROS1,
}
ROS2: Texts = _VISION_4
OLDER: tuple[Texts, ...] = ({**_VISION_3, **_APRILTAG_ARRAYS}, _VISION_2)
