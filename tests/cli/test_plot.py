"""``mcl plot``: updates read back from steps and traces, and drawn."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.io.tables import updates_file
from mclcli.io.tables.updates_file import read_updates
from mclcli.render.updates import draw_updates
from tests.cli.support import OFFICE, SAMPLES, Everything, mcl, single_error

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def files(everything: Everything, tmp_path: Path) -> Path:
    for name in ("steps.csv", "trace.csv", "trace.csv.gz", "trace.mcap"):
        (tmp_path / name).write_bytes(everything.files[name])
    return tmp_path


@pytest.mark.parametrize("rows", [700, 200_000])
def test_a_trace_says_what_the_steps_say(files: Path, rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(updates_file, "_ROWS", rows)  # 300 particles: a step goes on in the next block
    steps = read_updates(files / "steps.csv")
    for name in ("trace.csv", "trace.csv.gz", "trace.mcap"):
        trace = read_updates(files / name)
        np.testing.assert_allclose(trace.stamps_ns, steps.stamps_ns, atol=500)
        np.testing.assert_array_equal(trace.particles, steps.particles)
        np.testing.assert_allclose(trace.ess, steps.ess, rtol=1e-6)
        np.testing.assert_allclose(trace.poses, steps.poses, atol=1e-6)
        assert trace.reliability is None
    assert steps.reliability is not None
    assert steps.reliability.min() > 0.8


@pytest.mark.parametrize(("name", "panels"), [("steps.csv", 3), ("trace.csv.gz", 2), ("trace.mcap", 2)])
def test_pictures(files: Path, name: str, panels: int) -> None:
    plain, judged = files / "plain.png", files / "judged.png"
    assert mcl("plot", files / name, "-o", plain).code == 0
    assert mcl("plot", files / name, "-o", judged, "--truth", SAMPLES / "office.truth.tum").code == 0
    with Image.open(plain) as few, Image.open(judged) as more:
        assert (few.format, few.width) == ("PNG", more.width)
        each = (more.height - few.height) / 2  # two panels of errors
        assert few.height == pytest.approx(108 + panels * each, abs=4)


def test_what_is_lost_is_shaded() -> None:
    seconds = np.arange(10.0)
    lost = (seconds >= 3) & (seconds <= 5)
    values = np.full(10, 0.5)
    shaded, plain = (
        np.asarray(draw_updates(seconds, ess=values, particles=values, lost=marks, title="x"))
        for marks in (lost, np.zeros(10, np.bool_))
    )
    changed = np.flatnonzero((shaded != plain).any(axis=2)[80:200].any(axis=0))
    left, right = 78, 1100 - 44
    scale = (right - left) / 9.0
    assert changed.min() == pytest.approx(left + 3 * scale, abs=2)
    inside = changed[changed < left + 6 * scale]
    assert inside.max() == pytest.approx(left + 5 * scale, abs=2)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"a,b\n1,2\n", "neither a weight trace nor steps of `mcl run`: its header has a, b"),
        (b"", "its header has nothing"),
        (b"\xff\xfe\x00", "not text"),
        (b"step,stamp,particle,x,y,yaw,weight\n", "holds no update"),
        (b"step,stamp,particle,x,y,yaw,weight\n0,1,0,a,0,0,1\n", "a row is not one of a weight trace"),
        (b"step,stamp,particle,x,y,weight\n", "no column 'yaw'"),
        (b"stamp,n,ess,x,y\n1,1,1,1,1\n", "no column 'yaw'"),
    ],
)
def test_what_is_no_trace(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "x.csv").write_bytes(content)
    assert said in single_error(mcl("plot", tmp_path / "x.csv", "-o", tmp_path / "x.png"), 1)
    assert not (tmp_path / "x.png").exists()


def test_a_log_is_no_trace(files: Path) -> None:
    assert "no update of `mcl run` in it" in single_error(mcl("plot", OFFICE, "-o", files / "x.png"), 1)


def test_a_cut_gzip(tmp_path: Path) -> None:
    whole = gzip.compress(b"step,stamp,particle,x,y,yaw,weight\n" + b"0,1,0,0.5,0,0,1\n" * 9)
    (tmp_path / "x.csv.gz").write_bytes(whole[:-9])
    assert "damaged gzip" in single_error(mcl("plot", tmp_path / "x.csv.gz", "-o", tmp_path / "x.png"), 1)


def test_refusals(files: Path) -> None:
    assert "no such file" in single_error(mcl("plot", "none.csv", "-o", files / "x.png"), 2)
    assert "must end in .png" in single_error(mcl("plot", files / "steps.csv", "-o", files / "x.csv"), 2)
    assert mcl("plot", files / "steps.csv").code == 2
