from __future__ import annotations

import json
import logging
import math
import struct
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.geometry import se3
from mclcli.io.tables.scan_file import format_scan, parse_scan, read_scan
from mclcli.records import LaserScan

if TYPE_CHECKING:
    from pathlib import Path

# As `ros2 topic echo --once /scan` prints it.
ECHO = """header:
  stamp:
    sec: 1700000000
    nanosec: 5
  frame_id: /laser
angle_min: -0.10000000149011612
angle_max: 0.10000000149011612
angle_increment: 0.10000000149011612
time_increment: 0.0
scan_time: 0.0
range_min: 0.05000000074505806
range_max: 12.0
ranges:
- 1.5
- .inf
- .nan
intensities: []
---
"""


def _parse(text: str) -> LaserScan:
    return parse_scan(text.encode(), "s.yaml")[0]


def _refused(text: str) -> str:
    with pytest.raises(InputError) as caught:
        _parse(text)
    assert str(caught.value).startswith("s.yaml: ")
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_ros2_topic_echo_prints(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "mclcli"):
        scan, mount, base_frame = parse_scan(ECHO.encode(), "s.yaml")
    assert scan.stamp_ns == 1_700_000_000_000_000_005
    assert scan.frame_id == "laser"
    assert (scan.angle_min, scan.angle_increment) == (-0.10000000149011612, 0.10000000149011612)
    assert (scan.range_min, scan.range_max) == (0.05000000074505806, 12.0)
    np.testing.assert_array_equal(scan.ranges, [1.5, math.inf, math.nan])
    assert not scan.ranges.flags.writeable
    assert (mount, base_frame) == (None, None)
    assert caplog.text == ""


