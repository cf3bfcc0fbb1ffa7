"""``mcl eval``: numbers, limits, several tracks, pictures, and what it refuses."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from tests.cli.support import OFFICE, OFFICE_MAP, SAMPLES, mcl, single_error
from tests.data import shared
from tests.evaluate.drives import as_tum, drive, noisy, shifted

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

TRUTH = SAMPLES / "office.truth.tum"


@pytest.fixture(name="files")
def _files(tmp_path: Path) -> tuple[Path, Path]:
    """A track and its reference as files."""
    track, reference = noisy(7, count=400)
    (tmp_path / "track.tum").write_text(as_tum(track))
    (tmp_path / "truth.tum").write_text(as_tum(reference))
    return tmp_path / "track.tum", tmp_path / "truth.tum"


def facts(*words: object, stdin: bytes = b"", code: int = 0) -> dict[str, Any]:
    """What --json says."""
    result = mcl("eval", *words, "--json", stdin=stdin)
    assert result.code == code, result.err
    found: dict[str, Any] = json.loads(result.out)
    return found


def test_the_table_tells_what_json_tells(short_track: bytes) -> None:
    found = facts("-", "--truth", TRUTH, stdin=short_track)["tracks"][0]
    shown = mcl("eval", "-", "--truth", TRUTH, stdin=short_track).out.decode()
    row = next(line for line in shown.splitlines() if line.startswith("APE, translation"))
    ape = found["ape"]["translation"]
    assert row.split()[3:] == [f"{ape[name]:.4f}" for name in ("rmse", "mean", "median", "std", "min", "max")]
    assert "96 of 96 poses compared (100.0 %)" in shown
    assert "not aligned" in shown
    assert "converged after 0.0 s" in shown
    assert f"ANEES {found['consistency']['anees']:.2f} over {found['consistency']['count']} updates" in shown


def test_the_log_itself_holds_the_reference(short_track: bytes) -> None:
    from_log, from_file = (
        facts("-", "--truth", truth, stdin=short_track)["tracks"][0]["ape"]["translation"]["rmse"]
        for truth in (f"{OFFICE}:/ground_truth", TRUTH)
    )
    assert from_log == pytest.approx(from_file, abs=1e-3)


def test_a_run_tells_the_same_at_its_end(run_short: Runner, short_track: bytes) -> None:
    shown = mcl("eval", "-", "--truth", TRUTH, stdin=short_track).out.decode().splitlines()
    told = run_short("--truth", TRUTH).err
    for line in shown[1:]:
        assert line in told
    assert "APE, translation" in told


def test_the_reference_may_have_an_error_of_its_own(tmp_path: Path, short_track: bytes) -> None:
    track = tmp_path / "track.csv"
    track.write_bytes(short_track)
    words = (track, "--truth", TRUTH)
    exact = facts(*words)["tracks"][0]["consistency"]
    blurred = facts(*words, "--truth-sd", "10cm,2deg")["tracks"][0]["consistency"]
    assert blurred["anees"] < exact["anees"]
    assert blurred["truth_sd"] == pytest.approx([0.1, math.radians(2.0)])
    said = mcl("eval", *words, "--truth-sd", "10cm,2deg").out.decode()
    assert "own standard deviations of 0.1 m and 2 deg were added" in said
    assert f"{100 * blurred['ellipse']:.1f} % inside the 95 % ellipse" in said


def test_several_tracks_are_summed_up(tmp_path: Path, files: tuple[Path, Path]) -> None:
    _, truth = files
    for seed in range(4):
        (tmp_path / f"seed{seed}.tum").write_text(as_tum(noisy(seed, count=400)[0]))
    found = facts(tmp_path / "seed*.tum", "--truth", truth)
    single = [track["ape"]["translation"]["rmse"] for track in found["tracks"]]
    assert [track["track"] for track in found["tracks"]] == [str(tmp_path / f"seed{s}.tum") for s in range(4)]
    spread = found["summary"]["ape_rmse"]
    assert spread["median"] == pytest.approx(np.median(single))
    assert spread["mean"] == pytest.approx(np.mean(single))
    assert spread["count"] == 4
    assert found == facts(tmp_path / "seed*.tum", "--truth", truth)
    other = facts(tmp_path / "seed*.tum", "--truth", truth, "--seed", 5)["summary"]["ape_rmse"]
    assert other["median"] == spread["median"]
    shown = mcl("eval", tmp_path / "seed*.tum", "--truth", truth).out.decode()
    assert "4 tracks against" in shown
    assert "ape_rmse [m]" in shown


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--max-ape", "5cm"), "(RMSE) is more than --max-ape 0.05 m"),
        (("--max-yaw", "1deg"), "is more than --max-yaw 1 deg"),
        (("--max-error", "0.1"), "largest error"),
        (("--min-within", "99%,5cm"), "--min-within asks for 99 %"),
    ],
)
def test_a_limit_missed_is_exit_4_with_one_line(
    files: tuple[Path, Path], words: tuple[str, str], complaint: str
) -> None:
    track, truth = files
    result = mcl("eval", track, "--truth", truth, *words)
    assert (result.code, b"APE, translation" in result.out) == (4, True)
    (line,) = result.err.splitlines()
    assert line.startswith(f"mcl: error: {track}: ")
    assert complaint in line
    assert facts(track, "--truth", truth, *words, code=4)["missed"][0]["track"] == str(track)


def test_limits_kept_are_exit_0(files: tuple[Path, Path]) -> None:
    track, truth = files
    words = ("--max-ape", "0.2", "--max-losses", 0, "--max-convergence", 1, "--min-coverage", "0.9")
    result = mcl("eval", track, "--truth", truth, *words)
    assert (result.code, result.err) == (0, "")


def test_little_coverage_is_warned_of(tmp_path: Path, files: tuple[Path, Path]) -> None:
    track, _ = files
    (tmp_path / "half.tum").write_text(as_tum(drive(np.arange(0.0, 50.0, 0.25))))
    result = mcl("eval", track, "--truth", tmp_path / "half.tum")
    assert result.code == 0
    assert "mcl: warning: " in result.err
    assert "the rest is unknown" in result.err


@pytest.mark.parametrize(("covered", "warned"), [(35, True), (36, False), (40, False)])
def test_less_than_nine_tenths_of_coverage_are_little(tmp_path: Path, covered: int, *, warned: bool) -> None:
    """Of 40 poses."""
    (tmp_path / "track.tum").write_text(as_tum(drive(np.arange(40.0))))
    (tmp_path / "truth.tum").write_text(as_tum(drive(np.arange(covered * 4.0 - 3.0) / 4.0)))
    result = mcl("eval", tmp_path / "track.tum", "--truth", tmp_path / "truth.tum")
    assert (result.code, "the rest is unknown" in result.err) == (0, warned)


def test_a_limit_missed_is_the_only_line_where_coverage_is_little_too(tmp_path: Path, files: tuple[Path, Path]) -> None:
    (tmp_path / "half.tum").write_text(as_tum(drive(np.arange(0.0, 50.0, 0.25))))
    result = mcl("eval", files[0], "--truth", tmp_path / "half.tum", "--min-coverage", "0.9")
    (line,) = result.err.splitlines()
    assert (result.code, "--min-coverage" in line) == (4, True)


def test_rules_can_be_changed(tmp_path: Path) -> None:
    reference = drive(np.arange(0.0, 60.0, 0.5))
    dx = np.where((np.arange(120) >= 40) & (np.arange(120) < 50), 0.8, 0.1)
    (tmp_path / "track.tum").write_text(as_tum(shifted(reference, dx)))
    (tmp_path / "truth.tum").write_text(as_tum(reference))
    words = (tmp_path / "track.tum", "--truth", tmp_path / "truth.tum")
    assert len(facts(*words)["tracks"][0]["losses"]) == 0
    assert len(facts(*words, "--lost", "0.6")["tracks"][0]["losses"]) == 1
    assert facts(*words, "--converged", "0.5,5deg,30")["tracks"][0]["converged_after"] == 25.0
    assert "tighter" in single_error(mcl("eval", *words, "--lost", "0.1"), 2)


def test_a_picture_shows_track_and_errors(tmp_path: Path, short_track: bytes) -> None:
    one, many = tmp_path / "one.png", tmp_path / "many.png"
    (tmp_path / "a.csv").write_bytes(short_track)
    assert mcl("eval", tmp_path / "a.csv", "--truth", TRUTH, "--map", OFFICE_MAP, "--picture", one).code == 0
    assert mcl("eval", *[tmp_path / "a.csv"] * 2, "--truth", TRUTH, "--picture", many).code == 0
    for path in (one, many):
        with Image.open(path) as picture:
            assert picture.height > 800
            assert len(picture.convert("RGB").getcolors(1 << 24) or []) > 10


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "track.tum: holds no pose"),
        ("# nothing\n\n", "track.tum: holds no pose"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n", "track.tum: is a KITTI file (12 numbers a row"),
        ("1 0 nan 0 0 0 0 1\n", "'nan' is not a finite number, line 1"),
        ("1 0 0 0 0 0 1\n", "7 fields instead of 8, line 1"),
        ("stamp,x,y\n1,2,3\n", "no column yaw in the header, line 1"),
        ("1 0 0 0 0 0 0 1\n", "track.tum: the reference covers no stamp of the track: the track is from @1.000"),
    ],
)
def test_bad_tracks_are_told_in_a_line(files: tuple[Path, Path], text: str, complaint: str) -> None:
    track, truth = files
    track.write_text(text)
    assert complaint in single_error(mcl("eval", track, "--truth", truth), 1)


def test_strict_refuses_what_is_set_right_without(files: tuple[Path, Path]) -> None:
    track, truth = files
    clean = facts(track, "--truth", truth)["tracks"][0]["ape"]
    rows = [row for row in truth.read_text().splitlines() if row and not row.startswith("#")]
    truth.write_text("\n".join([rows[0], rows[2], rows[1], rows[1], *rows[3:]]))
    done = mcl("eval", track, "--truth", truth, "--json")
    assert json.loads(done.out)["tracks"][0]["ape"] == clean
    assert f"{truth}: rows that are not in order of time: 2, first on line 3; sorted" in done.err
    assert f"{truth}: rows that have the stamp of an earlier one: 1, first on line 4; the first" in done.err
    error = single_error(mcl("eval", track, "--truth", truth, "--strict"), 1)
    assert "rows are not in order of time, first on line 3 (2 in all); sort the rows" in error
    single_error(mcl("eval", truth, "--truth", track, "--strict"), 1)
    truth.write_text("\n".join(rows))
    assert mcl("eval", track, "--truth", truth, "--strict").code == 0


def test_command_lines_that_make_no_sense(tmp_path: Path, files: tuple[Path, Path]) -> None:
    track, truth = files
    drawn = track.rename(tmp_path / "track.png")
    track.write_bytes(drawn.read_bytes())
    for words, complaint in (
        (("no*.tum", "--truth", truth), "no*.tum: no file matches"),
        ((track,), "Missing option '--truth'"),
        ((tmp_path / "none.csv", "--truth", truth), "no such file"),
        (("-", "-", "--truth", truth), "standard input can be read once only"),
        (("-", "--truth", "-"), "standard input holds the track already"),
        ((track, "--truth", truth, "--max-ape", "-1"), "--max-ape: -1 is negative"),
        ((track, "--truth", truth, "--min-coverage", "110%"), "--min-coverage: 110% is not a share"),
        ((track, "--truth", truth, "--min-within", "90%"), "needs a share and a distance"),
        ((track, "--truth", truth, "--truth-sd", "-3cm"), "--truth-sd: '-3cm' has a negative value"),
        ((track, "--truth", truth, "--truth-sd", "1,2,3"), "at most 2 are expected"),
        ((track, "--truth", truth, "--lost", "1,-3deg"), "has a negative value"),
        ((track, "--truth", truth, "--picture", track), "the name must end in .png, or be -"),
        ((drawn, "--truth", truth, "--picture", drawn), "the output is one of the inputs"),
        ((track, "--truth", truth, "--picture", tmp_path / "no" / "p.png"), "does not exist"),
        ((track, "--truth", f"{OFFICE}:/odm"), "did you mean '/odom'?"),
    ):
        assert complaint in single_error(mcl("eval", *words), 2)


# Agreement with evo (GPL), run as a program of its own


@pytest.fixture(name="evo_ape", scope="session")
def _evo_ape() -> str:
    program = os.environ.get("MCL_EVO") or shutil.which("evo_ape")
    if program is None:
        pytest.skip("needs evo_ape on PATH, or its path in MCL_EVO")
    return program


def evo(program: str, folder: Path, *words: object) -> dict[str, float]:
    """Statistics that evo saves."""
    result = folder / "evo.zip"
    result.unlink(missing_ok=True)
    command = [program, "tum", *map(str, words), "--save_results", str(result), "--no_warnings"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={"HOME": str(folder)})
    assert done.returncode == 0, done.stdout + done.stderr
    with zipfile.ZipFile(result) as archive:
        stats: dict[str, float] = json.loads(archive.read("stats.json"))
    return stats


def compared_with_evo(
    program: str, folder: Path, track: Path, truth: Path, limit: float, *, align: bool, within: float = 1e-6
) -> None:
    switches = ("--associate", "nearest", "--max-diff", limit, *(["--align"] if align else []))
    mine = facts(track, "--truth", truth, *switches)["tracks"][0]["ape"]
    for path in (truth, track):  # evo refuses empty lines
        (folder / f"{path.stem}.evo").write_text("\n".join(filter(None, path.read_text().splitlines())))
    files = (folder / f"{truth.stem}.evo", folder / f"{track.stem}.evo")
    common = (*files, "--t_max_diff", limit, *(["--align"] if align else []))
    translation = evo(program, folder, *common)
    yaw = evo(program, folder, *common, "--pose_relation", "angle_rad")
    for name in ("rmse", "mean", "median", "std", "min", "max"):
        assert mine["translation"][name] == pytest.approx(translation[name], abs=within)
        assert mine["yaw"][name] == pytest.approx(yaw[name], abs=within)


@pytest.mark.parametrize("limit", [0.01, 0.1])
def test_evo_says_the_same(evo_ape: str, tmp_path: Path, files: tuple[Path, Path], limit: float) -> None:
    for align in (False, True):
        compared_with_evo(evo_ape, tmp_path, *files, limit, align=align)


def test_evo_says_the_same_where_stamps_are_there_twice(evo_ape: str, tmp_path: Path) -> None:
    """A reference of a camera system: 100 Hz, stamps to four digits, some of them twice.

    Of two equal stamps just before a pose evo's binary search takes the later one; here it is the first.
    """
    rng = np.random.default_rng(5)
    times = 1311868163.8 + np.arange(3000) * 0.00998 + rng.uniform(0, 0.00005, 3000)
    times[100::250] = times[99:-1:250]
    yaws = 0.1 * (times - times[0])

    def rows(stamps: np.ndarray[tuple[int], np.dtype[np.float64]], digits: int, noise: float) -> str:
        picked = np.clip(np.searchsorted(times, stamps), 0, times.size - 1)
        x, y = np.stack([np.sin(yaws[picked]), 2 * np.cos(yaws[picked])]) + rng.normal(0, noise, (2, stamps.size))
        lines = zip(stamps, x, y, np.sin(yaws[picked] / 2), np.cos(yaws[picked] / 2), strict=True)
        return "\n".join(f"{t:.{digits}f} {a:.4f} {b:.4f} 0 0 0 {c:.4f} {d:.4f}" for t, a, b, c, d in lines)

    (tmp_path / "truth.tum").write_text("# ground truth\n" + rows(times, 4, 0.001))
    (tmp_path / "track.tum").write_text(rows(times[0] + np.arange(0.02, 29.0, 1 / 30), 6, 0.02))
    for align in (False, True):
        compared_with_evo(
            evo_ape, tmp_path, tmp_path / "track.tum", tmp_path / "truth.tum", 0.01, align=align, within=1e-5
        )


def test_evo_says_the_same_of_a_longer_reference(evo_ape: str, tmp_path: Path, files: tuple[Path, Path]) -> None:
    truth, track = files
    compared_with_evo(evo_ape, tmp_path, track, truth, 0.2, align=False)


@pytest.mark.real
def test_evo_says_the_same_of_a_real_drive(evo_ape: str, tmp_path: Path) -> None:
    truth = shared("intel/truth.tum")
    lines = truth.read_text().splitlines()
    (tmp_path / "thin.tum").write_text("\n".join(lines[::3]) + "\n")
    compared_with_evo(evo_ape, tmp_path, truth, tmp_path / "thin.tum", 2.0, align=False)
