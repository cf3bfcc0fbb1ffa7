"""``mcl run --versus``: since when a run and the robot's own belief are apart."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.io.recording.recorded_poses import read_trajectory
from tests.cli.support import OFFICE, SAMPLES, START_NS, mcl, single_error, write_mcap
from tests.io.test_recorded_poses import pose_message, tf_message

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner
    from tests.cli.support import Message

PARTS_AT = 6.0  # seconds into the log at which the robot's own belief leaves
APART = re.compile(r"first apart at 2024-05-14 14:30:(\d\d\.\d{3}) UTC \((\d+\.\d) s into the log\) to the end")


def beliefs() -> list[Message]:
    """/amcl_pose every second along the truth, 2 m off from some moment on."""
    truth = read_trajectory(f"{OFFICE}:/ground_truth")
    seconds = np.arange(0.0, 12.0)
    poses, covered = truth.at(START_NS + np.round(seconds * 1e9).astype(np.int64), 10**9)
    contents = []
    for s, (x, y, yaw), known in zip(seconds.tolist(), poses.tolist(), covered.tolist(), strict=True):
        if known:
            off = 2.0 if s >= PARTS_AT else 0.0
            contents.append(pose_message(s, x + off, 0.01, y, yaw))
    return contents


@pytest.fixture(name="logged", scope="module")
def _logged(office_messages: list[Message], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The short log with the robot's own localization in it."""
    both = sorted([*office_messages, *beliefs()], key=lambda message: message.log_ns)
    return write_mcap(tmp_path_factory.mktemp("versus") / "logged.mcap", both)


def test_the_moment_of_parting_is_told_by_the_clock(logged: Path, run_short: Runner, tmp_path: Path) -> None:
    picture = tmp_path / "p.png"
    result = run_short("--versus", "/amcl_pose", "--picture", picture, log=logged)
    assert result.code == 0
    found = APART.search(result.err)
    assert found is not None, result.err
    assert PARTS_AT <= float(found[2]) <= PARTS_AT + 0.3
    assert float(found[1]) == pytest.approx(float(found[2]), abs=0.06)
    with Image.open(picture) as drawn:
        assert drawn.height > 800


def test_the_track_is_the_same_with_and_without(logged: Path, run_short: Runner) -> None:
    words = ("--track", "-")
    alone = run_short(*words, log=logged)
    assert run_short(*words, "--versus", "/amcl_pose", "--truth", "/ground_truth", log=logged).out == alone.out
    assert run_short(*words, "--versus", "tf:odom", log=logged).code == 1  # the odometry's own frame never moves in it


def test_a_stream_is_compared_as_well(logged: Path, run_short: Runner) -> None:
    words = ("--versus", "/amcl_pose", "--truth", "/ground_truth")
    from_file = run_short(*words, log=logged).err
    from_pipe = run_short(*words, log="-", stdin=logged.read_bytes()).err
    wanted = [line for line in from_file.splitlines() if "versus" in line or "reference" in line]
    assert len(wanted) == 4
    assert [line for line in from_pipe.splitlines() if "versus" in line or "reference" in line] == wanted


def test_a_recorded_transform_is_composed_with_odometry(
    office_messages: list[Message], run_short: Runner, tmp_path: Path
) -> None:
    moving = [tf_message(0.1 * i, "map", "odom", 0.001 * i, late=0.1) for i in range(118)]
    log = write_mcap(tmp_path / "tf.mcap", sorted([*office_messages, *moving], key=lambda message: message.log_ns))
    result = run_short("--versus", "tf:map", "--truth", SAMPLES / "office.truth.tum", log=log)
    assert result.code == 0
    told = re.search(r"versus tf:map: (\d+\.\d+) m, \d+\.\d+° apart", result.err)
    assert told is not None
    track = mcl("eval", "-", "--truth", f"{log}:tf:map", "--json", stdin=run_short(log=log).out)
    same = json.loads(track.out)["tracks"][0]["ape"]["translation"]["rmse"]
    assert float(told[1]) == pytest.approx(same, abs=2e-3)  # there from the odometry topic, here from transforms
    assert "what the robot believed, against the reference: RMSE" in result.err


@pytest.mark.parametrize(
    ("source", "code", "complaint"),
    [
        ("/amcl_pse", 2, "no topic '/amcl_pse' in the log; did you mean '/amcl_pose'?"),
        ("/scan", 2, "states no poses"),
        ("tf:map", 2, "no transform joins 'map' and 'odom'; frames in the log"),
    ],
)
def test_what_states_no_belief_is_refused_before_the_run(
    logged: Path, run_short: Runner, source: str, code: int, complaint: str
) -> None:
    assert complaint in single_error(run_short("--versus", source, log=logged), code)


def test_a_belief_that_agrees_is_never_apart(office_messages: list[Message], run_short: Runner, tmp_path: Path) -> None:
    calm = [message for message in beliefs() if message.log_ns < START_NS + PARTS_AT * 1e9]
    both = sorted([*office_messages, *calm], key=lambda message: message.log_ns)
    result = run_short("--versus", "/amcl_pose", log=write_mcap(tmp_path / "calm.mcap", both))
    assert "versus /amcl_pose: never apart (over 0.5 m or 10° for at least 2 s)" in result.err
