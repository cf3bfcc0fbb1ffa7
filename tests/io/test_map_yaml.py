from __future__ import annotations

import logging
import os
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.errors import InputError, UsageError
from mclcli.io.maps.image import Raster
from mclcli.io.maps.map_description import MapDescription
from mclcli.io.maps.map_yaml import load_map, rule, to_cells
from tests.data import shared
from tests.io.map_files import CELLS, PGM, load, write_map

if TYPE_CHECKING:
    from pathlib import Path


def test_a_small_map(tmp_path: Path) -> None:
    grid = load(tmp_path)
    assert grid.cells.tolist() == CELLS
    assert grid.resolution == 0.05
    assert grid.origin.tolist() == [-1.0, 2.0, 0.5]
    assert grid.cells.flags.c_contiguous
    assert not grid.cells.flags.writeable


# --- the rules of map_server


def _description(mode: str, negate: object, occupied: float, free: float) -> MapDescription:
    assert mode in {"trinary", "scale", "raw"}
    return MapDescription("m.pgm", 0.05, (0.0, 0.0, 0.0), bool(negate), occupied, free, mode)  # type: ignore[arg-type]


@pytest.mark.parametrize(("free", "cell"), [("0.196", -1), ("0.25", 0)])
def test_gray_205_depends_on_the_threshold(tmp_path: Path, free: str, cell: int) -> None:
    assert load(tmp_path, b"P5 1 1 255 \xcd", free_thresh=free).cells.tolist() == [[cell]]


@pytest.mark.parametrize(
    ("text", "negate"), [("0", 0), ("1", 1), ("false", 0), ("True", 1), ("yes", 1), ("No", 0), ("'1'", 1)]
)
def test_negate_is_a_number_or_a_truth(tmp_path: Path, text: str, negate: int) -> None:
    assert load(tmp_path, b"P5 2 1 255 \x00\xff", negate=text).cells.tolist() == [[0, 100] if negate else [100, 0]]


def test_modes_scale_and_raw(tmp_path: Path) -> None:
    image = b"P5 5 1 255 " + bytes([0, 64, 100, 128, 255])
    assert load(tmp_path, image, mode="scale", free_thresh="0.0", occupied_thresh="1.0").cells.tolist() == [
        [100, 75, 61, 50, 0]
    ]
    assert load(tmp_path, image, mode="raw").cells.tolist() == [[0, 64, 100, -1, -1]]


def test_equal_thresholds_are_accepted_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "mclcli"):
        grid = load(tmp_path, free_thresh="0.5", occupied_thresh="0.50")
    assert grid.cells.tolist() == [[0, 0, 100], [100, 0, 0]]
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "free_thresh equals occupied_thresh (0.5), line 6" in caplog.text


@given(
    maxval=st.sampled_from([1, 2, 100, 254, 255, 256, 1000, 65535]),
    mode=st.sampled_from(["trinary", "scale"]),
    negate=st.booleans(),
    free=st.floats(0.0, 1.0),
    occupied=st.floats(0.0, 1.0),
)
def test_the_rule_is_monotonous_and_free_wins(
    maxval: int,
    mode: str,
    negate: bool,  # noqa: FBT001 - a property's arguments
    free: float,
    occupied: float,
) -> None:
    free, occupied = min(free, occupied), max(free, occupied)
    cells = rule(_description(mode, negate, occupied, free), maxval).astype(int)
    between = (free + occupied) / 2 * 100
    steps = np.diff(np.where(cells < 0, between, cells))
    assert (steps >= 0).all() if negate else (steps <= 0).all()
    white = cells[0] if negate else cells[-1]
    assert white == 0, "p = 0 is at most any free_thresh"