def test_the_lidars_mount_comes_along(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(ECHO.replace("---\n", "mcl: {base_frame: base, base_from_sensor: [1, 2, 3, 0.1, 0.2, 5e-1]}\n"))
    _, mount, base_frame = read_scan(path)
    assert base_frame == "base"
    assert mount is not None
    np.testing.assert_array_equal(mount, se3.from_rpy([1.0, 2.0, 3.0], 0.1, 0.2, 0.5))


def test_as_ros1_prints_it() -> None:
    text = ECHO.replace("    sec:", "    secs:").replace("nanosec:", "nsecs:")
    text = text.replace("ranges:\n- 1.5\n- .inf\n- .nan\n", "ranges: [1.5, inf, nan]\n")
    scan = _parse(text)
    assert scan.stamp_ns == 1_700_000_000_000_000_005
    np.testing.assert_array_equal(scan.ranges, [1.5, math.inf, math.nan])


def test_json_with_infinities() -> None:
    message = {
        "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "l"},
        "angle_min": 0, "angle_increment": 1, "range_min": 0, "range_max": math.inf,
        "ranges": [1, math.nan, -math.inf], "extra": {"a": None},
        "mcl": {"base_frame": "b", "base_from_sensor": [0, 0, 0, 0, 0, 0]},
    }  # fmt: skip
    scan, mount, base_frame = parse_scan(f"  {json.dumps(message)}".encode(), "s.json")
    assert (scan.stamp_ns, scan.frame_id, scan.range_max, base_frame) == (1_000_000_002, "l", math.inf, "b")
    np.testing.assert_array_equal(scan.ranges, [1.0, math.nan, -math.inf])
    assert mount is not None
    np.testing.assert_array_equal(mount, np.eye(4))


def test_a_bare_scan_needs_only_its_geometry() -> None:
    scan = _parse("{angle_min: 0, angle_increment: 0, range_min: 0, range_max: 5, ranges: [2]}".replace("{", "# \n{"))
    assert (scan.stamp_ns, scan.frame_id, scan.ranges.tolist(), scan.angle_max) == (0, "", [2.0], 0.0)


def test_of_several_documents_the_first_is_used(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "mclcli"):
        scan = _parse(ECHO + ECHO.replace("1.5", "2.5") + "header:\n  sta")
    assert scan.ranges[0] == 1.5
    assert [record.getMessage() for record in caplog.records] == [
        "s.yaml: holds several documents (---); the first one is used"
    ]


@pytest.mark.parametrize(
    ("angle_max", "warned"), [(0.1, False), (0.19, False), (0.5, True), (-5.0, True), (".nan", True)]
)
def test_angle_max_is_only_compared(
    angle_max: float,
    warned: bool,  # noqa: FBT001 - a parameter
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING, "mclcli"):
        scan = _parse(ECHO.replace("angle_max: 0.10000000149011612", f"angle_max: {angle_max}"))
    assert scan.ranges.size == 3
    assert ("3 readings, but angle_max stands for" in caplog.text) is warned


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (
            "- .nan\n",
            "- .nan\n- '...'\n",
            "ranges: the array was cut short, line 13; print it with ros2 topic echo --full",
        ),
        ("- 1.5\n- .inf\n- .nan\n", " '<sequence type: float, length: 3>'\n", "cut short"),
        ("- 1.5\n- .inf\n- .nan\n", " []\n", "ranges: holds no reading, line 13"),
        ("- 1.5", "- far", "ranges.0: 'far' is not a number, line 13"),
        ("- 1.5", "- true", "ranges.0: 'True' is not a number"),
        ("- 1.5", "- [1]", "ranges.0: '[1]' is not a number, line 14"),
        ("ranges:", "range:", "key 'ranges' is missing"),
        ("angle_increment", "angle_step", "key 'angle_increment' is missing"),
        ("range_max", "range_top", "key 'range_max' is missing"),
        ("angle_min: -0.10000000149011612", "angle_min: .nan", "angle_min: nan is not a finite number, line 6"),
        ("angle_min: -0.10000000149011612", "angle_min: 5deg", "angle_min: '5deg' is not a number, line 6"),
        ("angle_increment: 0.10000000149011612", "angle_increment: 0", "angle_increment: 0 would put all beams"),
        ("range_max: 12.0", "range_max: 0", "range_max: 0 m is not greater than 0, line 12"),
        ("range_max: 12.0", "range_max: .nan", "range_max: nan m is not greater than 0"),
        ("time_increment: 0.0", "time_increment: .inf", "time_increment: inf is not a finite number, line 9"),
        ("nanosec: 5", "nanosec: 1000000000", "header.stamp: expected whole numbers sec and nanosec, line 2"),
        ("sec: 1700000000", "sec: 1.7", "header.stamp: expected whole numbers"),
        ("sec: 1700000000", "sec: 17000000000000", "header.stamp: expected whole numbers"),
        ("frame_id: /laser", "frame_id: 5", "header.frame_id: 5 is not text; put it in quotes, line 5"),
        ("intensities: []", "mcl: 5", "mcl: expected base_frame and base_from_sensor, line 17"),
        ("intensities: []", "mcl: {base_from_sensor: [1, 2, 3]}", "mcl.base_from_sensor: expected six numbers"),
        ("intensities: []", "mcl: {base_from_sensor: [1, 2, 3, 4, 5, .inf]}", "inf is not a finite number"),
        ("intensities: []", "angle_min: 1", "'angle_min' stands there twice, line 17"),
        ("intensities: []", "intensities: &a []", "an anchor or alias"),
        ("intensities: []", "intensities: [", "not valid YAML"),
    ],
)
def test_what_is_refused_names_key_and_line(old: str, new: str, named: str) -> None:
    assert old in ECHO
    assert named in _refused(ECHO.replace(old, new))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "empty"),
        ("5\n", "not a LaserScan"),
        ('{"angle_min": 1,}', "not valid JSON"),
        ('{"a": 1, "a": 2}', "key 'a' stands there twice"),
        ('{"a": ' + "[" * 100_000, "not valid JSON"),
        ('{"a": ' + "9" * 5000 + "}", "not valid JSON"),
        (
            '{"angle_min": 1' + "0" * 400 + ', "angle_increment": 1, "range_min": 0, "range_max": 1, "ranges": [1]}',
            "large",
        ),
        (
            '{"angle_min": null, "angle_increment": 1, "range_min": 0, "range_max": 1, "ranges": [1]}',
            "'None' is not a num",
        ),
        ("a" * ((1 << 21) + 1), "longer than 2097152 bytes"),
    ],
)
def test_other_text_is_refused(text: str, named: str) -> None:
    assert named in _refused(text)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_scan(tmp_path / "none.yaml")


