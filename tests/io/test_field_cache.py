"""Distance fields on disk: right or computed again, whatever happened to the file."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np
import pytest

from mclcli.io.maps.field_cache import cached_field, field_path
from mclcli.world import FieldMethod, distance_field
from mclcli.world.distance_field import DistanceField
from tests import processes
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.world.distance_field import DistanceField

GRID = drawn("#.......\n........\n...#....\n........", 0.25, (1.0, 2.0, 0.3))
REACH = 1.5
TRUE = {method: distance_field.compute(GRID, method, REACH) for method in get_args(FieldMethod)}


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "cache"))


@pytest.fixture
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that write hundreds of files and pull no plug."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


def right(field: DistanceField, method: FieldMethod = "exact") -> bool:
    """Whether a field is the one computed afresh, and placed like it."""
    true = TRUE[method]
    same = np.array_equal(field.codes, true.codes) and np.array_equal(field.levels, true.levels)
    return same and field.resolution == true.resolution and np.array_equal(field.origin, true.origin)


def fill() -> Path:
    cached_field(GRID, "exact", REACH)
    return field_path(GRID, "exact", REACH)


@pytest.mark.parametrize("method", get_args(FieldMethod))
def test_a_hit_follows_a_miss(method: FieldMethod) -> None:
    first, hit_first = cached_field(GRID, method, REACH)
    second, hit_second = cached_field(GRID, method, REACH)
    assert (hit_first, hit_second) == (False, True)
    assert right(first, method)
    assert right(second, method)
    assert not second.codes.flags.writeable
    assert not second.levels.flags.writeable


def test_another_map_method_or_clamp_is_another_file() -> None:
    other = drawn("#.......\n........\n...#....\n.......#", 0.25, (1.0, 2.0, 0.3))
    moved = drawn("#.......\n........\n...#....\n........", 0.25, (1.0, 2.0, 0.4))
    paths = {
        field_path(GRID, "exact", REACH),
        field_path(GRID, "brushfire", REACH),
        field_path(GRID, "exact", 1.6),
        field_path(other, "exact", REACH),
        field_path(moved, "exact", REACH),
    }
    assert len(paths) == 5


@pytest.mark.usefixtures("_quick")
def test_any_byte_of_the_header_changed_never_gives_a_wrong_field() -> None:
    path = fill()
    whole = path.read_bytes()
    header_end = whole.index(b"\n", whole.index(b"\n") + 1) + 1
    header = json.loads(whole.splitlines()[1])
    blanks = range(whole.index(b"}") + 1, header_end, 40)
    for position in (*range(whole.index(b"}") + 1), *blanks, header_end - 1):
        for change in (0x01, 0x02, 0x04, 0x80):
            damaged = bytearray(whole)
            damaged[position] ^= change
            path.write_bytes(damaged)
            field, hit = cached_field(GRID, "exact", REACH)
            assert right(field), (position, change)
            if hit:  # only where JSON reads the same from other bytes: a space that became a tab
                assert json.loads(bytes(damaged).splitlines()[1]) == header


@pytest.mark.parametrize("levels", [1, 2, 99, -1, True, None, "9"])
def test_a_wrong_number_of_levels_is_not_believed(levels: object) -> None:
    path = fill()
    magic, header, payload = path.read_bytes().split(b"\n", 2)
    changed = json.loads(header) | {"levels": levels}
    path.write_bytes(b"\n".join([magic, json.dumps(changed).encode(), payload]))
    field, hit = cached_field(GRID, "exact", REACH)
    assert not hit
    assert right(field)


@pytest.mark.usefixtures("_quick")
def test_any_bit_of_the_payload_changed_is_noticed() -> None:
    path = fill()
    whole = path.read_bytes()
    start = whole.index(b"\n", whole.index(b"\n") + 1) + 1
    for position in range(start, len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << position % 8
        path.write_bytes(damaged)
        field, hit = cached_field(GRID, "exact", REACH)
        assert not hit
        assert right(field)


@pytest.mark.usefixtures("_quick")
def test_cut_off_anywhere_or_with_more_behind_is_noticed() -> None:
    path = fill()
    whole = path.read_bytes()
    for damaged in [whole[:end] for end in range(0, len(whole), 7)] + [whole + b"\0", whole + whole]:
        path.write_bytes(damaged)
        field, hit = cached_field(GRID, "exact", REACH)
        assert not hit
        assert right(field)
        assert path.read_bytes() == whole


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x80\x04\x95",
        *(b"mcl distance field\n" + header + b"\n" for header in (b"[]", b"3", b"{}", b"[" * 4000)),
        b"mcl distance field\n" * 900,
    ],
)
def test_what_is_no_field_is_replaced(content: bytes) -> None:
    path = fill()
    path.write_bytes(content)
    field, hit = cached_field(GRID, "exact", REACH)
    assert not hit
    assert right(field)
    assert cached_field(GRID, "exact", REACH)[1]


class Trap:
    """Leaves a mark if it is ever unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self.mark,)


def test_nothing_in_a_file_is_ever_executed(tmp_path: Path) -> None:
    import pickle

    path, mark = fill(), tmp_path / "executed"
    path.write_bytes(pickle.dumps(Trap(mark)))
    assert not cached_field(GRID, "exact", REACH)[1]
    np.save(path, np.array([Trap(mark)]), allow_pickle=True)
    path.with_name(path.name + ".npy").replace(path)
    assert not cached_field(GRID, "exact", REACH)[1]
    assert not mark.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="modes are POSIX")
def test_folder_and_file_are_the_users_own() -> None:
    path = fill()
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def one_warning(caplog: pytest.LogCaptureFixture) -> str:
    warnings = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(warnings) == 1
    assert warnings[0].name == "mclcli"
    return warnings[0].getMessage()


def test_no_folder_where_the_cache_should_be_costs_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "cache").write_text("a file is in the way")
    field, hit = cached_field(GRID, "exact", REACH)
    assert not hit
    assert right(field)
    assert "cannot keep the field" in one_warning(caplog)


def test_a_folder_that_cannot_be_written_costs_a_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", denied)
    assert right(cached_field(GRID, "exact", REACH)[0])
    assert "Permission denied; going on without" in one_warning(caplog)


def test_a_full_disk_costs_a_warning_and_leaves_no_scrap(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert right(cached_field(GRID, "exact", REACH)[0])
    assert "No space left" in one_warning(caplog)
    assert not list(field_path(GRID, "exact", REACH).parent.iterdir())


_WORKER = """
import sys
from mclcli.io.maps import field_cache
from tests.io.test_field_cache import GRID, REACH, right
for _ in range(40):
    field, hit = field_cache.cached_field(GRID, "exact", REACH)
    assert right(field)
    if not hit or sys.argv[1] == "remove":
        field_cache.field_path(GRID, "exact", REACH).unlink(missing_ok=True)
"""


def test_processes_at_once_never_read_half_a_file() -> None:
    path = field_path(GRID, "exact", REACH)
    root = Path(__file__).resolve().parents[2]
    commands = [[sys.executable, "-W", "error", "-c", _WORKER, role] for role in ("remove", "keep")]
    workers = [subprocess.Popen(c, cwd=root, stderr=subprocess.PIPE, text=True) for c in commands]
    said = [processes.finish(worker)[1] for worker in workers]
    assert [worker.returncode for worker in workers] == [0, 0], said
    assert not list(path.parent.glob(".field-*"))