@given(st.integers(1, 6), st.integers(1, 6), st.sampled_from([255, 65535, 700, 3]), st.integers(0, 2**32 - 1))
def test_the_fast_path_is_the_table(height: int, width: int, maxval: int, seed: int) -> None:
    gray = np.random.default_rng(seed).integers(0, maxval + 1, (height, width))
    samples = gray.astype(np.uint8) if maxval < 256 else gray.astype(np.uint16)
    description = _description("trinary", 0, 0.65, 0.196)
    table = rule(description, maxval)
    expected = [[int(table[value]) for value in row] for row in gray[::-1]]
    assert to_cells(Raster(samples, maxval), description).tolist() == expected


# --- the YAML


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("resolution", "0", "resolution: 0 m per cell is not more than 1e-06, line 2"),
        ("resolution", "1e-6", "line 2"),
        ("resolution", "-0.05", "line 2"),
        ("resolution", ".nan", "nan is not a finite number, line 2"),
        ("resolution", "5 cm", "5 cm is not a finite number, line 2"),
        ("resolution", "true", "not a finite number, line 2"),
        ("resolution", None, "key 'resolution' is missing"),
        ("origin", "[0, 0]", "origin: expected three numbers [x, y, yaw], line 3"),
        ("origin", "[0, 0, 0, 0]", "expected three numbers"),
        ("origin", "[0, .inf, 0]", "inf is not a finite number, line 3"),
        ("origin", "0", "expected three numbers"),
        ("negate", "2", "negate: 2 is not 0, 1, false or true, line 4"),
        ("negate", "[0]", "negate"),
        ("negate", "maybe", "maybe is not 0"),
        ("negate", "0.5", "0.5 is not 0"),
        ("occupied_thresh", "1.5", "occupied_thresh: 1.5 is not between 0 and 1, line 5"),
        ("occupied_thresh", "0.1", "free_thresh: 0.196 is above occupied_thresh 0.1"),
        ("free_thresh", "-0.1", "free_thresh: -0.1 is not between 0 and 1, line 6"),
        ("free_thresh", "~", "None is not a finite number, line 6"),
        ("mode", "trinery", "mode: 'trinery' is not trinary, scale or raw; did you mean 'trinary'?, line 7"),
        ("mode", "1", "mode: '1'"),
        ("image", '""', "image: expected the name of an image file, line 1"),
        ("image", "[m.pgm]", "image: expected the name"),
        ("image", "none.pgm", "image: no such file 'none.pgm', line 1"),
        ("image", '"a\\0b"', "line 1"),
        ("image", "x" * 5000, "line 1"),
        ("image", ".", "line 1"),
        ("image", "../m.pgm", "image: no such file '../m.pgm', line 1; put m.pgm beside the YAML"),
        ("image", "/none/of/this.pgm", "no such file '/none/of/this.pgm', line 1; put this.pgm beside the YAML"),
        ("image", r"C:\maps\n.pgm", r"no such file 'C:\maps\n.pgm', line 1; put n.pgm beside the YAML"),
        ("image", "/etc/hostname", "--allow-outside"),
    ],
)
def test_wrong_values_name_key_and_line(tmp_path: Path, key: str, value: str | None, named: str) -> None:
    folder = tmp_path / "maps"
    folder.mkdir()
    path = write_map(folder, **{key: value})
    (folder / "m.pgm").rename(folder / "other.pgm" if value == "../m.pgm" else folder / "m.pgm")
    with pytest.raises(UsageError) as caught:
        load_map(path)
    assert str(caught.value).startswith(f"{folder / 'm.yaml'}: ")
    assert key in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value"), [("resolution", "5e-2"), ("resolution", "'0.05'"), ("origin", "[-1, 2, 5e-1]")]
)
def test_numbers_as_people_write_them(tmp_path: Path, key: str, value: str) -> None:
    grid = load(tmp_path, **{key: value})
    assert (grid.resolution, grid.origin.tolist()) == (0.05, [-1.0, 2.0, 0.5])


def test_a_misspelt_key_is_shown(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"key 'free_thresh' is missing; add it \(unknown here: free_tresh\)"):
        load(tmp_path, free_thresh=None, free_tresh="0.2")


