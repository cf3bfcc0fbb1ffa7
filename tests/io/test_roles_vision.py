"""Which camera a detection belongs to, and what becomes of its pixels."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.logs.base import Tally
from mclcli.io.messages.decoding import decode
from mclcli.io.recording.cameras import Cameras, pair
from mclcli.io.recording.roles import RequestedRoles, assign
from mclcli.io.recording.survey import LogSurvey, survey_log
from mclcli.records import LandmarkSightings, PixelSightings
from tests.io.vision_samples import BOXES, INFO, TAGS, header, hypothesis, info, raw, tags

if TYPE_CHECKING:
    from typing import Any

    from mclcli.io.logs.base import RawMessage
    from mclcli.records import CameraModel


def detections(topic: str, frame: str = "optical", kind: str = TAGS) -> RawMessage:
    if kind == BOXES:
        values = {"header": header(frame), "detections": [{"results": [hypothesis("vision 4", "1", 0.5)]}]}
        return raw("vision 4", BOXES, values, topic=topic)
    return raw("tags", TAGS, tags((1, 320.0, 240.0), frame=frame), topic=topic)


def calibration(topic: str, frame: str = "optical", **changes: Any) -> RawMessage:
    return raw("tags", INFO, info("tags", header=header(frame)) | changes, topic=topic)


def markers(topic: str) -> RawMessage:
    return raw("tags", "aruco_opencv_msgs/msg/MarkerDetection", {"header": header()}, topic=topic)


def paired(survey: LogSurvey, topic: str) -> tuple[str, bool] | None:
    pairing = pair(survey, topic)
    return (pairing.info, pairing.rectified) if pairing else None


@pytest.mark.parametrize("kind", [TAGS, BOXES])
def test_the_camera_of_the_same_frame_wins_whatever_its_name(kind: str) -> None:
    survey = survey_log(
        [
            detections("/apriltag/detections", "front", kind),
            calibration("/apriltag/camera_info", "rear"),
            calibration("/driver/left/camera_info", "/front"),
        ]
    )
    assert paired(survey, "/apriltag/detections") == ("/driver/left/camera_info", False)


def test_of_several_with_the_same_frame_the_nearest_in_name_wins() -> None:
    infos = ["/a/camera_info", "/robot/cam/camera_info", "/robot/cam/depth_info", "/robot/camera_info"]
    for order in (infos, infos[::-1]):
        survey = survey_log([detections("/robot/cam/tags"), *map(calibration, order)])
        assert paired(survey, "/robot/cam/tags") == ("/robot/cam/camera_info", False)


@pytest.mark.parametrize(
    ("info_topic", "is_near"),
    [
        ("/robot/cam/camera_info", True),
        ("/robot/camera_info", True),
        ("/camera_info", True),
        ("/robot/other/camera_info", False),
        ("/robot/cam/inner/camera_info", False),
        ("/rob/camera_info", False),
    ],
)
def test_another_frame_serves_in_the_same_namespace_or_above(info_topic: str, is_near: bool) -> None:  # noqa: FBT001
    survey = survey_log([detections("/robot/cam/tags", "here"), calibration(info_topic, "there")])
    assert paired(survey, "/robot/cam/tags") == ((info_topic, False) if is_near else None)


@pytest.mark.parametrize(
    ("topic", "info_topic", "rectified"),
    [
        ("/cam/detections", "/cam/camera_info", False),
        ("/cam/image_rect/detections", "/cam/camera_info", True),
        ("/cam/image_rect_color/tags", "/cam/camera_info", True),
        ("/cam/detections_rect", "/cam/camera_info", True),
        ("/cam/detections", "/cam_rect/camera_info", True),
        ("/cam/rectified/detections", "/cam/camera_info", True),
        ("/cam/rectangles", "/cam/camera_info", False),
        ("/direct/detections", "/direct/camera_info", False),
        ("/correct_cam/detections", "/correct_cam/camera_info", False),
    ],
)
def test_a_name_says_whether_images_are_rectified(topic: str, info_topic: str, rectified: bool) -> None:  # noqa: FBT001
    survey = survey_log([detections(topic), calibration(info_topic)])
    assert paired(survey, topic) == (info_topic, rectified)
    reason = assign(survey).reasons["vision"]
    assert topic in reason
    assert (f"P of {info_topic}" if rectified else f"K and D of {info_topic}") in reason


def test_two_cameras_and_one_without_calibration_which_comes_last() -> None:
    survey = survey_log(
        [
            detections("/a/blind", "nowhere"),
            detections("/b/tags", "left"),
            markers("/c/markers"),
            detections("/d/tags", "right"),
            calibration("/b/camera_info", "left"),
            calibration("/d/camera_info", "right"),
        ]
    )
    roles = assign(survey)
    assert roles.vision == ("/b/tags", "/c/markers", "/d/tags", "/a/blind")
    assert "/a/blind: no sensor_msgs/CameraInfo on /a/camera_info" in roles.reasons["vision"]
    assert "/markers" not in roles.reasons["vision"]
    assert assign(survey, RequestedRoles(vision=("/d/tags",))).vision == ("/d/tags",)


def seen_by(cameras: Cameras, topic: str, message: RawMessage) -> object | None:
    record = decode(message)
    return cameras.see(topic, record)


def test_pixels_become_rays_and_all_else_passes() -> None:
    messages = [detections("/cam/tags"), calibration("/cam/camera_info", d=[0.0] * 5)]
    cameras = Cameras(survey_log(messages), ["/cam/tags", "/scan"], Tally())
    assert cameras.topics == {"/cam/camera_info"}
    seen = seen_by(cameras, "/cam/tags", raw("tags", TAGS, tags((4, 320.0, 240.0), (5, 920.0, -370.0))))
    assert isinstance(seen, LandmarkSightings)
    assert (seen.stamp_ns, seen.frame_id, seen.ids) == (5 * 10**9 + 7, "optical", ("4", "5"))
    np.testing.assert_allclose(seen.rays, [[0, 0, 1], [1, -1, 1]], rtol=0, atol=1e-12)
    assert not seen.rays.flags.writeable
    other = object()
    assert cameras.see("/scan", other) is other


def test_only_the_calibrations_of_wanted_topics_are_read() -> None:
    messages = [detections("/a/tags", "left"), calibration("/a/camera_info", "left"), markers("/c/markers")]
    assert Cameras(survey_log(messages), ["/c/markers"], Tally()).topics == frozenset()


def test_the_latest_calibration_before_an_image_counts_else_the_first() -> None:
    def of(sec: int, focal: float) -> RawMessage:
        k = [focal, 0, 0, 0, focal, 0, 0, 0, 1]
        return raw("tags", INFO, info("tags", header=header(sec=sec), d=[0.0], k=k), topic="/cam/camera_info")

    def slope(sec: int) -> float:
        seen = seen_by(cameras, "/cam/tags", raw("tags", TAGS, tags((1, 100.0, 0.0), sec=sec)))
        assert isinstance(seen, LandmarkSightings)
        return float(seen.rays[0, 0])

    infos = [of(10, 100.0), of(11, 100.0), of(20, 200.0), of(30, 400.0)]
    cameras = Cameras(survey_log([detections("/cam/tags"), *infos]), ["/cam/tags"], Tally())
    assert slope(5) == 1.0
    for message in infos:
        model: CameraModel = decode(message)  # type: ignore[assignment]
        assert cameras.see("/cam/camera_info", model) is model
    assert [slope(sec) for sec in (5, 10, 19, 20, 29, 30, 99)] == [1.0, 1.0, 1.0, 0.5, 0.5, 0.25, 0.25]


@pytest.mark.parametrize(
    ("messages", "reason"),
    [
        ([], "no sensor_msgs/CameraInfo on /cam/camera_info, nor of its frame"),
        ([calibration("/cam/camera_info", k=[0.0] * 9)], "/cam/camera_info: not calibrated: K has no focal length"),
        (
            [calibration("/cam/camera_info", distortion_model="ds")],
            "/cam/camera_info: distortion model 'ds' is not known",
        ),
    ],
)
def test_what_has_no_rays_is_counted_and_told_once(
    messages: list[RawMessage], reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    tally = Tally(read={"/cam/tags": 3})
    cameras = Cameras(survey_log([detections("/cam/tags"), *messages]), ["/cam/tags"], tally)
    with caplog.at_level(logging.WARNING, logger="mclcli"):
        assert [seen_by(cameras, "/cam/tags", detections("/cam/tags")) for _ in range(2)] == [None, None]
    assert tally.skipped == {"/cam/tags": {reason: 2}}
    assert (tally.read, tally.lossy) == ({"/cam/tags": 1}, True)
    assert caplog.messages == [f"/cam/tags: messages cannot be used: {reason}"]


def test_a_pixel_beyond_the_lens_is_left_out_alone() -> None:
    tally = Tally()
    folded = calibration("/cam/camera_info", d=[-0.3, 0.0, 0.0, 0.0, 0.0])
    cameras = Cameras(survey_log([detections("/cam/tags"), folded]), ["/cam/tags"], tally)
    seen = seen_by(cameras, "/cam/tags", raw("tags", TAGS, tags((1, 9000.0, 240.0), (2, 320.0, 300.0))))
    assert isinstance(seen, LandmarkSightings)
    assert seen.ids == ("2",)
    assert tally.notes == {"/cam/tags": {"sighting left out: no direction": 1}}


def test_a_survey_keeps_the_pixels_and_their_frame() -> None:
    sample = survey_log([detections("/cam/tags", "/front")]).topics["/cam/tags"].sample
    assert isinstance(sample, PixelSightings)
    assert sample.frame_id == "front"
    assert math.isclose(sample.pixels[0, 0], 320.0)
