from __future__ import annotations

import logging
import math

import numpy as np
import pytest

from mclcli.errors import InputError
from mclcli.io.logs import open_log
from mclcli.io.logs.base import Channel, RawMessage, Tally
from mclcli.io.messages.decoding import DECODABLE, Undecodable, decode, planar_covariance, to_plain
from mclcli.records import LandmarkSightings, LaserScan, Odometry, StampedPose, Transform
from mclcli.world.occupancy import OccupancyGrid
from tests.data import shared
from tests.io.ros_messages import BEARINGS, GRID, LOG_TIME, MARKERS, ODOMETRY, SAMPLES, SCAN, edge, header, pose, raw

BOTH = pytest.mark.parametrize("encoding", ["cdr", "ros1"])


@BOTH
def test_laser_scan(encoding: str) -> None:
    scan = decode(raw(encoding, "sensor_msgs/msg/LaserScan", SCAN))
    assert isinstance(scan, LaserScan)
    assert (scan.stamp_ns, scan.frame_id) == (5 * 10**9 + 7, "laser")
    assert scan.angle_increment == float(np.float32(0.1))
    assert (scan.range_max, scan.scan_time) == (12.0, float(np.float32(0.2)))
    np.testing.assert_array_equal(scan.ranges, [1.25, math.nan, math.inf, -1.0])
    assert scan.ranges.dtype == np.float64
    assert not scan.ranges.flags.writeable


@BOTH
def test_odometry(encoding: str) -> None:
    record = decode(raw(encoding, "nav_msgs/msg/Odometry", ODOMETRY))
    assert isinstance(record, Odometry)
    assert (record.frame_id, record.child_frame_id) == ("odom", "base")
    np.testing.assert_allclose(record.pose, [1.0, 2.0, 0.5], atol=1e-15)


@pytest.mark.parametrize(
    ("encoding", "kind"),
    [("cdr", "tf2_msgs/msg/TFMessage"), ("ros1", "tf2_msgs/msg/TFMessage"), ("ros1", "tf/msg/tfMessage")],
)
def test_transforms_and_those_that_are_not_rigid(encoding: str, kind: str) -> None:
    tally = Tally()
    record = decode(raw(encoding, kind, {"transforms": [edge(), edge(norm=1.2), edge(norm=1e200)]}), tally)
    assert isinstance(record, tuple)
    (transform,) = record
    assert (transform.parent, transform.child, transform.static) == ("odom", "base", False)
    np.testing.assert_allclose(transform.parent_from_child[:3, 3], [3.0, 4.0, 0.3])
    np.testing.assert_allclose(transform.parent_from_child[:2, 0], [math.cos(1.0), math.sin(1.0)])
    assert tally.notes == {"/t": {"transform left out: not rigid": 2}}


def test_static_transforms_are_told_by_their_topic_and_may_have_no_stamp() -> None:
    tally = Tally()
    message = raw(
        "cdr", "tf2_msgs/msg/TFMessage", {"transforms": [edge(header=header("a", 0, 0))]}, topic="/x/tf_static"
    )
    record = decode(message, tally)
    assert isinstance(record, tuple)
    assert isinstance(record[0], Transform)
    assert (record[0].static, record[0].stamp_ns, tally.notes) == (True, LOG_TIME, {})


@BOTH
def test_a_transform_on_a_topic_of_its_own(encoding: str) -> None:
    kind = "geometry_msgs/msg/TransformStamped"
    found = decode(raw(encoding, kind, edge(header=header("/mocap")), topic="/x/tf_static"))
    assert isinstance(found, Transform)
    assert (found.stamp_ns, found.parent, found.child, found.static) == (5 * 10**9 + 7, "mocap", "base", False)
    np.testing.assert_allclose(found.parent_from_child[:3, 3], [3.0, 4.0, 0.3])
    assert isinstance(decode(raw(encoding, kind, edge(norm=1.2))), Undecodable)