@pytest.mark.parametrize("text", ["- a\n", "word\n", "5\n"])
def test_other_yaml_is_no_map(tmp_path: Path, text: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(text)
    with pytest.raises(UsageError, match="not a map: expected keys image, resolution"):
        load_map(path)


def test_broken_yaml_and_duplicate_keys_are_input_errors(tmp_path: Path) -> None:
    path = write_map(tmp_path)
    path.write_text(path.read_text() + "negate: 1\n")
    with pytest.raises(InputError, match="'negate' stands there twice, line 7"):
        load_map(path)


def test_missing_yaml(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        load_map(tmp_path / "m.yaml")


def test_an_image_in_the_yamls_place(tmp_path: Path) -> None:
    yaml = write_map(tmp_path)
    with pytest.raises(UsageError) as caught:
        load_map(tmp_path / "m.pgm")
    assert f"is an image; a map is named by its YAML; give {yaml}" in str(caught.value)
    yaml.unlink()
    with pytest.raises(UsageError, match="is an image; a map is named by its YAML \\(image, resolution"):
        load_map(tmp_path / "m.pgm")


def test_images_outside_need_a_flag(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "m.pgm").write_bytes(PGM)
    path = write_map(tmp_path / "maps", image="../m.pgm")
    (tmp_path / "maps" / "m.pgm").unlink()
    with pytest.raises(UsageError, match="--allow-outside"):
        load_map(path)
    assert load_map(path, allow_outside=True).cells.tolist() == CELLS


@pytest.mark.parametrize(
    "image",
    ["/home/someone/maps/m.pgm", "maps/m.pgm", "../elsewhere/m.pgm", r"C:\Users\someone\m.pgm", r"..\m.pgm", "~/m.pgm"],
)
def test_an_image_of_another_machine_is_the_one_beside_the_yaml(
    tmp_path: Path, image: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert load(tmp_path, image=f"'{image}'").cells.tolist() == CELLS
    (record,) = caplog.records
    assert record.getMessage() == (
        f"{tmp_path / 'm.yaml'}: image: '{image}' does not exist, line 1; m.pgm beside the YAML is used"
    )


def test_the_image_beside_the_yaml_comes_before_one_outside(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "m.pgm").write_bytes(b"P5 1 1 255 \0")
    path = write_map(tmp_path / "maps", image="../m.pgm")
    assert load_map(path).cells.tolist() == CELLS
    assert "lies outside the YAML's folder (--allow-outside takes it), line 1; m.pgm beside" in caplog.text
    assert load_map(path, allow_outside=True).cells.tolist() == [[100]]


@pytest.mark.skipif(os.name == "nt", reason="symbolic links need rights on Windows")
def test_a_link_beside_the_yaml_does_not_lead_outside(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "secret.pgm").write_bytes(PGM)
    path = write_map(tmp_path / "maps", image="/elsewhere/m.pgm")
    (tmp_path / "maps" / "m.pgm").unlink()
    (tmp_path / "maps" / "m.pgm").symlink_to(tmp_path / "secret.pgm")
    with pytest.raises(UsageError, match="no such file"):
        load_map(path)


@pytest.mark.parametrize("mode", ["Trinary", "TRINARY", "'trinarY'", "Scale", "RAW"])
def test_modes_in_any_case(tmp_path: Path, mode: str) -> None:
    assert np.array_equal(load(tmp_path, mode=mode).cells, load(tmp_path, mode=mode.strip("'").lower()).cells)


@pytest.mark.parametrize("libyaml", [True, False])
@pytest.mark.parametrize(
    "change",
    [
        ("resolution: ", "resolution:\t"),
        ("resolution: ", "resolution: \t "),
        ("resolution: ", "resolution\t: "),
        ("0.05\n", "0.05\t\n"),
        ("0.05\n", "0.05\t# m\n"),
        ("0.05\n", "0.05\n\t\n\t# more\n"),
        ("[-1.0, 2.0, 0.5]", "\t[\t-1.0,\t2.0 ,\t0.5\t]"),
        ("[-1.0, 2.0, 0.5]", "\n-\t-1.0\n-\t2.0\n- \t0.5"),
    ],
)
def test_tabs_separate(
    tmp_path: Path,
    change: tuple[str, str],
    libyaml: bool,  # noqa: FBT001 - a parameter of the test
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whichever of PyYAML's two parsers there is."""
    if not libyaml:
        monkeypatch.setattr("yaml.__with_libyaml__", False)
    path = write_map(tmp_path)
    path.write_text(path.read_text().replace(*change))
    grid = load_map(path)
    assert (grid.cells.tolist(), grid.resolution, grid.origin.tolist()) == (CELLS, 0.05, [-1.0, 2.0, 0.5])


# --- what can hardly be meant

ROOM = b"P5 4 4 255 " + bytes([0, 0, 0, 0, 0, 254, 254, 0, 254, 254, 205, 254, 205, 205, 205, 254])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"negate": "1", "occupied_thresh": "0.5"}, "cells are occupied; check negate (1), occupied_thresh (0.5) and"),
        ({"occupied_thresh": "0.1", "free_thresh": "0.001"}, "% of its cells are occupied; check negate (0)"),
        ({"free_thresh": "0.0"}, "none of its cells is free; check negate (0), occupied_thresh (0.65) and free_"),
        ({"resolution": "5"}, "its cells are 5 m wide; check resolution (metres per cell)"),
        ({"resolution": "0.0005"}, "its cells are 0.0005 m wide; check resolution"),
        ({"origin": "[0, 0, 90]"}, "origin: yaw 90 rad looks like degrees, line 3; for 90 deg write 1.5708"),
        ({"origin": "[0, 0, -45.5]"}, "origin: yaw -45.5 rad looks like degrees"),
    ],
)
def test_a_map_that_can_hardly_be_meant_draws_one_line(
    tmp_path: Path, changes: dict[str, str], told: str, caplog: pytest.LogCaptureFixture
) -> None:
    load(tmp_path, ROOM, **changes)
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert record.getMessage().startswith(f"{tmp_path / 'm.yaml'}: ")
    assert told in record.getMessage()


