"""``mcl dt``: the field, its cache, its outputs."""

from __future__ import annotations

import io
import json
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.io.maps.map_yaml import load_map
from mclcli.world import distance_field
from tests.cli.support import MAPS, REFERENCE_MAP, mcl, single_error

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.world import FieldMethod


def test_the_second_call_finds_what_the_first_one_kept(tmp_path: Path) -> None:
    first, second = (mcl("dt", REFERENCE_MAP, "--cache-dir", tmp_path / "cache") for _ in range(2))
    assert (first.code, second.code, first.err, second.err) == (0, 0, "", "")
    assert first.out.startswith(b"reference.yaml: 120 x 120 cells of 0.05 m, 200 occupied; exact field to 2 m in ")
    assert b"cache miss" in first.out
    assert b"cache hit" in second.out
    other = mcl("dt", REFERENCE_MAP, "--cache-dir", tmp_path / "cache", "--max-dist", 1)
    assert b"cache miss" in other.out


def test_json(tmp_path: Path) -> None:
    words = ("dt", REFERENCE_MAP, "--json", "--method", "brushfire", "--max-dist", 1.5, "--cache-dir", tmp_path)
    miss, hit = (json.loads(mcl(*words).out) for _ in range(2))
    for name in ("milliseconds",):
        assert miss.pop(name) >= 0.0
        del hit[name]
    assert miss.pop("cache") == "miss"
    assert hit.pop("cache") == "hit"
    assert miss == hit
    assert miss.pop("file").startswith(str(tmp_path))
    assert miss == {
        "map": "reference.yaml",
        "width": 120,
        "height": 120,
        "resolution": 0.05,
        "occupied": 200,
        "method": "brushfire",
        "max_dist": 1.5,
    }


def test_without_the_cache_nothing_is_kept(tmp_path: Path) -> None:
    result = mcl("dt", REFERENCE_MAP, "--no-cache", "--cache-dir", tmp_path / "cache")
    assert b"cache off" in result.out
    assert not (tmp_path / "cache").exists()


@pytest.mark.parametrize("method", ["exact", "brushfire"])
@pytest.mark.parametrize("name", ["reference.yaml", "warehouse.yaml"])
def test_the_field_as_npy(tmp_path: Path, name: str, method: FieldMethod) -> None:
    target = tmp_path / "field.npy"
    assert mcl("dt", MAPS / name, "--method", method, "-o", target).code == 0
    field = np.load(target)
    grid = load_map(MAPS / name)
    expected = distance_field.compute(grid, method, 2.0).metres()
    assert field.dtype == np.float64
    np.testing.assert_array_equal(field, expected)
    assert not field[grid.occupied].any()
    assert field.max() == 2.0


def test_the_field_on_stdout_leaves_the_summary_to_stderr() -> None:
    result = mcl("dt", REFERENCE_MAP, "-o", "-")
    assert result.code == 0
    assert np.load(io.BytesIO(result.out)).shape == (120, 120)
    assert result.err.startswith("reference.yaml: 120 x 120 cells")


def test_the_field_as_a_picture(tmp_path: Path) -> None:
    assert mcl("dt", REFERENCE_MAP, "--png", tmp_path / "field.png").code == 0
    with Image.open(tmp_path / "field.png") as picture:
        assert picture.format == "PNG"
        assert len(picture.convert("RGB").getcolors(1 << 24) or []) > 10
    assert [path.name for path in tmp_path.iterdir()] == ["field.png"]


def test_a_map_without_an_obstacle_is_a_warning(tmp_path: Path) -> None:
    shutil.copy(REFERENCE_MAP, tmp_path)
    Image.new("L", (120, 120), 254).save(tmp_path / "reference.pgm")
    result = mcl("dt", tmp_path / "reference.yaml", "-o", tmp_path / "field.npy")
    assert result.code == 0
    assert result.err.count("mcl: warning: ") == 1
    assert "no cell is occupied" in result.err
    assert set(np.unique(np.load(tmp_path / "field.npy"))) == {2.0}


def test_a_cache_that_cannot_be_written_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    result = mcl("dt", REFERENCE_MAP, "--cache-dir", tmp_path / "file" / "cache", "-o", tmp_path / "field.npy")
    assert result.code == 0
    assert result.err.count("mcl: warning: ") == 1
    assert "going on without" in result.err
    field = distance_field.compute(load_map(REFERENCE_MAP), "exact", 2.0).metres()
    np.testing.assert_array_equal(np.load(tmp_path / "field.npy"), field)


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf"])
def test_a_clamp_that_is_none(value: str) -> None:
    assert "laser_likelihood_max_dist" in single_error(mcl("dt", REFERENCE_MAP, "--max-dist", value), 2)


def test_maps_that_are_none(tmp_path: Path) -> None:
    assert single_error(mcl("dt", "none.yaml"), 2).startswith("none.yaml: no such file")
    assert "README.md" in single_error(mcl("dt", MAPS / "README.md"), 1)
    assert "--max-cells" in single_error(mcl("dt", REFERENCE_MAP, "--max-cells", 100), 1)
    (tmp_path / "m.yaml").write_text(
        "image: none.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    assert "none.pgm" in single_error(mcl("dt", tmp_path / "m.yaml"), 2)
    single_error(mcl("dt", REFERENCE_MAP, "-o", REFERENCE_MAP), 2)
