"""Messages of cameras and detectors, version by version."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.logs.base import RawMessage, Tally
from mclcli.io.messages.decoding import DECODABLE, Undecodable, decode
from mclcli.io.recording.kinds import SIGHTINGS
from mclcli.records import CameraModel, LandmarkSightings, PixelSightings
from tests.io.logs import seeded
from tests.io.vision_samples import (
    ARUCO,
    BOXES,
    BOXES_3D,
    INFO,
    MARKERS,
    TAGS,
    box_2d,
    box_3d,
    header,
    hypothesis,
    info,
    raw,
    tags,
)

if TYPE_CHECKING:
    from typing import Any

VISIONS = pytest.mark.parametrize("version", ["vision 4", "vision 3", "vision 2", "vision 0"])
ALL_TAGS = pytest.mark.parametrize("version", ["tags", "tags, arrays", "tags, ROS 1"])


def marker(number: int, *place: float) -> dict[str, Any]:
    return {"marker_id": number, "pose": {"position": dict(zip("xyz", place, strict=True))}}


@ALL_TAGS
def test_apriltags_are_seen_at_their_centres(version: str) -> None:
    seen = decode(raw(version, TAGS, tags((7, 12.5, 100.25), (585, 0.0, 0.0), version=version)))
    assert isinstance(seen, PixelSightings)
    assert (seen.stamp_ns, seen.frame_id, seen.ids) == (5 * 10**9 + 7, "optical", ("7", "585"))
    np.testing.assert_array_equal(seen.pixels, [[12.5, 100.25], [0.0, 0.0]])
    assert not seen.pixels.flags.writeable


def test_a_tag_without_a_place_is_left_out() -> None:
    tally = Tally()
    seen = decode(raw("tags", TAGS, tags((7, math.nan, 1.0), (8, 2.0, 3.0), (9, 1.0, math.inf))), tally)
    assert isinstance(seen, PixelSightings)
    assert seen.ids == ("8",)
    assert tally.notes == {"/t": {"sighting left out: no direction": 2}}


def test_an_image_without_tags_is_a_sighting_of_nothing() -> None:
    seen = decode(raw("tags", TAGS, tags()))
    assert isinstance(seen, PixelSightings)
    assert (seen.ids, seen.pixels.shape) == ((), (0, 2))


@VISIONS
def test_boxes_are_seen_at_their_middle_and_named_by_the_likeliest_hypothesis(version: str) -> None:
    likely = [hypothesis(version, "31", 0.2), hypothesis(version, "32", 0.7), hypothesis(version, "33", math.nan)]
    boxes = [
        {"results": likely, "bbox": box_2d(version, 320.5, 17.0)},
        {"header": header(), "results": [hypothesis(version, "4", 0.0)], "bbox": box_2d(version, 1.0, 2.0)},
        {"bbox": box_2d(version, 5.0, 5.0)},
        {"header": header("elsewhere"), "results": likely, "bbox": box_2d(version, 5.0, 5.0)},
    ]
    tally = Tally()
    seen = decode(raw(version, BOXES, {"header": header(), "detections": boxes}), tally)
    assert isinstance(seen, PixelSightings)
    assert (seen.frame_id, seen.ids) == ("optical", ("32", "4"))
    np.testing.assert_array_equal(seen.pixels, [[320.5, 17.0], [1.0, 2.0]])
    assert tally.notes == {
        "/t": {
            "sighting left out: no hypothesis of what it is": 1,
            "sighting left out: of another frame than its message": 1,
        }
    }


@VISIONS
def test_boxes_in_space_are_seen_along_the_way_to_their_middle(version: str) -> None:
    boxes = [
        {"results": [hypothesis(version, "1", 0.5, (9.0, 9.0, 9.0))], "bbox": box_3d(1.0, -2.0, 3.0)},
        {"results": [hypothesis(version, "2", 0.5, (0.1, 0.2, 4.0))], "bbox": box_3d(0.0, 0.0, 0.0)},
        {"results": [hypothesis(version, "3", 0.5)], "bbox": box_3d(0.0, 0.0, 0.0)},
    ]
    tally = Tally()
    seen = decode(raw(version, BOXES_3D, {"header": header(), "detections": boxes}), tally)
    assert isinstance(seen, LandmarkSightings)
    assert seen.ids == ("1", "2")
    np.testing.assert_array_equal(seen.rays, [[1.0, -2.0, 3.0], [0.1, 0.2, 4.0]])
    assert tally.notes == {"/t": {"sighting left out: no direction": 1}}


def test_ids_may_be_words() -> None:
    boxes = [{"results": [hypothesis("vision 4", " dock door ", 0.5)], "bbox": box_2d("vision 4", 3.0, 4.0)}]
    seen = decode(raw("vision 4", BOXES, {"header": header(), "detections": boxes}))
    assert isinstance(seen, PixelSightings)
    assert seen.ids == ("dock door",)


@pytest.mark.parametrize("version", ["tags", "tags, ROS 1"])
@pytest.mark.parametrize("kind", [ARUCO, MARKERS])
def test_aruco_markers_of_aruco_opencv(version: str, kind: str) -> None:
    board = {"board_name": "wall", "pose": {"position": {"x": 1.0, "y": 1.0, "z": 1.0}}}
    values = {"header": header(), "markers": [marker(65535, 0.5, -0.25, 2.0), marker(3, 0, 0, 1)], "boards": [board]}
    seen = decode(raw(version, kind, values))
    assert isinstance(seen, LandmarkSightings)
    assert (seen.frame_id, seen.ids) == ("optical", ("65535", "3"))
    np.testing.assert_array_equal(seen.rays, [[0.5, -0.25, 2.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("version", ["tags", "tags, ROS 1"])
def test_camera_info(version: str) -> None:
    roi = {"x_offset": 40, "y_offset": 8, "width": 100, "height": 90, "do_rectify": True}
    model = decode(raw(version, INFO, info(version, binning_x=2, binning_y=0, roi=roi)))
    assert isinstance(model, CameraModel)
    assert (model.stamp_ns, model.frame_id, model.distortion_model) == (5 * 10**9 + 7, "optical", "plumb_bob")
    np.testing.assert_array_equal(model.distortion, [-0.3, 0.1, 0.001, -0.0005, 0.0])
    np.testing.assert_array_equal(model.k, [[600, 0, 320], [0, 610, 240], [0, 0, 1]])
    np.testing.assert_array_equal(model.r, np.eye(3))
    np.testing.assert_array_equal(model.p, [[550, 0, 318, -30], [0, 550, 241, 0], [0, 0, 1, 0]])
    assert (model.binning, model.offset) == ((2, 1), (40, 8))


SOME = [
    ("tags", TAGS, tags((7, 12.5, 100.25))),
    ("tags, ROS 1", TAGS, tags((7, 12.5, 100.25))),
    ("tags", ARUCO, {"header": header(), "markers": [marker(3, 0, 0, 1)]}),
    ("tags", INFO, info("tags")),
    ("tags, ROS 1", INFO, info("tags, ROS 1")),
    *(
        (version, kind, {"header": header(), "detections": [{"results": [hypothesis(version, "1", 0.5)]}]})
        for version in ("vision 4", "vision 3", "vision 2", "vision 0")
        for kind in (BOXES, BOXES_3D)
    ),
]
EACH = pytest.mark.parametrize(("version", "kind", "values"), SOME, ids=[f"{v} {k}" for v, k, _ in SOME])


@EACH
def test_bytes_missing_or_left_over_make_a_message_undecodable(version: str, kind: str, values: Any) -> None:
    message = raw(version, kind, values)
    assert not isinstance(decode(message), Undecodable)
    for data in (message.data[:-1], message.data[:-8], message.data + bytes(4), b""):
        tally = Tally(read={"/t": 1})
        assert isinstance(decode(RawMessage(message.channel, 0, data), tally), Undecodable)
        assert (tally.read, tally.lossy) == ({"/t": 0}, True)


@EACH
def test_no_bytes_raise(version: str, kind: str, values: Any) -> None:
    message = raw(version, kind, values)
    rng = seeded(f"{version} {kind}")
    outcomes = set()
    for _ in range(80):
        hurt = bytearray(message.data)
        for _ in range(rng.randrange(1, 6)):
            hurt[rng.randrange(len(hurt))] = rng.choice([0, 1, 127, 128, 255, rng.randrange(256)])
        outcomes.add(type(decode(RawMessage(message.channel, 0, bytes(hurt)), Tally())))
    assert Undecodable in outcomes


@EACH
def test_another_version_is_undecodable_by_name(version: str, kind: str, values: Any) -> None:
    message = raw(version, kind, values)
    if message.channel.encoding == "ros1":
        strange = raw(version, kind, values, digest="0123456789abcdef" * 2, definition="")
    else:
        other = message.channel.definition.replace("std_msgs/Header header", "std_msgs/Header heading", 1)
        strange = raw(version, kind, values, definition=other)
    result = decode(strange)
    assert isinstance(result, Undecodable)
    assert result.reason.startswith(f"its definition of {kind} is another version than those known")


@pytest.mark.parametrize(
    ("version", "kind", "published"),
    [
        ("vision 0", BOXES, "402071f61477de256df9f1aa45e6e4c8"),
        ("vision 0", BOXES_3D, "05c51d9aea1fb4cfdc8effb94f197b6f"),
        ("tags, ROS 1", INFO, "c9a58c1b0b154e0e6da7578cb991d214"),
    ],
)
def test_the_md5sums_that_ros1_publishes_are_known(version: str, kind: str, published: str) -> None:
    values = info(version) if kind == INFO else {"header": header()}
    message = raw(version, kind, values, digest=published, definition="")
    assert not isinstance(decode(message), Undecodable)


def test_a_fork_with_a_pose_in_every_tag_is_another_version() -> None:
    message = raw("tags", TAGS, tags((7, 1.0, 2.0)))
    text = message.channel.definition.replace("float64[9] homography", "float64[9] homography\ngeometry_msgs/Pose pose")
    assert text != message.channel.definition
    assert isinstance(decode(raw("tags", TAGS, tags((7, 1.0, 2.0)), definition=text)), Undecodable)


def test_definitions_as_recorders_write_them_are_known() -> None:
    """Types of the same package without its name, remarks, blank lines, and a header of three types."""
    rule = "=" * 80
    text = (
        "# where and what\nstd_msgs/Header header\nAprilTagDetection[]  detections\n"
        f"{rule}\nMSG: apriltag_msgs/AprilTagDetection\nstring family\nint32 id\nint32 hamming\n\nfloat32 goodness\n"
        "float32 decision_margin\nPoint centre   # [px]\nPoint[4] corners\nfloat64[9] homography\n"
        f"{rule}\nMSG: apriltag_msgs/Point\nfloat64 x\nfloat64 y\n"
        f"{rule}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        f"{rule}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    seen = decode(raw("tags", TAGS, tags((7, 1.0, 2.0)), definition=text))
    assert isinstance(seen, PixelSightings)
    assert seen.ids == ("7",)


@pytest.mark.parametrize("version", ["vision 4", "vision 3"])
def test_without_a_definition_the_newest_version_is_assumed(version: str) -> None:
    """Versions 3 and 4 have the same bytes; those of version 2 do not fit, which is told, not guessed around."""
    values = {"header": header(), "detections": [{"results": [hypothesis(version, "1", 0.5)]}]}
    assert isinstance(decode(raw(version, BOXES, values, definition="")), PixelSightings)
    old = {"header": header(), "detections": [{"header": header(), "results": [hypothesis("vision 2", "1", 0.5)]}] * 2}
    assert isinstance(decode(raw("vision 2", BOXES, old, definition="")), Undecodable)


def test_every_type_of_sightings_can_be_decoded() -> None:
    assert set(SIGHTINGS) < DECODABLE