@BOTH
def test_a_pose_is_kept_in_space_too(encoding: str) -> None:
    lying = pose() | {"orientation": {"x": math.sqrt(0.5), "y": 0.0, "z": 0.0, "w": math.sqrt(0.5)}}
    found = decode(raw(encoding, "geometry_msgs/msg/PoseStamped", {"header": header("/map"), "pose": lying}))
    assert isinstance(found, StampedPose)
    assert found.matrix is not None
    wanted = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 2.0], [0.0, 1.0, 0.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
    np.testing.assert_allclose(found.matrix, wanted, atol=1e-12)
    np.testing.assert_array_equal(found.pose, [1.0, 2.0, 0.0])


@BOTH
def test_poses_and_their_covariance(encoding: str) -> None:
    covariance = np.zeros((6, 6))
    covariance[np.ix_([0, 1, 5], [0, 1, 5])] = [[4.0, 1.0, 0.1], [1.0, 3.0, 0.2], [0.1, 0.2, 0.5]]
    covariance[2, 2] = 99.0
    values = {"header": header("map"), "pose": {"pose": pose(), "covariance": covariance.ravel()}}
    record = decode(raw(encoding, "geometry_msgs/msg/PoseWithCovarianceStamped", values))
    assert isinstance(record, StampedPose)
    assert record.covariance is not None
    np.testing.assert_array_equal(record.covariance, [[4.0, 1.0, 0.1], [1.0, 3.0, 0.2], [0.1, 0.2, 0.5]])
    plain = decode(raw(encoding, "geometry_msgs/msg/PoseStamped", SAMPLES["geometry_msgs/msg/PoseStamped"]))
    assert isinstance(plain, StampedPose)
    assert plain.covariance is None


@pytest.mark.parametrize("wrong", [0.0, math.nan, math.inf, -1.0, 1e300])
def test_unusable_covariances_are_none(wrong: float) -> None:
    covariance = np.zeros(36)
    covariance[0] = wrong
    assert planar_covariance(covariance) is None
    lopsided = np.eye(6)
    lopsided[0, 1] = 0.5
    assert planar_covariance(lopsided.ravel()) is None
    assert planar_covariance(np.eye(6).ravel()) is not None


@BOTH
def test_occupancy_grid(encoding: str) -> None:
    grid = decode(raw(encoding, "nav_msgs/msg/OccupancyGrid", GRID))
    assert isinstance(grid, OccupancyGrid)
    np.testing.assert_array_equal(grid.cells, [[0, 100, -1], [0, 0, 50]])
    np.testing.assert_allclose(grid.origin, [-1.0, -2.0, 0.25])
    assert grid.resolution == float(np.float32(0.05))
    assert grid.frame_id == "map"
    info = GRID["info"] | {"width": 4}
    assert decode(raw(encoding, "nav_msgs/msg/OccupancyGrid", GRID | {"info": info})) == Undecodable(
        "its cells are not width × height"
    )


@BOTH
def test_landmark_sightings(encoding: str) -> None:
    tally = Tally()
    seen = decode(raw(encoding, "ros2_aruco_interfaces/msg/ArucoMarkers", MARKERS), tally)
    assert isinstance(seen, LandmarkSightings)
    assert (seen.frame_id, seen.ids) == ("base", ("63",))
    np.testing.assert_array_equal(seen.rays, [[1.0, -2.0, 0.3]])
    assert tally.notes == {"/t": {"sighting left out: no direction": 1}}
    bearings = decode(raw(encoding, "mcl_msgs/msg/LandmarkBearings", BEARINGS))
    assert isinstance(bearings, LandmarkSightings)
    assert bearings.ids == ("a", "b")
    np.testing.assert_allclose(np.arctan2(bearings.rays[:, 1], bearings.rays[:, 0]), [0.5, -3.0])


def test_a_stamp_of_zero_is_replaced_by_log_time_noted_and_told_once(caplog: pytest.LogCaptureFixture) -> None:
    tally = Tally()
    message = raw("cdr", "sensor_msgs/msg/LaserScan", SCAN | {"header": header(sec=0, nanosec=0)})
    with caplog.at_level(logging.WARNING, logger="mclcli"):
        records = [decode(message, tally) for _ in range(3)]
    assert [record.stamp_ns for record in records if isinstance(record, LaserScan)] == [LOG_TIME] * 3
    assert tally.notes == {"/t": {"header stamp is 0: log time used": 3}}
    assert len(caplog.messages) == 1


@pytest.mark.parametrize(("angle_max", "noted"), [(-1.2, 0), (-1.1, 0), (-1.0, 1), (9.0, 1), (math.nan, 1)])
def test_an_angle_max_off_by_more_than_a_beam_is_noted(angle_max: float, noted: int) -> None:
    tally = Tally()
    record = decode(raw("cdr", "sensor_msgs/msg/LaserScan", SCAN | {"angle_max": angle_max}), tally)
    assert isinstance(record, LaserScan)
    assert record.ranges.size == 4
    assert sum(tally.notes.get("/t", {}).values()) == noted


@pytest.mark.parametrize("place", [1e300, -2e9, math.inf, math.nan])
def test_what_is_beyond_all_bounds_is_undecodable(place: float) -> None:
    odometry = ODOMETRY | {"pose": {"pose": pose(place), "covariance": np.zeros(36)}}
    record = decode(raw("cdr", "nav_msgs/msg/Odometry", odometry))
    assert isinstance(record, Undecodable)
    assert "beyond 1e9 m" in record.reason


def test_messages_that_would_fill_the_memory_are_undecodable() -> None:
    long = RawMessage(Channel("/t", "tf2_msgs/msg/TFMessage", "cdr"), 0, bytes((4 << 20) + 1))
    assert decode(long) == Undecodable("it is longer than 4 MiB")
    grid = RawMessage(Channel("/t", "nav_msgs/msg/OccupancyGrid", "cdr"), 0, bytes((4 << 20) + 1))
    assert decode(grid) != Undecodable("it is longer than 4 MiB")
    with pytest.raises(InputError, match="longer than 16 MiB"):
        to_plain(RawMessage(Channel("/t", "sensor_msgs/msg/Image", "cdr"), 0, bytes((16 << 20) + 1)))


def test_other_types_and_encodings_are_undecodable_with_their_name() -> None:
    assert decode(RawMessage(Channel("/t", "x/msg/Y", "cdr"), 0, b"")) == Undecodable(
        "its type 'x/msg/Y' is of no use here"
    )
    result = decode(RawMessage(Channel("/t", "nav_msgs/msg/Odometry", "json"), 0, b"{}"))
    assert result == Undecodable("its encoding 'json' is not supported: mcl reads CDR, and ROS 1's own serialization")
    assert "tf/msg/tfMessage" in DECODABLE


@BOTH
def test_to_plain_keeps_fields_and_their_order(encoding: str) -> None:
    plain = to_plain(raw(encoding, "sensor_msgs/msg/LaserScan", SCAN))
    assert list(plain)[:3] == ["header", "angle_min", "angle_max"]
    assert plain["ranges"][0] == 1.25
    assert plain["header"]["stamp"] == {"sec": 5, "nanosec": 7}
    assert type(plain["range_min"]) is float
    assert (
        to_plain(raw(encoding, "tf2_msgs/msg/TFMessage", SAMPLES["tf2_msgs/msg/TFMessage"]))["transforms"][1][
            "child_frame_id"
        ]
        == "base"
    )


def test_to_plain_says_what_it_cannot_read() -> None:
    with pytest.raises(InputError, match=r"/t: message cannot be decoded: its type 'x/msg/Y' is not known"):
        to_plain(RawMessage(Channel("/t", "x/msg/Y", "cdr"), 0, b""))


@pytest.mark.parametrize(
    ("relative", "expected"),
    [
        ("olin/macfirst_floor_take_2", {LaserScan: 357, Odometry: 920, tuple: 955}),
        ("birmingham/simpath2.bag", {LaserScan: 634, Odometry: 1268, tuple: 1902}),
        ("intel/intel.mcap", {LaserScan: 910, Odometry: 910, StampedPose: 910, tuple: 911}),
    ],
)
def test_real_logs_decode_without_a_remark(relative: str, expected: dict[type, int]) -> None:
    tally = Tally()
    found: dict[type, int] = {}
    for message in open_log([shared(relative)]).messages(None, tally):
        if message.channel.type in DECODABLE:
            kind = type(decode(message, tally))
            found[kind] = found.get(kind, 0) + 1
    assert found == expected
    assert (tally.notes, tally.skipped, tally.lossy) == ({}, {}, False)
