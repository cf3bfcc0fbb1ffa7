"""``mcl run --seeds``: a run a seed, with outputs of its own, and how far they are apart."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from mclcli.cli.run.seeds import numbered
from tests.cli.support import OFFICE, OFFICE_MAP, SAMPLES, mcl, single_error

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner


def test_each_seed_writes_what_it_would_alone(run_short: Runner, tmp_path: Path) -> None:
    words = ("--track", tmp_path / "t.csv", "-o", tmp_path / "w.csv.gz", "--picture", tmp_path / "p.png")
    result = run_short("--seeds", "3:4", *words)
    assert (result.code, result.out) == (0, b"")
    assert run_short("--seed", 4, *words).code == 0
    for name, other in (("t.csv", "t.0004.csv"), ("w.csv.gz", "w.0004.csv.gz"), ("p.png", "p.0004.png")):
        assert (tmp_path / name).read_bytes() == (tmp_path / other).read_bytes(), name
    assert (tmp_path / "t.0003.csv").read_bytes() != (tmp_path / "t.0004.csv").read_bytes()
    assert len(list(tmp_path.iterdir())) == 9


def test_the_summary_tells_every_seed_and_the_spread(run_short: Runner) -> None:
    result = run_short("--seeds", 3, "--truth", SAMPLES / "office.truth.tum")
    assert (result.code, result.out) == (0, b"")
    lines = result.err.splitlines()
    for seed in range(3):
        [line] = [line for line in lines if line.startswith(f"mcl: seed {seed}: ")]
        assert re.search(r"last .* reliability 0\.\d\d on average, 0\.\d\d at the least, RMSE 0\.\d{3} m", line)
    assert any(
        re.fullmatch(r"mcl: 3 seeds: last poses up to 0\.\d\d m and \d+\.\d° from their middle", s) for s in lines
    )
    assert any(line.startswith("ape_rmse") for line in lines)


def test_what_is_the_same_is_said_once(run_short: Runner) -> None:
    lines = run_short("--seeds", 3, init="4,-4,0,0.1,3deg").err.splitlines()
    assert len(lines) == len(set(lines))
    assert sum("probably lost, or off the map" in line for line in lines) == 3


def test_seeds_begin_at_seed(run_short: Runner) -> None:
    lines = run_short("--seeds", 2, "--seed", 8).err
    assert "mcl: seed 8: " in lines
    assert "mcl: seed 9: " in lines


def test_eval_takes_them(run_short: Runner, tmp_path: Path) -> None:
    assert run_short("--seeds", 2, "--track", tmp_path / "t.csv").code == 0
    result = mcl("eval", tmp_path / "t.*.csv", "--truth", SAMPLES / "office.truth.tum")
    assert result.code == 0
    assert result.out.startswith(b"2 tracks against")


@pytest.mark.parametrize("text", ["0", "x", "-1", "1:", ":3", "4:3", "0:20000", "10001", "1:2:3", "1.5", "²"])
def test_what_are_no_seeds(text: str) -> None:
    assert single_error(mcl("run", OFFICE, "--map", OFFICE_MAP, f"--seeds={text}"), 2).startswith("--seeds: ")


def test_streams_are_refused(run_short: Runner) -> None:
    for words in (("--track", "-"), ("-o", "/dev/stdout"), ("--steps", "-")):
        assert "--seeds writes a file for each seed" in single_error(run_short("--seeds", 2, *words), 2)
    assert "can be read once" in single_error(run_short("--seeds", 2, log="-"), 2)


@pytest.mark.parametrize(
    ("name", "becomes"),
    [
        ("t.csv", "t.0007.csv"),
        ("a.b/t.csv.gz", "a.b/t.0007.csv.gz"),
        ("x.tum", "x.0007.tum"),
        ("v1.2.mcap", "v1.2.0007.mcap"),
        ("p.png", "p.0007.png"),
    ],
)
def test_names(name: str, becomes: str) -> None:
    assert numbered(name, 7) == becomes
    assert numbered("t.csv", 123456) == "t.123456.csv"