# --- writing

FINITE = st.floats(allow_nan=False, allow_infinity=False)
FRAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=12).filter(lambda text: not text.startswith("/"))


@st.composite
def scans(draw: st.DrawFn) -> LaserScan:
    """Scans that a reader accepts: any readings at all, any finite geometry."""
    ranges = draw(st.lists(st.floats() | st.floats(width=32), min_size=1, max_size=12))
    return LaserScan(
        stamp_ns=draw(st.integers(0, 2**32 * 10**9)),
        frame_id=draw(FRAMES),
        angle_min=draw(FINITE),
        angle_max=draw(FINITE),
        angle_increment=draw(st.floats(1e-6, 1.0) | st.floats(-1.0, -1e-6)),
        time_increment=draw(FINITE),
        scan_time=draw(FINITE),
        range_min=draw(FINITE),
        range_max=draw(st.floats(min_value=0.0, exclude_min=True)),
        ranges=np.array(ranges),
    )


def _bits(scan: LaserScan) -> list[bytes]:
    numbers = [scan.angle_min, scan.angle_max, scan.angle_increment, scan.time_increment, scan.scan_time]
    values = [*numbers, scan.range_min, scan.range_max, *np.where(np.isnan(scan.ranges), math.nan, scan.ranges)]
    return [struct.pack("<d", value) for value in values]


@given(scan=scans(), fmt=st.sampled_from(["yaml", "json"]))
def test_scans_come_back_to_the_bit(scan: LaserScan, fmt: Literal["yaml", "json"]) -> None:
    text = format_scan(scan, fmt=fmt)
    again, mount, base_frame = parse_scan(text.encode(), "s")
    assert _bits(again) == _bits(scan)
    assert (again.stamp_ns, again.frame_id) == (scan.stamp_ns, scan.frame_id)
    assert (mount, base_frame) == (None, None)
    assert format_scan(again, fmt=fmt) == text


@given(
    position=st.tuples(*[st.floats(-10.0, 10.0)] * 3),
    angles=st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)),
    frame=FRAMES,
    fmt=st.sampled_from(["yaml", "json"]),
)
def test_mounts_come_back(
    position: tuple[float, ...], angles: tuple[float, float, float], frame: str, fmt: Literal["yaml", "json"]
) -> None:
    mount = se3.from_rpy(position, *angles)
    _, found, base_frame = parse_scan(format_scan(_parse(ECHO), mount, frame, fmt).encode(), "s")
    assert base_frame == frame
    assert found is not None
    np.testing.assert_allclose(found, mount, atol=1e-12)


def test_an_upside_down_lidar_comes_back() -> None:
    mount = se3.from_rpy([0.1, 0.0, 0.3], math.pi, 0.0, math.pi / 2)
    _, found, _ = parse_scan(format_scan(_parse(ECHO), mount).encode(), "s")
    assert found is not None
    np.testing.assert_allclose(found, mount, atol=1e-15)


def test_the_yaml_looks_like_ros2_topic_echo() -> None:
    echoed = ECHO.replace("/laser", "laser").replace("- .nan\n", "- .nan\n" + "- 2.0\n" * 6)
    text = format_scan(_parse(echoed), np.eye(4), "base_link")
    mount = "mcl:\n  base_frame: base_link\n  base_from_sensor: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
    assert text == echoed.replace("intensities: []\n---\n", mount)


def test_json_is_one_line_that_other_readers_take() -> None:
    text = format_scan(_parse(ECHO), fmt="json")
    assert text.count("\n") == 1
    assert json.loads(text)["ranges"][:2] == [1.5, math.inf]
