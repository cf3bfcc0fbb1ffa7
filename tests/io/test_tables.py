from __future__ import annotations

import io
import math
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.io.tables.csv_table import parse_table, read_poses
from mclcli.io.tables.landmarks_file import read_bearings, read_landmarks
from tests.data import shared

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.world.landmarks import Landmarks

POSE = {"x": "m", "y": "m", "yaw": "rad"}


def _file(folder: Path, text: str | bytes, name: str = "t.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def _landmarks(folder: Path, text: str | bytes) -> Landmarks:
    return read_landmarks(_file(folder, text))


def test_poses_keep_their_other_columns_as_text(tmp_path: Path) -> None:
    text = '# {"a": 1}\nid,x,note,y,yaw\n007,1,"a, ""b""",2,90deg\n\n8,-1e1,,.5, 0\n'
    poses, columns, rows = read_poses(_file(tmp_path, text))
    assert poses.tolist() == [[1.0, 2.0, math.pi / 2], [-10.0, 0.5, 0.0]]
    assert columns == ("id", "note")
    assert rows == [("007", 'a, "b"'), ("8", "")]


def test_a_byte_order_mark_and_crlf_are_no_matter(tmp_path: Path) -> None:
    poses, columns, rows = read_poses(_file(tmp_path, b"\xef\xbb\xbfx, y ,yaw\r\n1,2,3\r\n"))
    assert (poses.tolist(), columns, rows) == ([[1.0, 2.0, 3.0]], (), [()])


def test_yaw_is_wrapped_but_kept_to_the_bit_within_one_turn(tmp_path: Path) -> None:
    poses, _, _ = read_poses(_file(tmp_path, f"x,y,yaw\n0,0,{math.pi!r}\n0,0,{-math.pi!r}\n0,0,-3.1\n0,0,720deg\n"))
    assert poses[:3, 2].tolist() == [math.pi, math.pi, -3.1]
    assert poses[3, 2] == pytest.approx(0.0, abs=1e-12)


def test_poses_from_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"x,y,yaw\n1,2,3\n4,5,oops\n")))
    with pytest.raises(InputError, match=r"standard input: yaw: 'oops' is not .*line 3"):
        read_poses("-")


def test_a_header_alone_is_a_table_without_rows(tmp_path: Path) -> None:
    poses, _, rows = read_poses(_file(tmp_path, "x,y,yaw\n"))
    assert poses.shape == (0, 3)
    assert rows == []


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "empty"),
        ("\n\n", "no column 'x' in the header, which has nothing"),
        ("1,2,3\n", "no column 'x' in the header, which has 1, 2, 3"),
        ("x,y,theta\n1,2,3\n", "no column 'yaw'"),
        ("X,Y,YAW\n1,2,3\n", "no column 'x'"),
        ("x;y;yaw\n1;2;3\n", "no column 'x'"),
        ("x,y,yaw,x\n1,2,3,4\n", "column 'x' is in the header twice"),
        ("x,y,yaw,a,a\n1,2,3,4,5\n", "column 'a' is in the header twice"),
        ("x,y,yaw\n1,2\n", "2 fields where the header has 3, line 2"),
        ("x,y,yaw\n1,2,3\n\n1,2,3,\n", "4 fields where the header has 3, line 4"),
        ("x,y,yaw\n1,2,3\n# more\n", "1 fields where the header has 3, line 3"),
        ("x,y,yaw\n1,,3\n", "y: '' is not a number in m, or with a unit"),
        ("x,y,yaw\n1,nan,3\n", "y: 'nan' is not a number"),
        ("x,y,yaw\n1,2,inf\n", "yaw: 'inf' is not a number"),
        ("x,y,yaw\n1_0,2,3\n", "x: '1_0' is not a number"),
        ("x,y,yaw\n1,2,3m\n", "yaw: '3m' is not a number in rad"),
        ("x,y,yaw\n1,90deg,3\n", "y: '90deg' is not a number in m"),
        (
            'x,y,yaw,n\n1,2,3,"a\nb"\n1,2,z,"c"\n',
            "yaw: 'z' is not a number in rad, or with a unit (rad, deg, °), line 4",
        ),
        ('x,y,yaw\n1,2,"3\n', "not CSV: unexpected end of data, line 2"),
        ('x,y,yaw\n1,2,"3"4\n', "not CSV"),
        ("x,y,yaw\n1,2," + "3" * 200_000 + "\n", "not CSV: field larger than field limit (131072), line 2"),
        (b"x,y,yaw\n1,2,3\n1,2,\xff\n", "not UTF-8 text, line 3"),
        ("x,y,yaw\n1,2,\x1b[2J\u202e\n", "yaw: '\\x1b[2J\\u202e' is not"),
        ("version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
    ],
)
def test_what_is_no_table_of_poses(tmp_path: Path, text: str | bytes, named: str) -> None:
    path = _file(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_poses(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


@given(
    st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 2, st.floats(-3.14, 3.14)), max_size=20)
)
def test_numbers_in_shortest_form_come_back_to_the_bit(poses: list[tuple[float, float, float]]) -> None:
    text = "x,y,yaw\n" + "".join(f"{x!r},{y!r},{yaw!r}\n" for x, y, yaw in poses)
    table = parse_table(text.encode(), "t.csv", POSE)
    found = np.stack([table.numbers[key] for key in POSE], axis=-1)
    assert found.tobytes() == np.array(poses, dtype=np.float64).reshape(-1, 3).tobytes()
    assert table.lines.tolist() == list(range(2, len(poses) + 2))


