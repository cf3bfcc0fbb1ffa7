from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.io.tables.tum import TumWriter, _stamp, read_tum
from mclcli.io.traces.sinks import stamp_text
from mclcli.io.traces.track_csv import TrackCsv
from tests.data import shared
from tests.io.traces import point

if TYPE_CHECKING:
    from pathlib import Path


def _read(tmp_path: Path, text: str | bytes) -> tuple[list[int], list[list[float]]]:
    path = tmp_path / "t.tum"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    found = read_tum(path)
    return found.stamps_ns.tolist(), found.poses.tolist()


@pytest.mark.parametrize("kind", [TumWriter, TrackCsv])
def test_what_is_written_comes_back(tmp_path: Path, kind: type[TumWriter | TrackCsv]) -> None:
    points = [point(step) for step in range(20)]
    stream = io.StringIO()
    writer = kind(stream)
    for made in points:
        writer.write(made)
    stamps, poses = _read(tmp_path, stream.getvalue())
    assert stamps == [made.stamp_ns for made in points]
    np.testing.assert_allclose(poses, [made.estimate.pose for made in points], atol=2e-9)


def test_a_line_of_tum(tmp_path: Path) -> None:
    stream = io.StringIO()
    TumWriter(stream).write(point())
    fields = stream.getvalue().split(" ")
    assert fields[0] == "1318384871.000000001"
    assert fields[3:6] == ["0.000000000"] * 3
    assert all(len(field.strip().split(".")[1]) == 9 for field in fields)
    assert len(fields) == 8
    assert _read(tmp_path, stream.getvalue())[0] == [1_318_384_871_000_000_001]


@given(st.integers(-(2**63) + 1, 2**63 - 1))
def test_stamps_survive_to_the_nanosecond(stamp_ns: int) -> None:
    assert _stamp(stamp_text(stamp_ns)) == stamp_ns


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("1", 10**9),
        ("1.", 10**9),
        (".5", 5 * 10**8),
        ("1.318384871123456789e+09", 1318384871123456789),
        ("-2.5", -25 * 10**8),
    ],
)
def test_stamps_in_other_spellings(text: str, stamp_ns: int) -> None:
    assert _stamp(text) == stamp_ns


def test_comments_marks_and_line_ends_of_other_systems(tmp_path: Path) -> None:
    text = b"\xef\xbb\xbf# t x y\r\n\r\n1.5 1 2 9 0 0 1e0 0\r\n  # more\r\n2.5\t1 2 9 0 0 0 1.005\r\n"
    stamps, poses = _read(tmp_path, text)
    assert stamps == [1_500_000_000, 2_500_000_000]
    assert poses == [[1.0, 2.0, pytest.approx(np.pi)], [1.0, 2.0, 0.0]]


def test_yaw_of_a_tilted_pose_is_its_heading(tmp_path: Path) -> None:
    # Rz(0.3)·Ry(0.4): the nose still points along 0.3 when seen from above.
    qz, qw, qy = np.sin(0.15), np.cos(0.15), np.sin(0.2)
    w = np.cos(0.2)
    _, poses = _read(tmp_path, f"1 0 0 0 {-qz * qy} {qw * qy} {qz * w} {qw * w}\n")
    assert poses[0][2] == pytest.approx(0.3)


def test_csv_goes_by_names(tmp_path: Path) -> None:
    text = "# {}\nyaw,stamp,note,x,y\n7.0,1.000000001,a,1,2\n-1,2,,3,4\n"
    stamps, poses = _read(tmp_path, text)
    assert stamps == [1_000_000_001, 2_000_000_000]
    assert poses == [[1.0, 2.0, pytest.approx(7.0 - 2 * np.pi)], [3.0, 4.0, -1.0]]


