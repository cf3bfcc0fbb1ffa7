"""From a log with two cameras that see tags to the track of the robot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from mcap.writer import Writer
from scipy.spatial.transform import Rotation

import mclcli as mcl
from mclcli.geometry import se2
from mclcli.io.recording.recording import open_recording
from mclcli.io.recording.roles import RequestedRoles
from mclcli.records import LandmarkSightings
from mclcli.sensors.bearing import observe
from mclcli.world.landmarks import Landmarks
from tests.io.vision_samples import INFO, TAGS, header, info, raw, tags
from tests.reference.camera import project

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from mclcli.arrays import FloatArray
    from mclcli.io.logs.base import RawMessage

SECONDS, RADIUS, RATE = 30.0, 3.0, 0.25  # one turn and a bit on a circle, 0.75 m/s
FOCAL, CENTRE = (420.0, 415.0), (322.0, 238.0)
LENS = (-0.28, 0.09, 0.0008, -0.0006, -0.012)
FLAT = (400.0, 400.0), (320.0, 240.0)
START = np.array([RADIUS, 0.0, math.pi / 2])


class Mounted(NamedTuple):
    """A camera: topics, whether its images are rectified, and its place and attitude (roll, pitch, yaw) on the base."""

    tags: str
    info: str
    rectified: bool
    place: tuple[float, float, float]
    attitude: tuple[float, float, float]

    @property
    def frame(self) -> str:
        return self.info.split("/")[1]

    @property
    def rotation(self) -> FloatArray:
        """``base_from_optical``: the body's attitude, then x right, y down, z forward."""
        roll, pitch, yaw = self.attitude
        body = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        return np.asarray((body * Rotation.from_euler("ZYX", [-math.pi / 2, 0, -math.pi / 2])).as_matrix())


CAMERAS = (
    Mounted("/front/detections", "/front/camera_info", False, (0.2, 0.05, 0.6), (0.15, -0.25, 0.3)),
    Mounted("/rear/image_rect/tags", "/rear/camera_info", True, (-0.2, 0.0, 0.9), (-0.1, 0.1, 2.6)),
)
POSTS = {n: (7 * math.cos(0.26 * n), 7 * math.sin(0.26 * n), 0.5 + 0.3 * (n % 5)) for n in range(24)}
LANDMARKS = Landmarks(tuple(map(str, POSTS)), np.array(list(POSTS.values())))


def truth(seconds: float) -> FloatArray:
    return se2.compose([0, 0, RATE * seconds], START)


def odometry(seconds: float) -> FloatArray:
    """A circle as well, but one with 4 % too long a way and 5 % too little of a turn."""
    return se2.exp([1.04 * RADIUS * RATE * seconds, 0.0, 0.95 * RATE * seconds])


def pixels(camera: Mounted, seconds: float, noise: np.random.Generator) -> Iterator[tuple[int, float, float]]:
    """Tags in view; one in twelve is taken for another."""
    x, y, yaw = truth(seconds)
    body = Rotation.from_euler("z", yaw).as_matrix()
    eye = body @ camera.place + [x, y, 0.0]
    for number, post in POSTS.items():
        ray = (body @ camera.rotation).T @ (np.array(post) - eye)
        if ray[2] > 0.3 and abs(ray[0] / ray[2]) < 0.7 and abs(ray[1] / ray[2]) < 0.5:
            lens = ("", (), *FLAT) if camera.rectified else ("plumb_bob", LENS, FOCAL, CENTRE)
            u, v = np.array(project(ray.tolist(), *lens)) + noise.normal(0.0, 0.5, 2)
            yield (number + 5 if noise.random() < 1 / 12 else number), float(u), float(v)


