"""``mcl run``: which topic and frame plays which part, files that are something else, and hostile names."""

from __future__ import annotations

import dataclasses
import unicodedata
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.cli.support import (
    OFFICE,
    OFFICE_MAP,
    REFERENCE_MAP,
    ROOT,
    SAMPLES,
    START_NS,
    Message,
    Table,
    decoded,
    edited,
    error_against,
    mcl,
    single_error,
    without,
    write_mcap,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.cli.conftest import Runner

MOUNT = "laser=0.14,-0.04,0.35"
HOSTILE_TOPIC = "/a\x1b[31m\x07\r\n\x9b2J\u202eb[link=x]"
HOSTILE_FRAME = "las\x1b]0;owned\x07\x7fer"
ODD = {"Cc", "Cf"}  # categories of characters that a terminal may act upon

# Transforms and roles


def test_no_transform_for_the_lidar(
    run_short: Runner, office_messages: list[Message], short_track: bytes, tmp_path: Path
) -> None:
    log = write_mcap(tmp_path / "log.mcap", without(office_messages, "/tf_static"))
    message = single_error(run_short(log=log), 1)
    assert message.startswith("/scan: no transform from 'base_footprint' to 'laser'; frames in the log: ")
    assert "base_footprint" in message.split("frames in the log: ")[1]
    assert "give --mount laser=X,Y,YAW" in message
    # the mount in the log has a quaternion of rounded numbers: the same but for the last digits
    given = run_short("--mount", MOUNT, log=log)
    assert given.code == 0
    np.testing.assert_allclose(given.table["x"], Table(short_track.decode())["x"], rtol=0, atol=1e-3)
    for_any = run_short("--mount", MOUNT.removeprefix("laser="), log=log)
    assert for_any.out == given.out


def test_a_mount_overrules_the_log(run_short: Runner, short_track: bytes) -> None:
    turned = run_short("--mount", "laser=0.14,-0.04,3.49")
    assert turned.code == 0
    assert error_against(turned.table, SAMPLES / "office.truth.tum") > 0.3
    assert turned.out != short_track


def test_a_static_transform_holds_wherever_it_stands(
    run_short: Runner, office_messages: list[Message], short_track: bytes, tmp_path: Path
) -> None:
    static = [dataclasses.replace(m, log_ns=START_NS + 11 * 10**9) for m in office_messages if m.topic == "/tf_static"]
    log = write_mcap(tmp_path / "log.mcap", [*without(office_messages, "/tf_static"), *static])
    assert run_short(log=log).out == short_track


def test_a_log_without_a_scan(run_short: Runner, office_messages: list[Message], tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "log.mcap", without(office_messages, "/scan", "/landmarks"))
    assert "no laser scan" in single_error(run_short(log=log), 1)


def test_a_log_without_odometry(run_short: Runner, office_messages: list[Message], tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "log.mcap", without(office_messages, "/odom", "/tf"))
    assert "no odometry" in single_error(run_short(log=log), 1)


def test_a_log_without_messages(run_short: Runner, tmp_path: Path) -> None:
    single_error(run_short(log=write_mcap(tmp_path / "log.mcap", []), init="0,0,0"), 1)


@pytest.mark.parametrize(
    ("option", "topic"), [("--scan", "/nowhere"), ("--odom", "/elsewhere"), ("--scan", "/scam"), ("--odom", "odm")]
)
def test_a_topic_that_the_log_does_not_have(run_short: Runner, option: str, topic: str) -> None:
    message = single_error(run_short(option, topic), 2)
    assert message.startswith(f"no topic '{topic}' in the log")
    for name in ("/ground_truth", "/initialpose", "/landmarks", "/odom", "/scan", "/tf", "/tf_static"):
        assert name in message


@pytest.mark.parametrize(("option", "topic"), [("--scan", "/odom"), ("--odom", "/scan"), ("--odom", "/tf")])
def test_a_topic_of_another_type(run_short: Runner, option: str, topic: str) -> None:
    assert f"topic '{topic}'" in single_error(run_short(option, topic), 2)


@pytest.mark.parametrize(
    ("words", "option", "endings"),
    [
        (("dt", OFFICE_MAP), "--png", ".png"),
        (("dt", OFFICE_MAP), "-o", ".npy"),
        (("score", OFFICE, "--map", OFFICE_MAP, "--pose", "0,0,0"), "--heatmap", ".png"),
        (("score", OFFICE, "--map", OFFICE_MAP, "--pose", "0,0,0", "--explain"), "--picture", ".png"),
        (("score", OFFICE, "--map", OFFICE_MAP, "--pose", "0,0,0"), "-o", ".csv or .mcap"),
        (("locate", OFFICE, "--map", OFFICE_MAP), "--picture", ".png"),
    ],
)
def test_outputs_named_as_something_else_are_refused(
    tmp_path: Path, words: tuple[object, ...], option: str, endings: str
) -> None:
    kept = tmp_path / "notes.txt"
    kept.write_text("mine")
    assert f"{option} {kept}: the name must end in {endings}, or be -" in single_error(mcl(*words, option, kept), 2)
    assert kept.read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        ("run", "{log}", "--map", OFFICE_MAP, "--init", "/initialpose"),
        ("locate", "{log}", "--map", OFFICE_MAP),
        ("score", "{log}", "--map", OFFICE_MAP, "--pose", "0,0,0"),
        ("extract", "{log}"),
    ],
    ids=lambda words: words[0],
)
def test_a_mount_of_a_frame_that_the_log_does_not_have(short: Path, words: tuple[object, ...]) -> None:
    command = [short if word == "{log}" else word for word in words]
    error = single_error(mcl(*command, "--mount", "lasser=0,0,0"), 2)
    assert error.startswith("--mount lasser: the log has no such frame; did you mean 'laser'?; it has base_footprint")
    assert mcl(*command, "--mount", "/laser=0,0,0").code in {0, 5}