_GOOD = "1 0 0 0 0 0 0 1\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (_GOOD + "2 0 nan 0 0 0 0 1\n", "'nan' is not a finite number, line 2;"),
        (_GOOD + "2 0 1_0 0 0 0 0 1\n", "'1_0' is not a finite number, line 2;"),
        (_GOOD + "2 1e999 0 0 0 0 0 1\n", "'1e999' is not a finite number, line 2;"),
        (_GOOD + "2 0 0 0 0 0 0\n", "7 fields instead of 8, line 2;"),
        (_GOOD + "2 0 0 0 0 0 0 0\n", "quaternion of length 0 instead of 1, line 2;"),
        (_GOOD + "two 0 0 0 0 0 0 1\n", "'two' is not a stamp in seconds, line 2;"),
        (_GOOD + "2 0 0 0 0 0 0 1e-4\n", "quaternion of length 0.0001 instead of 1, line 2;"),
        (_GOOD + "2 0 0 0 0 0 0 1e200\n", "quaternion of length inf instead of 1, line 2;"),
        ("1e30 0 0 0 0 0 0 1\n", "stamp '1e30' is out of range; seconds are expected, not nanoseconds, line 1;"),
        ("1403636579763555584 0 0 0 0 0 0 1\n", "is out of range; seconds are expected, not nanoseconds, line 1;"),
        (
            "1 0 0 0 0 1 0 0 0 0 1 0\n",
            "is a KITTI file (12 numbers a row: a 3 × 4 matrix, no stamp); convert it, with its",
        ),
        ("0 1 0 0 0 0 1 0 0 0 0 1 0\n", "is a KITTI file (13 numbers"),
        ("1 0 0 0 0 1 0 0 0 0 1 x\n", "12 fields instead of 8"),
        (_GOOD + "1 0 0 0 0 1 0 0 0 0 1 0\n", "12 fields instead of 8, line 2"),
        (
            "#timestamp, p_RS_R_x [m]\n1403636580838555648,4.6,-1.7,0.8,0.5,-0.1,-0.8,-0.1,0,0,0,0,0,0,0,0,0\n",
            "is a EuRoC file (stamps in ns, quaternions with w first); convert it by evo_traj euroc ",
        ),
        ("1403636580838555648, 4.6, -1.7, 0.8, 0.5, -0.1, -0.8, -0.1\n", "is a EuRoC file"),
        ("1.5, 4.6, -1.7, 0.8, 0.5, -0.1, -0.8, -0.1\n", "has numbers between commas and no header; expected"),
        ("stamp,x,y\n1,2,3\n", "no column yaw in the header, line 1;"),
        ("stamp,x,y,yaw\n1,2,3\n", "3 fields instead of 4, line 2;"),
        ("", "holds no pose;"),
        ("# only\n", "holds no pose;"),
        ("\x1b[31m 0 0 0 0 0 0 1\n", r"'\x1b[31m' is not a stamp"),
        (b"\x89MCAP0\r\n\xff\xfe\x00", "is not text; of a log name a topic"),
    ],
)
def test_errors_name_the_line(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(InputError) as caught:
        _read(tmp_path, text)
    told = str(caught.value)
    assert message in told
    assert told.startswith(str(tmp_path / "t.tum"))
    assert told.isprintable()


def test_a_missing_file_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_tum(tmp_path / "none.tum")
    with pytest.raises(InputError, match="cannot read"):
        read_tum(tmp_path)


def test_a_real_reference_reads() -> None:
    found = read_tum(shared("intel/truth.tum"))
    assert found.poses.shape == (910, 3)
    assert np.all(np.diff(found.stamps_ns) > 0)
    assert not found.poses.flags.writeable


def test_a_later_segment_overrules_what_it_covers(tmp_path: Path) -> None:
    poses = ("1,0,0,0,1,0", "2,0,0,0,1,0", "3,0,0,0,0,0", "1.5,9,0,0,1,1", "4,9,0,0,0,1")
    rows = ["stamp,x,y,yaw,updated,segment", *poses]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(rows))
    found = read_tum(path)
    assert found.stamps_ns.tolist() == [1_000_000_000, 1_500_000_000, 4_000_000_000]
    assert found.poses[:, 0].tolist() == [0.0, 9.0, 9.0]
    assert found.updated is not None
    assert found.updated.tolist() == [True, True, False]
    path.write_text("\n".join([*rows[:4], "1.5,9,0,0,1,0"]))
    assert read_tum(path).poses[:, 0].tolist() == [0.0, 9.0, 0.0, 0.0]
    with pytest.raises(InputError, match="rows are not in order of time, first on line 5"):
        read_tum(path, strict=True)


# --- as benchmarks publish them

_ROWS = [f"{10 + 0.1 * i:.4f} {i} {-i} 0 0 0 {np.sin(0.05 * i):.9f} {np.cos(0.05 * i):.9f}" for i in range(12)]


def _longer(row: str, factor: float) -> str:
    fields = row.split()
    return " ".join([*fields[:4], *(f"{factor * float(field):.9f}" for field in fields[4:])])


VARIANTS = {
    "a row twice": (
        [*_ROWS[:5], _ROWS[4], *_ROWS[5:]],
        "have the stamp of an earlier one: 1, first on line 6; the first",
    ),
    "a stamp twice": (
        [*_ROWS[:5], _ROWS[4].replace("4 -4", "4.5 -4.5"), *_ROWS[5:]],
        "have the stamp of an earlier one: 1, first on line 6; the first of each is used",
    ),
    "a stamp three times": (
        [*_ROWS[:5], _ROWS[4], _ROWS[4], *_ROWS[5:]],
        "have the stamp of an earlier one: 2, first on line 6",
    ),
    "two rows swapped": (
        [*_ROWS[:5], _ROWS[6], _ROWS[5], *_ROWS[7:]],
        "are not in order of time: 1, first on line 7; sor",
    ),
    "reversed": (_ROWS[::-1], "are not in order of time: 11, first on line 2; sorted"),
    "two pieces, the later first": (_ROWS[6:] + _ROWS[:6], "are not in order of time: 6, first on line 7; sorted"),
    "quaternions of length 2": (
        [_longer(row, 2.0) for row in _ROWS],
        "have a quaternion of another length than 1: 12, first on line 1; normalised",
    ),
    "one short quaternion": (
        [*_ROWS[:5], _longer(_ROWS[5], 0.5), *_ROWS[6:]],
        "have a quaternion of another length than 1: 1, first on line 6; normalised",
    ),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_references_as_published_are_the_clean_one(tmp_path: Path, name: str, caplog: pytest.LogCaptureFixture) -> None:
    clean = _read(tmp_path, "\n".join(_ROWS))
    assert not caplog.records
    rows, told = VARIANTS[name]
    stamps, poses = _read(tmp_path, "\n".join(rows))
    assert stamps == clean[0]
    np.testing.assert_allclose(poses, clean[1], atol=1e-8)
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert f"{tmp_path / 't.tum'}: rows that {told}" in record.getMessage()
    with pytest.raises(InputError, match=r"t\.tum: rows (are|have) .*, first on line \d+ \(\d+ in all\); "):
        read_tum(tmp_path / "t.tum", strict=True)


def test_a_csv_is_set_right_too(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stamps, poses = _read(tmp_path, "stamp,x,y,yaw\n1,1,0,0\n3,3,0,0\n2,2,0,0\n3,9,0,0\n")
    assert stamps == [10**9, 2 * 10**9, 3 * 10**9]
    assert [x for x, _, _ in poses] == [1.0, 2.0, 3.0]
    assert len(caplog.records) == 2


def test_what_is_clean_is_not_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.tum"
    path.write_text("\n".join(_ROWS))
    assert read_tum(path, strict=True).stamps_ns.size == len(_ROWS)
