"""``mcl score --explain``: what a pose's score is made of."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING

import pytest
from PIL import Image

from tests.cli.support import ROOT, mcl

if TYPE_CHECKING:
    from pathlib import Path

POSE = "--pose=0.8,-1.1,-40deg"
WORDS = (ROOT / "samples/reference_set2.yaml", "--map", ROOT / "maps/reference.yaml", POSE, "--set", "max_range=score")
SEEN = (
    "--landmarks",
    ROOT / "samples/reference.landmarks.csv",
    "--bearings",
    ROOT / "samples/reference_set2.bearings.csv",
)


def table(raw: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(raw.decode())))


@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob", "beam"])
def test_the_rows_add_up_to_the_score(model: str) -> None:
    score = table(mcl("score", *WORDS, *SEEN, "--model", model).out)[0]
    rows = table(mcl("score", *WORDS, *SEEN, "--model", model, "--explain").out)
    for sensor in ("lidar", "vision"):
        total = sum(float(row["log_p"]) for row in rows if row["sensor"] == sensor)
        assert total == pytest.approx(float(score[f"log_{sensor}"]), abs=1e-9)


def test_every_beam_and_every_landmark_has_its_row() -> None:
    rows = table(mcl("score", *WORDS, *SEEN, "--explain").out)
    assert [row["name"] for row in rows] == [*map(str, range(9)), "1", "2", "3", "99"]
    unknown = rows[-1]
    assert unknown["expected"] == ""
    assert float(unknown["log_p"]) == pytest.approx(-1.8378770664093453)


def test_the_shares_of_the_mixture_are_its_density() -> None:
    for row in table(mcl("score", *WORDS, "--model", "beam", "--explain").out):
        total = sum(float(row[part]) for part in ("hit", "short", "max", "rand"))
        assert math.log(max(total, 1e-12)) == pytest.approx(float(row["log_p"]), abs=1e-9)
        assert float(row["error"]) == pytest.approx(float(row["measured"]) - float(row["expected"]), abs=1e-12)


def test_a_picture_of_the_scan(tmp_path: Path) -> None:
    result = mcl("score", *WORDS, "--picture", tmp_path / "scan.png")
    assert (result.code, result.out) == (0, b"")
    with Image.open(tmp_path / "scan.png") as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 300


@pytest.mark.parametrize("profile", ["textbook", "nav2", "beluga"])
@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob", "beam"])
def test_a_scan_with_everything_in_it_is_explained_and_drawn(tmp_path: Path, profile: str, model: str) -> None:
    scan = tmp_path / "scan.yaml"
    scan.write_text(
        "header:\n  frame_id: laser\nangle_min: -0.5\nangle_max: 0.5\nangle_increment: 0.1\nrange_min: 0.2\n"
        "range_max: 8.0\nranges: [.inf, -.inf, .nan, 0.0, 0.1, 0.2, 1.0, 2.0, 8.0, 9.0, 1.5]\n"
    )
    options = ("--profile", profile, "--model", model, "--picture", tmp_path / "scan.png", "--explain")
    result = mcl("score", scan, "--map", ROOT / "maps/reference.yaml", POSE, *options)
    assert result.code == 0
    assert "arning" not in result.err
    rows = {row["name"]: row for row in table(result.out)}
    assert {"6", "7", "10"} <= set(rows)
    assert "2" not in rows
    assert all(math.isfinite(float(row["log_p"])) for row in rows.values())
    assert (tmp_path / "scan.png").stat().st_size > 10_000


def test_two_poses_are_refused() -> None:
    result = mcl("score", *WORDS, "--pose=0,0,0", "--explain")
    assert result.code == 2
    assert "take one pose, not 2" in result.err