def test_several_doubts_are_one_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    load(tmp_path, b"P5 2 1 255 \0\0", resolution="50")
    (record,) = caplog.records
    assert "100 % of its cells are occupied" in record.getMessage()
    assert "; its cells are 50 m wide" in record.getMessage()


@pytest.mark.parametrize(
    "changes",
    [{}, {"resolution": "1.0"}, {"resolution": "0.001"}, {"origin": "[0, 0, 6.2832]"}, {"mode": "scale"}],
)
def test_other_maps_draw_none(tmp_path: Path, changes: dict[str, str], caplog: pytest.LogCaptureFixture) -> None:
    load(tmp_path, ROOM, **changes)
    assert not caplog.records


# --- links


@pytest.mark.skipif(os.name == "nt", reason="symbolic links need rights on Windows")
def test_links_are_followed_before_the_folder_is_checked(tmp_path: Path) -> None:
    for name in ("maps", "real"):
        (tmp_path / name).mkdir()
    (tmp_path / "secret.pgm").write_bytes(PGM)
    (tmp_path / "maps" / "link.pgm").symlink_to(tmp_path / "secret.pgm")
    path = write_map(tmp_path / "maps", image="link.pgm")
    with pytest.raises(UsageError, match="outside the YAML's folder"):
        load_map(path)
    assert load_map(path, allow_outside=True).cells.tolist() == CELLS


