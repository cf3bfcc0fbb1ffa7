from __future__ import annotations

import gzip
import io
import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from mclcli.errors import InputError, UsageError
from mclcli.io.traces.output import Output, open_output
from mclcli.io.traces.sinks import stamp_text

if TYPE_CHECKING:
    from collections.abc import Callable


def _write(target: str | Path, data: str | bytes = "a\nb\n", *, inputs: tuple[Path, ...] = ()) -> None:
    with open_output(target, binary=isinstance(data, bytes), inputs=inputs) as out:
        out.write(data)


def _fail(target: Path, error: type[BaseException], *, keep_part: bool = False) -> Output:
    out = open_output(target, binary=False)

    def interrupted() -> None:
        with out:
            out.write("half a")
            if keep_part:
                out.allow_part()
            raise error

    with pytest.raises(error):
        interrupted()
    return out


def test_the_name_appears_only_when_the_block_ends(tmp_path: Path) -> None:
    target = tmp_path / "track.csv"
    with open_output(target, binary=False) as out:
        out.write("x\n")
        out.flush()
        assert not target.exists()
        assert [p.read_text() for p in tmp_path.iterdir()] == ["x\n"]  # nothing is lost to a KILL now
    assert target.read_bytes() == b"x\n"
    assert out.kept == target
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("error", [InputError, KeyboardInterrupt, SystemExit, BrokenPipeError])
def test_an_exception_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "track.csv"
    target.write_text("old")
    assert _fail(target, error).kept is None
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_interrupt_keeps_a_part_if_asked(tmp_path: Path) -> None:
    target = tmp_path / "trace.mcap"
    out = _fail(target, KeyboardInterrupt, keep_part=True)
    assert out.kept == tmp_path / "trace.mcap.part"
    assert out.kept.read_text() == "half a"
    assert list(tmp_path.iterdir()) == [out.kept]
    out.kept.unlink()
    assert _fail(target, InputError, keep_part=True).kept is None
    assert list(tmp_path.iterdir()) == []


def test_a_part_never_replaces_a_file(tmp_path: Path) -> None:
    target = tmp_path / "trace.mcap"
    (tmp_path / "trace.mcap.part").write_text("the user's")
    (tmp_path / "trace.mcap.1.part").symlink_to(tmp_path / "nowhere")
    out = _fail(target, SystemExit, keep_part=True)
    assert out.kept == tmp_path / "trace.mcap.2.part"
    assert out.kept.read_text() == "half a"
    assert (tmp_path / "trace.mcap.part").read_text() == "the user's"
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("letter", ["n", "é"])
def test_a_long_name_has_a_part_as_well(tmp_path: Path, letter: str) -> None:
    name = letter * (255 // len(letter.encode()))
    first, second = (_fail(tmp_path / name, KeyboardInterrupt, keep_part=True).kept for _ in range(2))
    assert first is not None
    assert second is not None
    assert first != second
    assert first.name.endswith(".part")


def test_symlinks_stay_and_their_target_is_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "far"
    folder.mkdir()
    link = tmp_path / "link.csv"
    link.symlink_to(folder / "real.csv")
    _write(link)
    assert link.is_symlink()
    assert (folder / "real.csv").read_text() == "a\nb\n"
    assert [p.name for p in folder.iterdir()] == ["real.csv"]


def test_modes_are_those_of_a_plain_open(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        _write(tmp_path / "new.csv")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "new.csv").stat().st_mode) == 0o640
    (tmp_path / "new.csv").chmod(0o604)
    _write(tmp_path / "new.csv")
    assert stat.S_IMODE((tmp_path / "new.csv").stat().st_mode) == 0o604


def test_gzip_text_has_no_clock_and_no_name(tmp_path: Path) -> None:
    _write(tmp_path / "one.csv.gz")
    _write(tmp_path / "two.csv.gz")
    raw = (tmp_path / "one.csv.gz").read_bytes()
    assert gzip.decompress(raw) == b"a\nb\n"
    assert raw == (tmp_path / "two.csv.gz").read_bytes()
    assert raw[3] == 0  # flags: no name
    assert raw[4:8] == bytes(4)  # time
    _write(tmp_path / "odd.gz", b"not text")
    assert (tmp_path / "odd.gz").read_bytes() == b"not text"


