"""``mcl smooth``: a track better than the filter's, what it says of itself, and what it refuses."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.io.recording.recorded_poses import read_trajectory
from tests.cli.support import (
    MAPS,
    OFFICE,
    OFFICE_MAP,
    SAMPLES,
    Result,
    Table,
    error_against,
    mcl,
    messages,
    single_error,
)

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

START = ("--init", "/initialpose", "--particles", "500")
TRUTH = SAMPLES / "office.truth.tum"


def rmse_of(track: Path) -> float:
    return error_against(Table(track.read_text(encoding="utf-8")), TRUTH)


def smooth(log: Path | str, *words: object, grid: Path = OFFICE_MAP, stdin: bytes = b"") -> Result:
    return mcl("smooth", log, "--map", grid, *START, *words, stdin=stdin)


@pytest.fixture(name="made", scope="module")
def _made(short: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All outputs of one call over the short log."""
    folder = tmp_path_factory.mktemp("smoothed")
    names = [folder / f"t.{ending}" for ending in ("csv", "tum", "mcap")]
    result = smooth(short, *(word for name in names for word in ("-o", name)), "--picture", folder / "p.png")
    assert result.code == 0, result.err
    assert result.out == b""
    (folder / "said").write_text(result.err, encoding="utf-8")
    return folder


def test_the_track_is_a_centimetre_from_the_truth_where_the_filters_is_not(made: Path, short_track: bytes) -> None:
    track, filtered = made / "t.csv", made / "filtered.csv"
    filtered.write_bytes(short_track)
    assert rmse_of(track) < 0.01
    assert rmse_of(track) < 0.6 * rmse_of(filtered)


def test_all_outputs_hold_the_same_poses(made: Path) -> None:
    table, text = (read_trajectory(str(made / name)) for name in ("t.csv", "t.tum"))
    recorded = read_trajectory(f"{made / 't.mcap'}:/amcl_pose")
    assert table.updated is not None
    assert table.updated.all()
    for other in (text, recorded):
        np.testing.assert_array_equal(other.stamps_ns, table.stamps_ns)
        np.testing.assert_allclose(other.poses, table.poses, atol=1e-8)
    assert table.covariances is not None
    assert recorded.covariances is not None
    np.testing.assert_allclose(recorded.covariances, table.covariances, rtol=1e-6, atol=1e-15)
    assert (np.linalg.eigvalsh(table.covariances) > 0.0).all()


def test_the_mcap_has_the_map_and_the_transforms_and_no_particles(made: Path) -> None:
    topics = {message.topic for message in messages(made / "t.mcap")}
    assert topics == {"/map", "/tf_static", "/tf", "/mcl/pose", "/amcl_pose"}


def test_the_summary_names_costs_what_was_learned_and_the_verdict(made: Path) -> None:
    said = (made / "said").read_text(encoding="utf-8")
    for part in ("smoothed 9", "stated uncertainty", "cost left: scans", "of noise in a metre", "beams: σ 1"):
        assert part in said, said
    assert "\nmcl: a pseudo reference, if the map is right" in said
    assert "\nmcl: the filter is nearer to it with --set obstacles=boundary --set range_offset=30mm\n" in said
    assert "lost" not in said


def test_the_filter_is_nearer_with_the_offset_that_is_told(
    made: Path, run_short: Runner, short_track: bytes, tmp_path: Path
) -> None:
    words = ("--set", "obstacles=boundary", "--set", "range_offset=30mm", "--track", tmp_path / "t.csv")
    assert run_short(*words).code == 0
    (tmp_path / "before.csv").write_bytes(short_track)
    apart = [
        error_against(Table((tmp_path / name).read_text(encoding="utf-8")), made / "t.tum")
        for name in ("before.csv", "t.csv")
    ]
    assert apart[1] < apart[0]


def test_the_picture_shows_the_track(made: Path) -> None:
    with Image.open(made / "p.png") as picture:
        assert picture.width > 400


def test_a_track_taken_for_a_reference_repeats_its_caveat(made: Path, tmp_path: Path) -> None:
    result = mcl("eval", made / "t.csv", "--truth", made / "t.tum")
    assert result.code == 0
    assert f"warning: {made / 't.tum'}: a pseudo reference of mcl smooth" in result.err
    without = tmp_path / "plain.tum"
    lines = (made / "t.tum").read_text(encoding="utf-8").splitlines(keepends=True)
    without.write_text("".join(lines[1:]), encoding="utf-8")
    assert "pseudo" not in mcl("eval", made / "t.csv", "--truth", without).err