# --- landmarks

LANDMARK_FILES = {
    "csv": "id,x,y\n1,-1,0\ndoor,1,50cm\n",
    "csv with more": "# made by hand\nname,y,id,x\na,0,1,-1\nb,0.5,door,1\n",
    "csv after a mark": "\ufeffid,x,y\n1,-1,0\ndoor,1,0.5\n",
    "yaml list": "- {id: 1, x: -1, y: 0}\n- id: door\n  x: 1\n  y: 5e-1\n  colour: [1, 2]\n",
    "yaml key": "landmarks:\n- {id: '1', x: -1.0, y: 0.0}\n- {id: door, x: 100cm, y: 0.5}\n",
    "yaml flow": '[{"id": "1", "x": -1, "y": 0}, {"id": "door", "x": 1, "y": 0.5}]\n',
}


@pytest.mark.parametrize("kind", LANDMARK_FILES)
def test_landmarks_in_every_form(tmp_path: Path, kind: str) -> None:
    landmarks = _landmarks(tmp_path, LANDMARK_FILES[kind])
    assert landmarks.ids == ("1", "door")
    assert landmarks.positions.tolist() == [[-1.0, 0.0, 0.0], [1.0, 0.5, 0.0]]


@pytest.mark.parametrize("text", ["id,x,y,z\n007,1,2,3\n", "- {id: 007, x: 1, y: 2, z: 3}\n"])
def test_heights_and_ids_with_leading_zeros(tmp_path: Path, text: str) -> None:
    landmarks = _landmarks(tmp_path, text)
    assert landmarks.ids == ("007",)
    assert landmarks.positions.tolist() == [[1.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("id,x,y,z\na,1,2,3\nb,3m,40cm,2147483648\n", "landmark 'b' is farther than 1e+09 m"),
        ("id,x,y\n1,2,3\n2,2,3\n1,4,5\n", "landmark '1' stands there twice, lines 2 and 4"),
        ("- {id: 1, x: 2, y: 3}\n- {id: '1', x: 2, y: 3}\n", "landmark '1' stands there twice, lines 1 and 2"),
        ("id,x,y\n1,2,nan\n", "y: 'nan' is not a number in m"),
        ("- {id: 1, x: 2, y: .nan}\n", "y: nan is not a finite number, line 1"),
        ("- {id: 1, x: .inf, y: 2}\n", "x: inf is not a finite number, line 1"),
        ("- {id: 1, x: true, y: 2}\n", "x: True is not a finite number"),
        ("- {id: 1, x: two, y: 2}\n", "x: 'two' is not a number in m"),
        ("- {id: 1.5, x: 1, y: 2}\n", "id '1.5' is neither text nor a whole number, line 1"),
        ("- {id: true, x: 1, y: 2}\n", "id 'True' is neither"),
        ("- {id: '', x: 1, y: 2}\n", "id '' is neither"),
        ("- {id: 1, x: 1, y: 2}\n- {x: 1, y: 2}\n", "a landmark without 'id', line 2"),
        ("- {id: 1, x: 1}\n", "a landmark without 'y', line 1"),
        ("- 1\n- 2\n", "not a mapping with id, x, y"),
        ("a: 1\n", "not a list of landmarks"),
        ("[]\n", "holds no landmark"),
        ("id,x,y\n", "holds no landmark"),
        ("id,x,y\n ,1,2\n", "the id is empty, line 2"),
        ("name,x,y\na,1,2\n", "no column 'id' in the header"),
        ("id,x\na,1\n", "no column 'y' in the header"),
        ("- &a {id: 1, x: 1, y: 2}\n- *a\n", "anchor"),
    ],
)
def test_what_is_no_list_of_landmarks(tmp_path: Path, text: str, named: str) -> None:
    path = _file(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_landmarks(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert named in str(caught.value)


def test_missing_files(tmp_path: Path) -> None:
    for read in (read_landmarks, read_bearings, read_poses):
        with pytest.raises(UsageError, match="no such file"):
            read(tmp_path / "none.csv")


def test_real_landmarks() -> None:
    landmarks = read_landmarks(shared("mrclam/landmarks.yaml"))
    assert len(landmarks.ids) == 15
    assert landmarks.positions[landmarks.lookup(["63", "25", "5"])[:2], 0].tolist() == [0.58831396, 1.24712229]
    assert landmarks.lookup(["5"]).tolist() == [-1]


# --- bearings


def test_bearings_become_level_rays(tmp_path: Path) -> None:
    sightings = read_bearings(_file(tmp_path, "id,bearing\n1,35deg\n2,-0.5\n1,180°\n"))
    assert sightings.ids == ("1", "2", "1")
    angles = np.arctan2(sightings.rays[:, 1], sightings.rays[:, 0])
    np.testing.assert_allclose(angles, [math.radians(35.0), -0.5, math.pi], rtol=0, atol=1e-15)
    assert sightings.rays[:, 2].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(np.linalg.norm(sightings.rays, axis=1), 1.0, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("id,bearing\n", "holds no bearing"),
        ("id,bearing\n1,\n", "bearing: '' is not a number in rad"),
        ("id,bearing\n1,5m\n", "bearing: '5m' is not"),
        ("id,angle\n1,5\n", "no column 'bearing'"),
        ("bearing\n1\n", "no column 'id'"),
        ("id,bearing\n1,1\n,2\n", "the id is empty, line 3"),
    ],
)
def test_what_is_no_table_of_bearings(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(InputError) as caught:
        read_bearings(_file(tmp_path, text))
    assert named in str(caught.value)
