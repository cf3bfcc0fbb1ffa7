"""``mcl score``: every way to name poses, parameters, and every output."""

from __future__ import annotations

import io
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mclcli.cli.score.poses import headings, lattice_poses, positions
from tests.cli.example import LANDMARKS, MODEL, NEAR, POSES, SCAN, reference
from tests.cli.support import OFFICE, OFFICE_MAP, REFERENCE_MAP, decoded, mcl, messages, single_error
from tests.sensors.example import SET3
from tests.worlds import drawn

# Naming the poses


def test_poses_of_a_file_keep_their_other_columns(tmp_path: Path) -> None:
    text = (
        'name,x,note,yaw,y\nfirst,0.91,"a, ""b""",-65deg,-0.81\n=SUM(A1),96cm,@x,-63deg,-0.77\n,-2.21,,-100deg,0.93\n'
    )
    (tmp_path / "poses.csv").write_text(text)
    from_file = mcl("score", SCAN, "--map", REFERENCE_MAP, *MODEL, "--poses", tmp_path / "poses.csv")
    from_stdin = mcl("score", SCAN, "--map", REFERENCE_MAP, *MODEL, "--poses", "-", stdin=text.encode())
    assert from_file.code == 0
    assert from_stdin.out == from_file.out
    table = from_file.table
    assert table.names == ["name", "note", "x", "y", "yaw", "log_lidar", "log_weight", "weight"]
    assert table.texts("name") == ["first", "'=SUM(A1)", ""]
    assert table.texts("note") == ['a, "b"', "'@x", ""]
    np.testing.assert_allclose(table["log_lidar"], SET3.lidar["exact"], rtol=0, atol=1e-9)


def test_poses_named_one_by_one_come_first(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("id,x,y,yaw\n7,1,1,0\n")
    words = ("--pose", "0.5,0.25,90deg", "--poses", tmp_path / "poses.csv", "--pose", "-1,-1,4")
    table = mcl("score", SCAN, "--map", REFERENCE_MAP, *words, "--around", "0,0,0", "-n", 2).table
    np.testing.assert_array_equal(table["x"][:3], [0.5, -1, 1])
    assert table["yaw"][:2] == pytest.approx([math.pi / 2, 4 - math.tau])
    assert table.texts("id") == ["", "", "7", "", ""]


def test_poses_drawn_around_one() -> None:
    words = ("--map", REFERENCE_MAP, "--around", "1,-1,1", "--spread", "0.1,5deg", "-n", 500)
    first = mcl("score", SCAN, *words)
    assert first.code == 0
    table = first.table
    assert len(table.rows) == 500
    for name, mean, deviation in (("x", 1, 0.1), ("y", -1, 0.1), ("yaw", 1, math.radians(5))):
        assert abs(table[name].mean() - mean) < 5 * deviation / math.sqrt(500)
        assert table[name].std() == pytest.approx(deviation, rel=0.2)
    assert mcl("score", SCAN, *words, "--seed", 0).out == first.out
    assert mcl("score", SCAN, *words, "--seed", 1).out != first.out
    assert mcl("score", SCAN, *words, "--threads", 2).out == first.out


def test_poses_on_a_lattice() -> None:
    table = mcl("score", SCAN, "--map", REFERENCE_MAP, "--grid", "0.5,90deg").table
    positions = np.unique(np.column_stack((table["x"], table["y"])), axis=0)
    assert len(table.rows) == 4 * len(positions)
    assert 100 < len(positions) <= 144
    steps = np.unique(np.round(np.diff(np.unique(positions[:, 0])), 9))
    np.testing.assert_allclose(steps, [0.5])
    assert table["weight"].sum() == pytest.approx(1.0, abs=1e-12)
    fine = mcl("score", SCAN, "--map", REFERENCE_MAP, "--grid", "1").table
    assert len(fine.rows) % 72 == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "no pose to score"),
        (("--pose", "9,0,0"), "--pose: (9, 0) lies off the map; the map spans x -3 to 3 m"),
        (("--around", "0,-9,0"), "--around: (0, -9) lies off the map"),
        (("--pose", "1,2"), "X,Y,YAW"),
        (("--pose", "1,2,3kg"), "kg"),
        (("--around", "0,0,0", "--spread", "1"), "--spread"),
        (("--around", "0,0,0", "--spread", "1,-1"), "--spread"),
        (("--grid", "0"), "--grid"),
        (("--poses", "none.csv"), "none.csv"),
        (("--pose", "0,0,0", "--landmarks", str(LANDMARKS)), "--bearings"),
    ],
)
def test_poses_that_are_none(words: tuple[str, ...], said: str) -> None:
    assert said in single_error(mcl("score", SCAN, "--map", REFERENCE_MAP, *words, "-q"), 2)