def test_the_same_call_makes_the_same_bytes(short: Path, made: Path, tmp_path: Path) -> None:
    names = [tmp_path / f"t.{ending}" for ending in ("csv", "tum", "mcap")]
    words = [word for name in names for word in ("-o", name)]
    assert smooth(short, *words, "--picture", tmp_path / "p.png").code == 0
    for name in ("t.csv", "t.tum", "p.png"):
        assert (tmp_path / name).read_bytes() == (made / name).read_bytes()
    assert messages(tmp_path / "t.mcap") == messages(made / "t.mcap")


def test_json_has_the_figures(short: Path, tmp_path: Path) -> None:
    result = smooth(short, "--json", "-o", tmp_path / "t.tum", "-q")
    assert result.code == 0
    facts = json.loads(result.out)
    assert facts["beams"]["sigma_hit"] == pytest.approx(0.015, abs=0.002)
    assert facts["beams"]["range_offset"] == pytest.approx(0.0293, abs=0.002)
    assert facts["pseudo_reference"] is True
    assert facts["reasons"] == facts["lost"] == []
    assert facts["scans"] > facts["places"] > 20
    assert facts["cost"]["scans"] > facts["cost"]["odometry"] > 0.0
    assert (tmp_path / "t.tum").exists()


def test_a_stream_gives_the_track_of_the_file(short: Path, made: Path) -> None:
    result = smooth("-", stdin=short.read_bytes())
    assert result.code == 0
    assert result.out == (made / "t.csv").read_bytes()


def test_a_lost_track_is_told_and_ends_in_5(short: Path, tmp_path: Path) -> None:
    """Started two rooms away, the filter never finds the robot, and smoothing does not either."""
    target = tmp_path / "t.tum"
    words = ("--map", OFFICE_MAP, "--init", "6,4.2,90deg", "--particles", "300", "-o", target)
    result = mcl("smooth", short, *words)
    assert result.code == 5
    assert "error: the track is probably lost, or off the map, on" in result.err
    assert "lost from" in result.err
    assert "no reference:" in result.err
    assert target.read_text(encoding="utf-8").startswith("# caveat: a track of mcl smooth, not to be taken for")


def test_a_wrong_map_is_no_reference(tmp_path: Path) -> None:
    """The office drawn 3 % too large: walls are where the map has them in no room but the first."""
    stretched = tmp_path / "map.yaml"
    text = OFFICE_MAP.read_text(encoding="utf-8").replace("resolution: 0.05", "resolution: 0.0515")
    assert "0.0515" in text
    stretched.write_text(text.replace("image: ", f"image: {MAPS}/"), encoding="utf-8")
    result = mcl(
        "smooth", OFFICE, "--map", stretched, "--allow-outside", "--init", "/initialpose", "--json", "--duration", "40"
    )
    facts = json.loads(result.out)
    assert facts["pseudo_reference"] is False
    assert facts["reasons"]


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("-o", "t.txt"), 2, "-o t.txt: the name must end in .csv or .tum or .mcap"),
        (("--json", "-o", "-"), 2, "--json: standard output holds the track already"),
        (("-o", "t.csv", "-o", "t.csv"), 2, "t.csv: named for two outputs"),
        (("-o", "nowhere/t.csv"), 2, "folder"),
        (("--steps", "s.csv"), 2, "No such option"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(short: Path, words: tuple[str, ...], code: int, says: str) -> None:
    assert says in single_error(smooth(short, *words), code)


def test_without_a_map_there_is_nothing_to_smooth_on(short: Path) -> None:
    assert "no map" in single_error(mcl("smooth", short, *START), 1)


def test_an_output_that_cannot_be_written_is_refused_before_the_log_is_run(short: Path, tmp_path: Path) -> None:
    taken = tmp_path / "log.mcap"
    taken.write_bytes(short.read_bytes())
    result = mcl("smooth", taken, "--map", OFFICE_MAP, *START, "-o", taken)
    assert result.code == 2
    assert "smoothed" not in result.err
    assert taken.read_bytes() == short.read_bytes()