def at(seconds: float, frame: str) -> dict[str, Any]:
    stamp = round((100.0 + seconds) * 1e9)
    return header(frame, stamp // 10**9, stamp % 10**9)


def log_ns(seconds: float) -> int:
    return round((100.0 + seconds) * 1e9)


def odometry_message(seconds: float) -> RawMessage:
    x, y, yaw = odometry(seconds)
    turn = {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    values = {
        "header": at(seconds, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": {"position": {"x": float(x), "y": float(y)}, "orientation": turn}},
    }
    return raw("tags", "nav_msgs/msg/Odometry", values, topic="/odom", log_ns=log_ns(seconds))


def mounts() -> RawMessage:
    edges = []
    for camera in CAMERAS:
        turn = dict(zip("xyzw", map(float, Rotation.from_matrix(camera.rotation).as_quat()), strict=True))
        placed = {"translation": dict(zip("xyz", camera.place, strict=True)), "rotation": turn}
        edges.append({"header": at(0, "base_link"), "child_frame_id": camera.frame, "transform": placed})
    return raw("tags", "tf2_msgs/msg/TFMessage", {"transforms": edges}, topic="/tf_static", log_ns=log_ns(0))


def camera_info(camera: Mounted) -> RawMessage:
    (fx, fy), (cx, cy) = FOCAL, CENTRE
    (gx, gy), (dx, dy) = FLAT
    values = {
        "header": at(0, camera.frame),
        "d": LENS,
        "k": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
        "p": [gx, 0, dx, 0, 0, gy, dy, 0, 0, 0, 1, 0],
    }
    return raw("tags", INFO, info("tags", **values), topic=camera.info, log_ns=log_ns(0))


def messages() -> list[RawMessage]:
    noise = np.random.default_rng(3)
    result = [mounts(), *map(camera_info, CAMERAS)]
    for tick in range(round(SECONDS * 10)):
        seconds = tick / 10
        result.append(odometry_message(seconds))
        if tick % 3 == 0:
            for camera in CAMERAS:
                seen = tags(*pixels(camera, seconds, noise)) | {"header": at(seconds, camera.frame)}
                result.append(raw("tags", TAGS, seen, topic=camera.tags, log_ns=log_ns(seconds) + 40_000_000))
    return sorted(result, key=lambda message: message.log_time_ns)


def write(path: Path, log: list[RawMessage]) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for message in log:
            channel = message.channel
            if channel.topic not in channels:
                schema = writer.register_schema(channel.type, "ros2msg", channel.definition.encode())
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", schema)
            writer.add_message(channels[channel.topic], message.log_time_ns, message.data, message.log_time_ns)
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("vision") / "tags.mcap"
    write(path, messages())
    return path


def test_the_log_tells_both_cameras(log: Path) -> None:
    roles = open_recording(log).roles()
    assert roles.vision == tuple(camera.tags for camera in CAMERAS)
    assert "K and D of /front/camera_info" in roles.reasons["vision"]
    assert "P of /rear/camera_info" in roles.reasons["vision"]


@pytest.mark.parametrize("camera", CAMERAS, ids=["raw", "rectified"])
def test_at_the_true_pose_bearings_are_right_to_a_pixel(log: Path, camera: Mounted) -> None:
    recording = open_recording(log)
    mount = recording.survey.frames.lookup("base_link", camera.frame, 0)
    assert mount is not None
    errors: list[float] = []
    for _, seen in recording.events([camera.tags]):
        assert isinstance(seen, LandmarkSightings)
        bearings = observe(seen, mount, LANDMARKS)
        x, y, yaw = se2.compose(truth(seen.stamp_ns / 1e9 - 100.0), [*bearings.origin, 0.0])
        expected = np.arctan2(bearings.landmarks[:, 1] - y, bearings.landmarks[:, 0] - x) - yaw
        errors += np.abs(se2.wrap(bearings.angles - expected)).tolist()
    good = [error for error in errors if error < 0.006]
    assert len(errors) > 300
    assert 0.9 < len(good) / len(errors) < 0.98  # the others were taken for another tag
    assert 0.0005 < float(np.median(good)) < 0.0015  # half a pixel of noise at 400 px to the radian


@pytest.mark.parametrize("cameras", [CAMERAS, CAMERAS[:1], CAMERAS[1:]], ids=["both", "raw", "rectified"])
def test_tags_alone_keep_the_robot_on_its_track(log: Path, cameras: tuple[Mounted, ...]) -> None:
    recording = open_recording(log)
    roles = recording.roles(RequestedRoles(vision=tuple(camera.tags for camera in cameras)))
    setup = mcl.prepare(
        recording.survey,
        roles,
        landmarks=LANDMARKS,
        settings=mcl.settings({"sigma_bearing": 0.03}),
        start=mcl.AroundPose(START, np.diag(np.square([0.2, 0.2, 0.1]))),
    )
    tally = mcl.ReplayTally()
    points = list(mcl.replay(recording.events(setup.topics), setup, tally))
    assert tally.updates > 40
    assert not recording.tally.lossy
    ids = [name for p in points if p.step for name in p.step.sensors]
    assert set(ids) == set(tally.scored)
    assert 0 < tally.unknown.total() < 0.1 * tally.scored.total()  # tags taken for one beyond the last post
    errors = [se2.between(truth(p.stamp_ns / 1e9 - 100.0), p.estimate.pose) for p in points]
    distances = [math.hypot(*error[:2]) for error in errors]
    assert max(distances) < 0.6  # while it converges
    assert float(np.mean(distances[len(distances) // 2 :])) < 0.20
    assert max(abs(error[2]) for error in errors[len(errors) // 2 :]) < 0.06
    drift = se2.between(truth(SECONDS), se2.compose(START, odometry(SECONDS)))
    assert math.hypot(*drift[:2]) > 0.8


def test_a_camera_without_calibration_leaves_the_other_one_working(tmp_path: Path) -> None:
    path = tmp_path / "blind.mcap"
    write(path, [message for message in messages() if message.channel.topic != CAMERAS[0].info])
    recording = open_recording(path)
    front, rear = (camera.tags for camera in CAMERAS)
    assert recording.roles().vision == (rear, front)
    records = [topic for topic, _ in recording.events([front, rear])]
    assert set(records) == {rear}
    assert len(records) == round(SECONDS * 10) // 3
    reason = "no sensor_msgs/CameraInfo on /front/camera_info, nor of its frame"
    assert recording.tally.skipped == {front: {reason: len(records)}}