def test_vision_needs_landmarks(run_short: Runner, short: Path) -> None:
    assert "--landmarks" in single_error(run_short("--vision", "/landmarks"), 2)
    assert "--map" in single_error(mcl("run", short, "--init", "0,0,0"), 1)


# Files that are something else


def test_files_that_are_something_else(run_short: Runner, tmp_path: Path) -> None:
    assert "is not a log" in single_error(run_short(log=ROOT / "README.md"), 1)
    assert "no such file" in single_error(run_short(log=tmp_path / "none.mcap"), 2)
    (tmp_path / "empty.mcap").write_bytes(b"")
    assert "empty" in single_error(run_short(log=tmp_path / "empty.mcap"), 1)
    assert "no such file" in single_error(run_short("--map", tmp_path / "none.yaml"), 2)
    assert "README.md" in single_error(run_short("--map", ROOT / "README.md"), 1)
    assert "LICENSE" in single_error(run_short("--landmarks", ROOT / "LICENSE"), 1)
    single_error(run_short("--truth", tmp_path / "none.tum"), 2)


def test_a_map_of_somewhere_else_does_not_hold_the_start(run_short: Runner) -> None:
    assert "lies off the map" in single_error(run_short("--map", REFERENCE_MAP, init="-7.4,1.6,0"), 2)


# Names that want to be read by a terminal


def is_clean(text: str) -> bool:
    return not [letter for letter in text if unicodedata.category(letter) in ODD and letter != "\n"]


@pytest.fixture(scope="module")
def hostile(office_messages: list[Message], tmp_path_factory: pytest.TempPathFactory) -> Path:
    def reframe(scan: Any) -> None:
        scan.header.frame_id = HOSTILE_FRAME

    def renamed(message: Message) -> Message:
        return edited(dataclasses.replace(message, topic=HOSTILE_TOPIC), reframe)

    contents = [renamed(m) if m.topic == "/scan" else m for m in office_messages]
    return write_mcap(tmp_path_factory.mktemp("hostile") / "log.mcap", contents)


CALLS: dict[str, Callable[[Path], tuple[object, ...]]] = {
    "info": lambda log: ("info", log),
    "json": lambda log: ("info", log, "--json"),
    "extract": lambda log: ("extract", log),
    "extract another": lambda log: ("extract", log, "--topic", "/none"),
    "score": lambda log: ("score", log, "--map", OFFICE_MAP, "--pose", "0,0,0"),
    "run": lambda log: ("run", log, "--map", OFFICE_MAP, "--init", "/initialpose"),
    "run another": lambda log: ("run", log, "--map", OFFICE_MAP, "--scan", "/none"),
    "run mounted": lambda log: (
        "run",
        log,
        "--map",
        OFFICE_MAP,
        "--init",
        "/initialpose",
        "--mount",
        "0.14,-0.04,0.35",
    ),
    "tally": lambda log: ("run", log, "--map", OFFICE_MAP, "--mount", "0,0,0", "--start", "99"),
}


@pytest.mark.parametrize("name", CALLS)
def test_names_of_topics_and_frames_never_reach_the_terminal_raw(hostile: Path, name: str) -> None:
    result = mcl(*CALLS[name](hostile))
    assert result.code in {0, 1, 2}
    assert is_clean(result.err)
    assert is_clean(result.out.decode())
    assert all(line.startswith("mcl: ") for line in result.err.splitlines())


def test_a_hostile_name_can_still_be_read(hostile: Path) -> None:
    assert "\\x1b[31m\\x07\\x0d\\x0a" in mcl("info", hostile).out.decode()
    assert "[link=x]" in mcl("info", hostile).out.decode()


def test_stamps_of_the_short_log_are_what_the_tests_think(office_messages: list[Message]) -> None:
    first = next(m for m in office_messages if m.topic == "/scan")
    assert decoded(first).header.stamp.sec * 10**9 == START_NS