def test_poses_of_a_file_off_the_map_are_scored_with_a_warning() -> None:
    result = mcl("score", SCAN, "--map", REFERENCE_MAP, "--poses", "-", stdin=b"x,y,yaw\n0.9,-0.8,-1\n99,0,0\n")
    assert result.code == 0
    assert "mcl: warning: -: 1 of 2 poses lie off the map" in result.err
    assert len(result.table.rows) == 2


# Parameters


def test_temperature_scales_the_likelihood_only() -> None:
    plain, tempered = reference(3, "exact"), reference(3, "exact", "--temperature", 0.25)
    np.testing.assert_array_equal(tempered["log_lidar"], plain["log_lidar"])
    np.testing.assert_allclose(tempered["log_weight"], 0.25 * plain["log_lidar"], rtol=0, atol=1e-12)
    softmax = np.exp(tempered["log_weight"]) / np.exp(tempered["log_weight"]).sum()
    np.testing.assert_allclose(tempered["weight"], softmax, rtol=1e-12)


@pytest.mark.parametrize("alpha", ["0", "1.5", "-1", "nan", "x"])
def test_a_temperature_out_of_bounds(alpha: str) -> None:
    single_error(mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "--temperature", alpha), 2)


def test_a_temperature_of_no_sensor_is_refused() -> None:
    words = ("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "--temperature")
    assert "'ldar' is no sensor; name lidar or vision" in single_error(mcl(*words, "ldar=0.5"), 2)
    assert mcl(*words, "lidar_2=0.5", "--temperature", "vision=0.5").code == 0


def test_parameters_of_a_file_and_their_precedence(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("z_hit: 0.95\nz_rand: 0.05\nsigma_hit: 15cm\nfield_method: brushfire\n")
    named = ("score", SCAN, "--map", REFERENCE_MAP, "--poses", POSES, "--params", tmp_path / "p.yaml")
    np.testing.assert_allclose(mcl(*named).table["log_lidar"], SET3.lidar["brushfire"], rtol=0, atol=1e-9)
    over = mcl(*named, "--set", "field_method=brushfire", "--set", "field_method=exact")
    np.testing.assert_allclose(over.table["log_lidar"], SET3.lidar["exact"], rtol=0, atol=1e-9)


def test_all_beams_are_scored_unless_said_otherwise(short: Path) -> None:
    everything = mcl("score", short, *NEAR).table["log_lidar"]
    same = mcl("score", short, *NEAR, "--set", "max_beams=360").table["log_lidar"]
    np.testing.assert_array_equal(everything, same)
    assert mcl("score", short, *NEAR, "--set", "max_beams=30").table["log_lidar"][0] > everything[0]


@pytest.mark.parametrize(
    ("pair", "said"),
    [
        ("sigma_hitt=1", "did you mean 'sigma_hit'?"),
        ("sigma_hit=1kg", "kg"),
        ("sigma_hit=-1", "sigma_hit"),
        ("max_beams=1.5", "whole number"),
        ("field_method=fast", "field_method"),
        ("sigma_hit", "KEY=VALUE"),
    ],
)
def test_parameters_that_are_none(pair: str, said: str) -> None:
    result = mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "--set", pair)
    assert said in single_error(result, 2)


# Outputs


def test_csv_to_a_file_and_to_stdout(tmp_path: Path) -> None:
    words = ("score", SCAN, "--map", REFERENCE_MAP, "--poses", POSES)
    expected = mcl(*words).out
    assert mcl(*words, "-o", "-").out == expected
    result = mcl(*words, "-o", tmp_path / "scores.csv")
    assert (result.code, result.out) == (0, b"")
    assert (tmp_path / "scores.csv").read_bytes() == expected
    assert [path.name for path in tmp_path.iterdir()] == ["scores.csv"]


def test_numbers_are_in_their_shortest_round_trip_form() -> None:
    table = reference(3, "exact")
    for row in table.rows:
        assert [repr(float(text)) for text in row] == row


def test_mcap(tmp_path: Path) -> None:
    words = ("score", OFFICE, "--index", 5, "--map", OFFICE_MAP, "--around", "-7.4,1.6,-85deg", "-n", 50)
    table = mcl(*words).table
    assert mcl(*words, "-o", tmp_path / "scores.mcap").code == 0
    found = {message.topic: message for message in messages(tmp_path / "scores.mcap")}
    assert {"/map", "/particle_cloud", "/mcl/step", "/mcl/pose", "/scan"} <= found.keys()
    array = decoded(found["/particlecloud"])
    assert [pose.position.x for pose in array.poses] == pytest.approx(table["x"], abs=2.0**-20)
    grid = decoded(found["/map"])
    assert (grid.info.width, grid.info.height) == (480, 320)


def test_heat_map(tmp_path: Path) -> None:
    target = tmp_path / "heat.png"
    result = mcl("score", SCAN, "--map", REFERENCE_MAP, "--grid", "0.3,30deg", "--heatmap", target)
    assert (result.code, result.out) == (0, b"")
    with Image.open(io.BytesIO(target.read_bytes())) as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 100
        assert len(picture.convert("RGB").getcolors(1 << 24) or []) > 10
    both = mcl("score", SCAN, "--map", REFERENCE_MAP, "--grid", "0.3,30deg", "--heatmap", target, "-o", "-")
    assert both.out == mcl("score", SCAN, "--map", REFERENCE_MAP, "--grid", "0.3,30deg").out


def test_a_heat_map_of_one_position_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "heat.png"
    result = mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "--heatmap", target, "-q")
    assert "--grid" in single_error(result, 1)
    assert not target.exists()


def test_an_output_is_never_an_input(tmp_path: Path) -> None:
    scan = tmp_path / "scan.csv"
    Path(shutil.copy(SCAN, scan))
    result = mcl("score", scan, "--map", REFERENCE_MAP, "--pose", "0,0,0", "-o", scan, "-q")
    assert "one of the inputs" in single_error(result, 2)
    assert scan.read_bytes() == SCAN.read_bytes()


def test_a_lattice_lies_on_free_cells_at_multiples_of_its_step() -> None:
    grid = drawn("..#\n...\n#..", 1.0, (-1.0, -1.0, 0.0))
    points = positions(grid, 0.5)
    np.testing.assert_array_equal(points, np.rint(points * 2) / 2)
    expected = {(x / 2, y / 2) for x in range(-2, 4) for y in range(-2, 4) if grid.free[int(y / 2 + 1), int(x / 2 + 1)]}
    assert {tuple(point) for point in points.tolist()} == expected


@pytest.mark.parametrize(("step", "count"), [(math.pi / 2, 4), (math.tau, 1), (1.0, 7), (math.radians(1), 360)])
def test_headings_go_round_evenly(step: float, count: int) -> None:
    yaws = headings(step)
    assert yaws.size == count
    assert 0.0 in yaws
    assert ((yaws > -math.pi) & (yaws <= math.pi)).all()
    np.testing.assert_allclose(np.diff(yaws), math.tau / count)


def test_every_heading_stands_at_every_position() -> None:
    grid = drawn("..", 1.0)
    got = lattice_poses(grid, 1.0, math.pi)
    points, yaws = positions(grid, 1.0), headings(math.pi)
    assert got.tolist() == [[*point, yaw] for point in points.tolist() for yaw in yaws.tolist()]
