"""mcl as a process among others: pipes, signals, full disks, and what is left behind."""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import IO, TYPE_CHECKING, cast

import pytest

from mclcli.version import __version__
from tests.cli.support import (
    ENTRY,
    OFFICE,
    OFFICE_MAP,
    SAMPLES,
    finish,
    mcl,
    messages,
    process,
    single_error,
)

if TYPE_CHECKING:
    from tests.cli.conftest import Runner

WORDS = ("--map", OFFICE_MAP, "--init", "/initialpose", "--particles", 300)
INTERRUPTS = [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_process_gives_the_bytes_that_a_call_gives(short: Path, short_track: bytes) -> None:
    result = finish(process("run", short, *WORDS))
    assert (result.code, result.out) == (0, short_track)


def test_extract_piped_into_score(short: Path) -> None:
    pose = ("--map", OFFICE_MAP, "--pose", "-7.4,1.6,-85deg")
    first = process("extract", short, "--index", 7)
    second = process("score", "-", *pose, stdin=first.stdout)
    scored = finish(second)
    assert finish(first).code == 0
    assert scored.code == 0
    assert scored.out == mcl("score", short, "--index", 7, *pose).out


@pytest.mark.parametrize("output", ["-o", "--track", "--steps"])
def test_a_closed_pipe_ends_it_in_silence(short: Path, output: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    started = process("run", short, *WORDS, output, "-", stdout=writer)
    os.close(writer)
    result = finish(started)
    assert (result.code, result.err) == (141, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("option", ["-o", "--track", "--steps"])
def test_a_full_device(run_short: Runner, option: str) -> None:
    message = single_error(run_short(option, "/dev/full"), 1)
    assert message.startswith("/dev/full: cannot write: No space left on device")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_stdout() -> None:
    """Every command: ``test_streams.py``."""
    with Path("/dev/full").open("wb") as full:
        result = finish(process("params", stdout=full))
    assert result.code == 1
    assert "No space left on device" in result.err


def limited(kibibytes: int, *words: object) -> subprocess.CompletedProcess[bytes]:
    """Run mcl where no file may grow beyond a size, as on a full disk."""
    command = [sys.executable, "-c", ENTRY, *map(str, words)]
    shell = ["bash", "-c", f'ulimit -f {kibibytes}; exec "$@"', "bash", *command]
    return subprocess.run(shell, capture_output=True, check=False)


@pytest.mark.parametrize(("option", "name"), [("-o", "trace.csv"), ("-o", "trace.mcap"), ("-o", "trace.csv.gz")])
def test_a_full_disk_leaves_nothing_under_the_name(short: Path, tmp_path: Path, option: str, name: str) -> None:
    mcl("run", short, *WORDS)  # the field and the kernels are in the cache from here on
    result = limited(16, "run", short, *WORDS, option, tmp_path / name, "--track", tmp_path / "track.csv")
    assert result.returncode == 1, result.stderr
    assert f"{tmp_path / name}: cannot write: " in result.stderr.decode()
    assert "Traceback" not in result.stderr.decode()
    assert names(tmp_path) == []


def test_a_full_disk_keeps_what_was_there_before(short: Path, tmp_path: Path) -> None:
    (tmp_path / "trace.csv").write_text("older")
    assert limited(16, "run", short, *WORDS, "-o", tmp_path / "trace.csv").returncode == 1
    assert (tmp_path / "trace.csv").read_text() == "older"
    assert names(tmp_path) == ["trace.csv"]


@pytest.mark.skipif(not Path("/sys").is_dir() or os.access("/sys/kernel/nothing", os.F_OK), reason="needs Linux")
def test_a_folder_that_nobody_may_write_to(run_short: Runner) -> None:
    assert "cannot write" in single_error(run_short("--track", "/sys/track.csv"), 1)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--track", "-", "--steps", "-"), "only one output can go to stdout"),
        (("-o", "-", "--track", "-"), "only one output can go to stdout"),
        (("--track", "a.csv", "-o", "a.csv"), "a.csv: named for two outputs"),
        (("--track", "a.txt"), "must end in .csv or .tum"),
        (("-o", "a.tum"), "must end in .csv or .csv.gz or .mcap or .parquet"),
        (("--steps", "a.json"), "must end in .csv"),
        (("--picture", "a.csv"), "--picture a.csv: the name must end in .png, or be -"),
        (("--track", "none/a.csv"), "does not exist"),
        (("--track", ""), "--track"),
    ],
)
def test_outputs_that_are_refused(
    run_short: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in single_error(run_short(*words), 2)
    assert names(tmp_path) == []


def test_an_output_that_is_an_input(short: Path, tmp_path: Path) -> None:
    log = Path(shutil.copy(short, tmp_path / "log.mcap"))
    (tmp_path / "link.mcap").symlink_to(log)
    (tmp_path / "hard.mcap").hardlink_to(log)
    digest = hashlib.sha256(log.read_bytes()).hexdigest()
    for name in ("log.mcap", "link.mcap", "hard.mcap"):
        result = mcl("run", log, *WORDS, "-o", tmp_path / name)
        assert "the output is one of the inputs" in single_error(result, 2)
    assert hashlib.sha256(log.read_bytes()).hexdigest() == digest
    assert names(tmp_path) == ["hard.mcap", "link.mcap", "log.mcap"]


@pytest.mark.parametrize("option", ["--picture", "--truth", "--init"])
def test_a_reference_or_start_is_an_input_too(short: Path, tmp_path: Path, option: str) -> None:
    """What --truth and --init name is read, so it is not to be written over; a picture is no input."""
    name = "truth.png" if option == "--picture" else "truth.tum"
    truth = Path(shutil.copy(SAMPLES / "office.truth.tum", tmp_path / name))
    before = truth.read_bytes()
    if option == "--picture":
        result = mcl("run", short, *WORDS, "--picture", truth, "--track", tmp_path / "t.csv", "--truth", truth)
    else:
        result = mcl("run", short, *WORDS, option, truth, "--track", truth)
    assert "the output is one of the inputs" in single_error(result, 2)
    assert truth.read_bytes() == before


@pytest.mark.parametrize(("number", "code"), INTERRUPTS)
def test_an_interrupted_run_keeps_its_mcap(tmp_path: Path, number: signal.Signals, code: int) -> None:
    """The stream is held open, so that the run waits for more when the signal comes."""
    words = ("-o", tmp_path / "trace.mcap", "-o", tmp_path / "trace.csv", "--track", "-")
    started = process("run", "-", *WORDS, *words, stdin=subprocess.PIPE)
    stdin, stdout = cast("IO[bytes]", started.stdin), cast("IO[bytes]", started.stdout)
    raw = OFFICE.read_bytes()
    stdin.write(raw[: len(raw) // 2])
    stdin.flush()
    head = stdout.readline() + stdout.readline()  # rows come: the outputs are open, and updates written
    started.send_signal(number)
    out, err = stdout.read(), cast("IO[bytes]", started.stderr).read().decode()
    stdin.close()
    stdout.close()
    cast("IO[bytes]", started.stderr).close()
    assert started.wait() == code
    assert names(tmp_path) == ["trace.mcap.part"]
    assert "trace.mcap.part" in err
    assert "Traceback" not in err
    kept = messages(tmp_path / "trace.mcap.part")
    steps = [message for message in kept if message.topic == "/mcl/step"]
    assert len(steps) > 3
    assert (head + out).startswith(b"stamp,x,y,yaw,")
    assert (head + out).endswith(b"\n")


def test_an_interrupt_before_anything_is_written_leaves_nothing(tmp_path: Path) -> None:
    started = process("run", "-", *WORDS, "--track", tmp_path / "track.csv", stdin=subprocess.PIPE)
    stdin = cast("IO[bytes]", started.stdin)
    raw = OFFICE.read_bytes()
    stdin.write(raw[: len(raw) // 2])  # returns only once most of it was read
    stdin.flush()
    started.send_signal(signal.SIGTERM)
    result = finish(started)
    assert result.code == 143
    assert names(tmp_path) == []
    assert "Traceback" not in result.err


def test_an_output_that_cannot_be_opened_leaves_none_of_the_others(short: Path, tmp_path: Path) -> None:
    words = ("-o", tmp_path / "trace.mcap", "--track", tmp_path / "none" / "track.csv")
    assert "does not exist" in single_error(mcl("run", short, *WORDS, *words), 2)
    assert names(tmp_path) == []


def test_an_interrupt_before_anything_is_recovered_leaves_nothing(tmp_path: Path) -> None:
    started = process("recover", "-", "-o", tmp_path / "good.mcap", stdin=subprocess.PIPE)
    stdin = cast("IO[bytes]", started.stdin)
    stdin.write(OFFICE.read_bytes()[:4000])
    stdin.flush()
    while not names(tmp_path):
        time.sleep(0.01)
    started.send_signal(signal.SIGINT)
    result = finish(started)
    assert (result.code, result.err) == (130, "")
    assert names(tmp_path) == []


def test_a_picture_holds_no_clock(short: Path, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        assert mcl("run", short, *WORDS, "--picture", tmp_path / name, "--track", tmp_path / "t.csv").code == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_closed_stdout() -> None:
    """Every command: ``test_streams.py``."""
    shell = ["bash", "-c", 'exec "$@" >&-', "bash", sys.executable, "-c", ENTRY]
    done = subprocess.run([*shell, "params"], capture_output=True, check=False)
    assert done.returncode == 1
    assert "closed" in done.stderr.decode()


def test_an_installed_script_finds_the_program() -> None:
    script = shutil.which("mcl", path=str(Path(sys.executable).parent))
    if script is None:
        pytest.skip("mcl is not installed beside this Python")
    done = subprocess.run([script, "--version"], capture_output=True, check=True)
    assert __version__ in done.stdout.decode()


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("", 70)])
def test_a_signal_that_an_import_swallows_is_still_a_signal(name: str, code: int) -> None:
    """NumPy makes an ImportError of whatever its import meets; without a signal that is a bug to be reported."""
    program = f"""
import os, signal, sys
import click
from mclcli import startup
from mclcli.cli.process import run

@click.group()
def group(): pass

@group.command()
def work():
    try:
        if {name!r}:
            os.kill(os.getpid(), getattr(signal, {name!r} or "SIGINT"))
            signal.pthread_sigmask(signal.SIG_BLOCK, ())
    except BaseException:
        pass
    raise ImportError("_multiarray_umath failed to import")

startup.secure_streams()
sys.exit(run(group, ["work"]))
"""
    signals = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    done = subprocess.run([sys.executable, "-c", signals + program], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert ("internal error" in done.stderr) == (not name)
