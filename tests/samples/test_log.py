from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se2, se3
from samples.sim.log_writer import write_log
from samples.sim.recording import START_NS, Recording, simulate
from samples.sim.sensors import Lidar, Mount
from tests.samples.naive import Decoded, by_topic, read_log, small_scenario

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.arrays import FloatArray


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(small_scenario())


@pytest.fixture(scope="module")
def log(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> list[Decoded]:
    path = tmp_path_factory.mktemp("log") / "small.mcap"
    write_log(recording, path)
    return read_log(path)


def transforms(log: list[Decoded]) -> dict[tuple[str, str], FloatArray]:
    """Static transforms by (parent, child)."""
    edges = {}
    for entry in by_topic(log)["/tf_static"]:
        for edge in entry.message.transforms:
            t, q = edge.transform.translation, edge.transform.rotation
            matrix = se3.from_quaternion([t.x, t.y, t.z], [q.x, q.y, q.z, q.w])
            edges[edge.header.frame_id, edge.child_frame_id] = matrix
    return edges


def test_the_same_scenario_gives_the_same_bytes(recording: Recording, tmp_path: Path) -> None:
    write_log(recording, tmp_path / "a.mcap")
    write_log(simulate(small_scenario()), tmp_path / "b.mcap")
    write_log(simulate(small_scenario(seed=6)), tmp_path / "c.mcap")
    first, second, other = ((tmp_path / f"{name}.mcap").read_bytes() for name in "abc")
    assert first == second
    assert first != other


def test_topics_types_and_frames(log: list[Decoded]) -> None:
    topics = by_topic(log)
    assert {topic: messages[0].type for topic, messages in topics.items()} == {
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/odom": "nav_msgs/msg/Odometry",
        "/ground_truth": "geometry_msgs/msg/PoseStamped",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/landmarks": "mcl_msgs/msg/LandmarkBearings",
    }
    frames = {topic: m[0].message.header.frame_id for topic, m in topics.items() if not topic.startswith("/tf")}
    expected = {"/initialpose": "map", "/odom": "odom", "/ground_truth": "map", "/scan": "laser"}
    assert frames == expected | {"/landmarks": "camera_link"}
    assert topics["/odom"][0].message.child_frame_id == "base_link"
    assert len(topics["/initialpose"]) == len(topics["/tf_static"]) == 1


def test_messages_stand_in_log_order_after_their_stamps(log: list[Decoded]) -> None:
    times = [entry.log_ns for entry in log]
    assert times == sorted(times)
    assert times[0] == START_NS
    assert log[0].topic == "/tf_static"
    for entry in log:
        assert 0 <= entry.log_ns - entry.stamp_ns < 100_000_000
        if not entry.topic.startswith("/tf"):
            stamp = entry.message.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec == entry.stamp_ns


def test_scans_lie_within_the_odometry(log: list[Decoded]) -> None:
    topics = by_topic(log)
    odom = [entry.stamp_ns for entry in topics["/odom"]]
    assert set(np.diff(odom).tolist()) == {40_000_000}
    assert odom[0] <= topics["/scan"][0].stamp_ns
    assert odom[-1] >= topics["/scan"][-1].stamp_ns
    assert [entry.stamp_ns for entry in topics["/ground_truth"]] == odom


def test_the_log_holds_the_recording(recording: Recording, log: list[Decoded]) -> None:
    topics = by_topic(log)
    ranges = np.array([entry.message.ranges for entry in topics["/scan"]])
    np.testing.assert_array_equal(ranges, recording.ranges)
    scan = topics["/scan"][0].message
    assert scan.angle_max == pytest.approx(scan.angle_min + 89 * scan.angle_increment, abs=1e-5)
    assert scan.scan_time == pytest.approx(1 / 8)
    for entry, pose in zip(topics["/odom"], recording.odom.poses, strict=True):
        at = entry.message.pose.pose
        yaw = 2 * math.atan2(at.orientation.z, at.orientation.w)
        np.testing.assert_allclose(se2.between(pose, [at.position.x, at.position.y, yaw]), 0.0, atol=1e-12)
    for entry, edge in zip(topics["/odom"], topics["/tf"], strict=True):
        at, (moved,) = entry.message.pose.pose, edge.message.transforms
        assert (moved.header.frame_id, moved.child_frame_id) == ("odom", "base_link")
        assert (moved.transform.translation.x, moved.transform.rotation) == (at.position.x, at.orientation)
    seen = [(tuple(e.message.ids), e.message.bearings.tolist()) for e in topics["/landmarks"]]
    assert seen == [(s.ids, s.bearings.tolist()) for s in recording.sightings]


def test_the_twist_is_the_motion_of_the_odometry(log: list[Decoded]) -> None:
    entries = [entry.message for entry in by_topic(log)["/odom"]]
    poses = np.array([[e.pose.pose.position.x, e.pose.pose.position.y] for e in entries])
    speeds = np.array([np.hypot(e.twist.twist.linear.x, e.twist.twist.linear.y) for e in entries])
    assert speeds.max() > 0.5
    np.testing.assert_allclose(np.hypot(*np.diff(poses, axis=0).T) / 0.04, speeds[1:], atol=1e-3)


def test_mounts(log: list[Decoded], tmp_path: Path) -> None:
    edges = transforms(log)
    assert set(edges) == {("base_link", "laser"), ("base_link", "camera_link")}
    np.testing.assert_allclose(se3.to_rpy(edges["base_link", "laser"]), (0.1, 0.02, 0.2, 0.0, 0.0, 0.3), atol=1e-12)
    hung = small_scenario(
        lidar=Lidar(Mount(0.1, 0.0, 0.3, yaw=0.4, upside_down=True), beams=9), chain=("base_footprint", "base_link")
    )
    write_log(simulate(hung), tmp_path / "hung.mcap")
    edges = transforms(read_log(tmp_path / "hung.mcap"))
    assert ("base_footprint", "base_link") in edges
    np.testing.assert_allclose(
        np.abs(se3.to_rpy(edges["base_link", "laser"])), (0.1, 0.0, 0.3, math.pi, 0.0, 0.4), atol=1e-12
    )


def test_the_stated_start_is_near_the_true_one(recording: Recording, log: list[Decoded]) -> None:
    (entry,) = by_topic(log)["/initialpose"]
    at = entry.message.pose.pose
    x, y, yaw = recording.truth.poses[0]
    assert 0.0 < math.dist((at.position.x, at.position.y), (x, y)) < 0.6
    assert abs(float(se2.wrap(2 * math.atan2(at.orientation.z, at.orientation.w) - yaw))) < 0.3
    covariance = entry.message.pose.covariance.reshape(6, 6)
    np.testing.assert_allclose(np.diag(covariance), [0.25, 0.25, 0, 0, 0, math.radians(15) ** 2])


def test_a_log_without_a_camera_has_no_landmarks(tmp_path: Path) -> None:
    write_log(simulate(small_scenario(camera=None)), tmp_path / "blind.mcap")
    log = read_log(tmp_path / "blind.mcap")
    assert "/landmarks" not in by_topic(log)
    assert set(transforms(log)) == {("base_link", "laser")}
