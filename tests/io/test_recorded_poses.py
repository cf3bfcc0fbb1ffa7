"""Poses that logs and files state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.errors import InputError, UsageError
from mclcli.io.recording.recorded_poses import RecordedPoses, read_trajectory, split_source
from mclcli.io.recording.recording import open_recording
from tests.cli.support import OFFICE, SAMPLES, START_NS, made, write_mcap

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.support import Message


def stamp(seconds: float) -> dict[str, int]:
    whole, rest = divmod(START_NS + round(seconds * 1e9), 10**9)
    return {"sec": whole, "nanosec": rest}


def pose_message(seconds: float, x: float, variance: float, y: float = 0.0, yaw: float = 0.0) -> Message:
    """An /amcl_pose."""
    covariance = (variance * np.diag([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])).ravel()
    values = {
        "header": {"stamp": stamp(seconds), "frame_id": "map"},
        "pose": {
            "pose": {"position": {"x": x, "y": y}, "orientation": {"z": np.sin(yaw / 2), "w": np.cos(yaw / 2)}},
            "covariance": covariance,
        },
    }
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    return made("/amcl_pose", kind, values, START_NS + round(seconds * 1e9))


def tf_message(seconds: float, parent: str, child: str, x: float, late: float = 0.0) -> Message:
    """A /tf of one transform along x, stamped ``late`` seconds after it was sent."""
    transform = {
        "header": {"stamp": stamp(seconds + late), "frame_id": parent},
        "child_frame_id": child,
        "transform": {"translation": {"x": x}, "rotation": {"w": 1.0}},
    }
    kind = "tf2_msgs/msg/TFMessage"
    return made("/tf", kind, {"transforms": [transform]}, START_NS + round(seconds * 1e9))


@pytest.mark.parametrize(
    ("source", "log", "where"),
    [
        ("run.mcap:/amcl_pose", "run.mcap", "/amcl_pose"),
        ("/a/b:c.bag:/robot/pose", "/a/b:c.bag", "/robot/pose"),
        ("folder:tf:map", "folder", "tf:map"),
        ("truth.tum", "truth.tum", ""),
        ("-", "-", ""),
        (":/topic", ":/topic", ""),
    ],
)
def test_what_a_source_names(source: str, log: str, where: str) -> None:
    assert split_source(source) == (log, where)


@pytest.mark.parametrize("where", ["odom", "/odom", "tf:map", "tf:map:base_link", "robot/pose", "a:b"])
def test_whatever_follows_a_log_that_is_there_is_named_in_it(tmp_path: Path, where: str) -> None:
    log = tmp_path / "a:b.mcap"
    log.touch()
    assert split_source(f"{log}:{where}") == (str(log), where)


def test_a_file_of_that_name_comes_first(tmp_path: Path) -> None:
    odd = tmp_path / "a:tf:b"
    odd.write_text("1 0 0 0 0 0 0 1\n")
    assert read_trajectory(str(odd)).stamps_ns.tolist() == [10**9]


def test_poses_of_a_topic_come_in_order_with_covariances(tmp_path: Path) -> None:
    contents = [pose_message(s, x, 0.01 * x) for s, x in ((2.0, 3.0), (1.0, 2.0), (2.0, 4.0))]
    found = read_trajectory(f"{write_mcap(tmp_path / 'a.mcap', contents)}:/amcl_pose")
    assert (found.stamps_ns - START_NS).tolist() == [10**9, 2 * 10**9]
    assert found.poses[:, 0].tolist() == [2.0, 4.0]
    assert found.covariances is not None
    np.testing.assert_allclose(found.covariances[1], 0.04 * np.eye(3))


def test_one_unusable_covariance_leaves_all_out(tmp_path: Path) -> None:
    contents = [pose_message(1.0, 2.0, 0.1), pose_message(2.0, 2.0, 0.0)]
    assert read_trajectory(f"{write_mcap(tmp_path / 'a.mcap', contents)}:/amcl_pose").covariances is None


def test_poses_of_a_frame_are_told_whenever_they_are_known(tmp_path: Path) -> None:
    contents = []
    for i in range(10):
        contents.append(tf_message(0.1 * i, "odom", "base_link", 0.1 * i))
        contents.append(tf_message(0.1 * i, "map", "odom", 10.0 + i, late=0.25))
    found = read_trajectory(f"{write_mcap(tmp_path / 'a.mcap', contents)}:tf:map")
    seconds = (found.stamps_ns - START_NS) * 1e-9
    np.testing.assert_allclose(seconds, np.arange(3, 10) * 0.1, atol=1e-9)
    # as tf says it: at 0.3 s half-way between what is stamped 0.25 s (10) and 0.35 s (11)
    np.testing.assert_allclose(found.poses[:, 0], 10.5 + np.arange(7) + 0.1 * np.arange(3, 10), atol=1e-9)


def test_the_samples_truth_is_the_same_from_log_and_file() -> None:
    from_topic, from_file = (read_trajectory(s) for s in (f"{OFFICE}:/ground_truth", str(SAMPLES / "office.truth.tum")))
    there, covered = from_file.at(from_topic.stamps_ns, 10**9)
    assert covered.sum() > 400
    np.testing.assert_allclose(from_topic.poses[covered], there[covered], atol=1e-3)
    from_tf = read_trajectory(f"{OFFICE}:tf:odom", as_stated=True)
    odometry = read_trajectory(f"{OFFICE}:/odom", as_stated=True)
    there, covered = odometry.at(from_tf.stamps_ns, 10**9)
    assert covered.sum() > 400
    np.testing.assert_allclose(from_tf.poses[covered], there[covered], atol=1e-6)


@pytest.mark.parametrize(
    ("where", "kind", "message"),
    [
        ("/odm", UsageError, "no topic '/odm' in the log; did you mean '/odom'?"),
        ("/scan", UsageError, "topic '/scan' of type sensor_msgs/msg/LaserScan states no poses"),
        ("tf:world", UsageError, "tf:world: no transform joins 'world' and 'base_link'; frames in the log: "),
        ("tf:base_link", InputError, "never moves in 'base_link'"),
    ],
)
def test_what_states_no_poses_is_refused_by_name(where: str, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind) as caught:
        RecordedPoses(where, open_recording(OFFICE).survey, "base_link")
    assert message in str(caught.value)


def test_a_log_that_is_not_there() -> None:
    with pytest.raises(UsageError, match="no such file; LOG:TOPIC"):
        read_trajectory("nowhere.mcap:/odom")


def test_a_log_without_a_topic_is_refused_as_text() -> None:
    with pytest.raises(InputError, match="name a topic as well, LOG:TOPIC"):
        read_trajectory(str(OFFICE))