def test_a_pipe_is_written_directly(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    with subprocess.Popen(["/bin/cat", fifo], stdout=subprocess.PIPE) as reader:
        _write(fifo, b"bytes")
        assert reader.stdout is not None
        assert reader.stdout.read() == b"bytes"
    assert stat.S_ISFIFO(fifo.stat().st_mode)


def test_a_reader_that_left_is_a_broken_pipe(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)

    def write_on() -> None:
        with open_output(fifo, binary=False) as out:
            os.close(reader)
            out.write("x" * 200_000)

    with pytest.raises(BrokenPipeError):
        write_on()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_device_is_one_line() -> None:
    with pytest.raises(InputError, match=r"^/dev/full: cannot write: No space left on device; what was written is"):
        _write("/dev/full", "x")


class _Full(io.RawIOBase):
    """A disk that takes ``room`` bytes."""

    def __init__(self, room: int) -> None:
        self.room = room

    def writable(self) -> bool:
        return True

    def write(self, data: object, /) -> int:
        size = len(memoryview(data))  # type: ignore[arg-type]
        if size > self.room:
            raise OSError(28, "No space left on device")
        self.room -= size
        return size


@pytest.mark.parametrize("room", [0, 1, 100_000, 250_000])
def test_a_full_disk_keeps_nothing(tmp_path: Path, room: int, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "trace.csv"
    target.write_text("old")
    real_open: Callable[..., object] = open

    def fake_open(*args: object, **kwargs: object) -> object:
        real_open(*args, **kwargs).close()  # type: ignore[attr-defined]
        return io.BufferedWriter(_Full(room))

    monkeypatch.setattr("builtins.open", fake_open)
    with pytest.raises(InputError, match=r"trace.csv: cannot write: No space left on device; nothing was kept$"):
        _write(target, "x" * 300_000)
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == [target]
    assert target.read_text() == "old"


def test_an_input_is_never_the_output(tmp_path: Path) -> None:
    log, hard, soft = tmp_path / "log.mcap", tmp_path / "hard.mcap", tmp_path / "soft.mcap"
    log.write_bytes(b"log")
    hard.hardlink_to(log)
    soft.symlink_to(log)
    for target in (log, hard, soft):
        with pytest.raises(UsageError, match="is one of the inputs"):
            open_output(target, binary=True, inputs=[log])
    with pytest.raises(UsageError, match="is one of the inputs"):
        open_output(log, binary=True, inputs=[tmp_path])
    _write(tmp_path / "other.mcap", b"x", inputs=(log,))
    assert log.read_bytes() == b"log"


def test_unusable_targets_are_usage_errors(tmp_path: Path) -> None:
    targets: list[tuple[str | Path, str]] = [
        (tmp_path / "none" / "t.csv", r"t.csv: folder .*none does not exist; create it"),
        (tmp_path, "is a folder; name a file in it"),
        ("", "name is empty"),
        ("a\0b", "not a usable name"),
    ]
    for target, message in targets:
        with pytest.raises(UsageError, match=message):
            open_output(target, binary=False)


def test_a_long_name_leaves_room_for_the_suffix(tmp_path: Path) -> None:
    target = tmp_path / ("ö" * 125 + ".csv")
    _write(target)
    assert target.read_text() == "a\nb\n"


def test_standard_output(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    _write("-", "°\n")
    _write("-", b"\xff")
    assert capfdbinary.readouterr().out == "°\n".encode() + b"\xff"
    assert not sys.stdout.closed


def test_closed_standard_output_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    with pytest.raises(InputError, match="standard output: cannot write"):
        open_output("-", binary=False)


def test_keep_may_come_first(tmp_path: Path) -> None:
    with open_output(tmp_path / "t.mcap", binary=True) as out:
        out.write(b"x")
        assert out.keep(as_part=True) == tmp_path / "t.mcap.part"
        with pytest.raises(ValueError, match="closed"):
            out.write(b"y")
    assert [p.name for p in tmp_path.iterdir()] == ["t.mcap.part"]


@pytest.mark.parametrize(
    ("stamp_ns", "text"),
    [
        (0, "0.000000000"),
        (1_318_384_871_000_000_001, "1318384871.000000001"),
        (-1, "-0.000000001"),
        (-1_500_000_000, "-1.500000000"),
        (2**63 - 1, "9223372036.854775807"),
    ],
)
def test_stamps_are_exact(stamp_ns: int, text: str) -> None:
    assert stamp_text(stamp_ns) == text


def test_an_interrupt_while_a_file_is_made_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = os.open

    def interrupted(*words: Any, **options: Any) -> int:
        os.close(made(*words, **options))
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "open", interrupted)
    with pytest.raises(KeyboardInterrupt), open_output(tmp_path / "a.csv", binary=False):
        pass
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == []
