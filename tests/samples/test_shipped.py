"""What is shipped: complete, small, described, and what the generator makes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from ruamel.yaml import YAML

from mclcli.geometry import se2, se3
from samples.generate import NAMES, generate, main
from samples.sim.building import FREE, OCCUPIED, UNKNOWN, Building, near
from samples.sim.recording import Recording, drift, simulate
from samples.sim.robot import Trajectory
from samples.sim.scenarios import SCENARIOS
from tests.samples.naive import ROOT, Decoded, by_topic, read_log

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray, FloatArray

SHIPPED = sorted(
    p.relative_to(ROOT) for folder in ("maps", "samples") for p in (ROOT / folder).iterdir() if p.is_file()
)
TEXT = {".yaml", ".csv", ".tum", ".pgm"}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made")
    for name in NAMES:
        generate(name, out)
    return out


@pytest.fixture(scope="module", params=SCENARIOS)
def recording(request: pytest.FixtureRequest) -> Recording:
    return simulate(SCENARIOS[request.param]())


def numbers(entry: Decoded) -> list[float]:
    """Every number and the length of every text of a message, in order."""
    found: list[float] = []
    todo: list[object] = [entry.message]
    while todo:
        item = todo.pop()
        if isinstance(item, str):
            found += [float(ord(letter)) for letter in item]
        elif isinstance(item, np.ndarray):
            found += item.astype(np.float64).tolist()
        elif isinstance(item, int | float):
            found.append(float(item))
        elif isinstance(item, list):
            todo += item
        else:
            todo += [getattr(item, name) for name in item.__dataclass_fields__ if name != "__msgtype__"]  # type: ignore[attr-defined]
    return found


def test_nothing_is_shipped_that_the_generator_does_not_make(made: Path) -> None:
    generated = {p.relative_to(made) for p in made.rglob("*") if p.is_file()}
    own = {Path("samples/generate.py"), Path("samples/__init__.py"), Path("samples/README.md"), Path("maps/README.md")}
    assert set(SHIPPED) == generated | own


@pytest.mark.parametrize("name", SCENARIOS)
def test_logs_are_what_the_generator_makes(made: Path, name: str) -> None:
    shipped, again = (read_log(folder / "samples" / f"{name}.mcap") for folder in (ROOT, made))
    assert [entry[:4] for entry in shipped] == [entry[:4] for entry in again]
    assert [len(numbers(entry)) for entry in shipped] == [len(numbers(entry)) for entry in again]
    for topic, entries in by_topic(shipped).items():
        ours = np.concatenate([numbers(entry) for entry in entries])
        theirs = np.concatenate([numbers(entry) for entry in by_topic(again)[topic]])
        # another processor rounds sines differently: a reading between two steps of the device may fall either way
        np.testing.assert_allclose(ours, theirs, atol=1.1 / 1024 if topic == "/scan" else 1e-6)


def test_other_files_are_what_the_generator_makes(made: Path) -> None:
    for path in (p for p in SHIPPED if p.suffix in TEXT and p.suffix != ".tum"):
        assert (ROOT / path).read_bytes() == (made / path).read_bytes(), path
    for name in SCENARIOS:
        ours, theirs = (np.loadtxt(folder / f"samples/{name}.truth.tum") for folder in (ROOT, made))
        np.testing.assert_allclose(ours, theirs, atol=2e-6)
    ours, theirs = (np.asarray(Image.open(folder / "maps/warehouse.png")) for folder in (ROOT, made))
    np.testing.assert_array_equal(ours, theirs)


def test_sizes() -> None:
    sizes = {path: (ROOT / path).stat().st_size for path in SHIPPED}
    assert all(size <= 2_000_000 for path, size in sizes.items() if path.suffix == ".mcap")
    assert sum(sizes.values()) < 5_000_000


def test_the_readmes_name_every_file() -> None:
    for path in SHIPPED:
        if path.suffix not in {".py", ".md"}:
            assert path.name in (ROOT / path.parts[0] / "README.md").read_text(encoding="utf-8"), path


def test_odometry_goes_astray_and_truth_keeps_to_the_floor(recording: Recording) -> None:
    assert drift(recording)[-1] > 1.0
    floor: Building = recording.scenario.today or recording.scenario.mapped
    places = floor.to_floor(recording.truth.poses)[:, np.newaxis, :2]
    ring = 0.22 * np.stack([np.cos(np.arange(12) * np.pi / 6), np.sin(np.arange(12) * np.pi / 6)], axis=-1)
    cells = np.floor((places + ring) / floor.resolution).astype(int)
    assert np.all(floor.grid[cells[..., 1], cells[..., 0]] == FREE)
    assert 80 < recording.odom.stamps_ns[-1] / 1e9 < 120


def test_most_readings_of_a_log_end_at_what_its_map_shows(recording: Recording) -> None:
    """Log and map agree: through truth, static transforms and beam angles, endpoints fall on occupied cells."""
    scenario = recording.scenario
    topics = by_topic(read_log(ROOT / "samples" / f"{scenario.name}.mcap"))
    edges = [edge for entry in topics["/tf_static"] for edge in entry.message.transforms]
    base_from_laser = np.eye(4)
    for edge in edges:  # from the base outwards; the camera hangs beside the laser
        if edge.child_frame_id != "camera_link":
            base_from_laser = base_from_laser @ _matrix(edge.transform.translation, edge.transform.rotation)
    truth = Trajectory(
        np.array([entry.stamp_ns for entry in topics["/ground_truth"]]),
        np.array([_planar(entry.message.pose) for entry in topics["/ground_truth"]]),
    )
    near_walls = near(scenario.mapped.occupied, 1)
    shares = [_share_on(near_walls, scenario.mapped, truth, base_from_laser, e) for e in topics["/scan"][::7]]
    assert 0.85 < np.mean(shares) < 0.99
    assert np.median(shares) > 0.9


def _share_on(
    mask: BoolArray, floor: Building, truth: Trajectory, base_from_laser: FloatArray, entry: Decoded
) -> float:
    """Share of the returns of one scan that end in a cell of ``mask``."""
    scan = entry.message
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    stamps = entry.stamp_ns + np.round(beams * scan.time_increment * 1e9).astype(np.int64)
    angles, r = scan.angle_min + beams * scan.angle_increment, scan.ranges[beams].astype(np.float64)
    ends = np.stack([r * np.cos(angles), r * np.sin(angles), 0 * r, np.ones_like(r)])
    x, y = (base_from_laser @ ends)[:2]
    on_floor = floor.to_floor(se2.compose(truth.at(stamps), np.stack([x, y, 0 * x], axis=-1)))
    columns, rows = np.floor(on_floor[:, :2].T / floor.resolution).astype(int)
    return float(np.mean(mask[rows, columns]))


def _matrix(translation: Any, rotation: Any) -> FloatArray:
    t, q = translation, rotation
    return se3.from_quaternion([t.x, t.y, t.z], [q.x, q.y, q.z, q.w])


def _planar(pose: Any) -> FloatArray:
    return se3.to_planar(_matrix(pose.position, pose.orientation))


def test_landmarks_are_seen_mostly_right(recording: Recording) -> None:
    camera = recording.scenario.camera
    assert camera is not None
    known = set(recording.scenario.mapped.landmarks.ids)
    names = [name for image in recording.sightings for name in image.ids]
    assert len(names) > 200
    assert 0 < sum(name not in known for name in names) / len(names) < 0.06


def test_the_office_map_reads_back() -> None:
    described = YAML(typ="safe").load(ROOT / "maps/office.yaml")
    assert described["mode"] == "trinary"
    assert described["origin"][2] == 0.0
    assert 0.0 not in described["origin"][:2]
    pixels = np.asarray(Image.open(ROOT / "maps" / described["image"]))[::-1]
    grid = SCENARIOS["office"]().mapped.grid
    np.testing.assert_array_equal(pixels, np.select([grid == FREE, grid == OCCUPIED], [254, 0], 205))


def test_the_warehouse_map_is_a_yawed_png_of_mode_scale() -> None:
    described = YAML(typ="safe").load(ROOT / "maps/warehouse.yaml")
    assert (described["mode"], described["origin"][2]) == ("scale", 0.3)
    gray, alpha = np.moveaxis(np.asarray(Image.open(ROOT / "maps" / described["image"]))[::-1], -1, 0)
    grid = SCENARIOS["warehouse"]().mapped.grid
    np.testing.assert_array_equal(alpha == 0, grid == UNKNOWN)
    np.testing.assert_array_equal(gray[alpha > 0] < 0.35 * 255, (grid == OCCUPIED)[alpha > 0])
    assert np.sum((gray > 90) & (gray < 200)) > 100


def test_the_command_makes_what_it_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--out", str(tmp_path), "reference"]) == 0
    assert "samples/reference_set2.yaml" in capsys.readouterr().out
    assert not (tmp_path / "samples/office.mcap").exists()
    with pytest.raises(SystemExit) as ended:
        main(["kitchen"])
    assert ended.value.code == 2
    assert "kitchen" in capsys.readouterr().err


def test_the_command_runs_from_anywhere(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "samples/generate.py"), "--out", str(tmp_path), "reference"]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    assert (tmp_path / "maps/reference.pgm").read_bytes() == (ROOT / "maps/reference.pgm").read_bytes()