@pytest.mark.skipif(os.name == "nt", reason="symbolic links need rights on Windows")
def test_a_map_installed_as_links_loads(tmp_path: Path) -> None:
    """As colcon build --symlink-install leaves it: YAML and image both point to the source folder."""
    for name in ("install", "source"):
        (tmp_path / name).mkdir()
    write_map(tmp_path / "source")
    for name in ("m.yaml", "m.pgm"):
        (tmp_path / "install" / name).symlink_to(tmp_path / "source" / name)
    assert load_map(tmp_path / "install" / "m.yaml").cells.tolist() == CELLS


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_no_image(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.pgm")
    path = write_map(tmp_path, image="pipe.pgm")
    with pytest.raises(UsageError, match=r"no such file 'pipe\.pgm'"):
        load_map(path)


def test_text_from_the_yaml_cannot_move_the_terminal(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        load(tmp_path, mode='"\\e[2J\\u202e"')
    assert str(caught.value).isprintable()


# --- maps of real robots


REAL = {
    "intel/intel.yaml": ((625, 627), 205298, 13668, 172909),
    "olin/mac_1st_floor_9_23.yaml": ((1433, 530), 742820, 16670, 0),
    "birmingham/map_from_trace0.yaml": ((338, 412), 30195, 2947, 106114),
    "birmingham/map_from_trace1.yaml": ((288, 454), 23920, 2260, 104572),
    "birmingham/meeting.yaml": ((602, 602), 78120, 6020, 278264),
    "birmingham/meeting_world.yaml": ((622, 622), 83407, 6465, 297012),
    "maps/mit_racecar/basement_fixed.map.yaml": ((1300, 1300), 275742, 14374, 1399884),
    "maps/mrpt_navigation/demo_world2.yaml": ((200, 320), 42022, 6952, 15026),
    "maps/mrpt_navigation/yaml_0.yaml": ((66, 30), 1773, 207, 0),
    "maps/mrpt_navigation/yaml_299.yaml": ((66, 30), 1697, 283, 0),
    "maps/nav2_bringup/depot.yaml": ((307, 604), 179481, 5947, 0),
    "maps/nav2_bringup/depot_speed.yaml": ((307, 604), 123746, 3735, 0),
    "maps/nav2_bringup/tb3_sandbox.yaml": ((384, 384), 7903, 870, 138683),
    "maps/nav2_costmap_2d_test/TenByTen.yaml": ((10, 10), 78, 20, 2),
    "maps/nav2_map_server_test/testmap.yaml": ((10, 10), 71, 29, 0),
    "maps/nav2_map_server_test/invalid_image.yaml": "no such file 'invalid.png', line 1",
    "maps/nav2_system_tests/empty_room.yaml": "no such file 'empty.pgm', line 1",
    "maps/nav2_tools/100by100_10.yaml": "no such file '100by100_10.pgm', line 1",
    "maps/nav2_tools/smoothers_world.yaml": ((300, 300), 79424, 10576, 0),
    "maps/olin_ac109/ac109_3.yaml": ((480, 480), 7535, 957, 221908),
    "maps/ros1_map_server_test/testmap.yaml": ((10, 10), 71, 29, 0),
    "maps/ros1_map_server_test/testmap2.yaml": ((12, 12), 88, 56, 0),
    "maps/willow/willow-2010-02-18-0.10.yaml": ((608, 566), 109207, 544, 234377),
    "mrclam/landmarks.yaml": "not a map",
}


@pytest.mark.parametrize("name", REAL)
def test_real_maps(name: str, caplog: pytest.LogCaptureFixture) -> None:
    expected, path = REAL[name], shared(name)
    if isinstance(expected, str):
        with pytest.raises(UsageError) as caught:
            load_map(path)
        assert expected in str(caught.value)
        return
    grid = load_map(path)
    assert all("free_thresh equals" in record.getMessage() for record in caplog.records)
    counts = tuple(int(kind.sum()) for kind in (grid.free, grid.occupied, grid.unknown))
    assert (grid.cells.shape, *counts) == expected
