"""Nothing is taken from a cache that another user may have written, nor is anything but a regular file opened there."""

from __future__ import annotations

import json
import logging
import os
import stat
import sys
import tempfile
from typing import TYPE_CHECKING

import pytest

from mclcli import cache, ownership
from mclcli.io.maps.field_cache import cached_field, field_path
from mclcli.io.maps.pyramid_cache import cached_pyramid, pyramid_path
from mclcli.native import backend, machine_code
from mclcli.world import distance_field
from tests.cli.support import OFFICE_MAP, process
from tests.cli.support import finish as ended
from tests.worlds import drawn

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Find = Callable[[], tuple[Path, bool]]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="modes and owners are POSIX")
GRID = drawn("#.......\n........\n...#....\n........", 0.25, (1.0, 2.0, 0.3))
FIELD = distance_field.compute(GRID, "exact", 1.5)
AS_ROOT = pytest.mark.skipif(sys.platform == "win32" or os.getuid() != 0, reason="only root gives files away")
NOBODY = 65534


def find_field() -> tuple[Path, bool]:
    hit = cached_field(GRID, "exact", 1.5)[1]
    return field_path(GRID, "exact", 1.5), hit


def find_pyramid() -> tuple[Path, bool]:
    return pyramid_path(FIELD), cached_pyramid(FIELD)[1]


def find_kernels() -> tuple[Path, bool]:
    """As ``backend.load`` does, without compiling anything."""
    path = backend.kernel_folder() / "brushfire.kernels"
    hit = machine_code.read(path) is not None
    if not hit:
        machine_code.write(path, [machine_code.Function("f", "f", (), b"code", b"gate")])
    return path, hit


KINDS = pytest.mark.parametrize("find", [find_field, find_pyramid, find_kernels])


@pytest.fixture(autouse=True)
def root(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A cache of the test's own; temporary folders of the process go beside it."""
    (tmp_path / "own").mkdir(mode=0o700)
    (tmp_path / "tmp").mkdir(mode=0o700)
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "own" / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    cache._of_this_process.cache_clear()  # noqa: SLF001
    cache._WARNED.clear()  # noqa: SLF001
    return tmp_path / "own" / "cache"


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


@KINDS
def test_what_was_kept_is_found(find: Find, root: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert [find()[1], find()[1]] == [False, True]
    modes = {stat.S_IMODE(path.stat().st_mode) for path in (root, *root.rglob("*")) if path.is_dir()}
    assert modes == {0o700}
    assert stat.S_IMODE(find()[0].stat().st_mode) == 0o600
    assert warnings(caplog) == []


@KINDS
@pytest.mark.parametrize("mode", [0o666, 0o602, 0o646])
def test_a_file_that_others_may_write_is_made_anew(find: Find, mode: int, caplog: pytest.LogCaptureFixture) -> None:
    path, _ = find()
    path.chmod(mode)
    assert find() == (path, False)
    assert find() == (path, True)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert warnings(caplog) == [f"{path} is not used: others may write to it; it is made anew"]


@KINDS
def test_what_is_no_regular_file_is_never_opened(find: Find, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path, _ = find()
    kept = path.rename(tmp_path / "kept")
    for number, kind in enumerate(("FIFO", "link")):
        path.unlink(missing_ok=True)
        cache._WARNED.clear()  # noqa: SLF001
        if kind == "FIFO":
            os.mkfifo(path)
        else:
            path.symlink_to(kept)
        assert find() == (path, False)  # a FIFO that was opened would wait here
        assert find() == (path, True)
        assert not path.is_symlink()
        assert len(warnings(caplog)) == number + 1
    assert "no regular file" in warnings(caplog)[0]


@KINDS
@pytest.mark.parametrize("which", ["root", "folder"])
@pytest.mark.parametrize("mode", [0o777, 0o702, 0o1777])
def test_a_folder_that_others_may_write_is_not_used(
    find: Find, which: str, mode: int, root: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, _ = find()
    place = root if which == "root" else path.parent
    place.chmod(mode)
    elsewhere, hit = find()
    assert not hit
    assert elsewhere.is_relative_to(tmp_path / "tmp")
    assert find() == (elsewhere, True)
    (said,) = warnings(caplog)
    assert said.startswith(f"cache {root} is not used: {place}: others may write to it; remove it")
    assert "--cache-dir" in said
    with pytest.raises(PermissionError):
        cache.open_kept(path)  # also where it changed since it was looked at
    with pytest.raises(PermissionError):
        cache.write_whole(path, [b""])


@KINDS
def test_a_parent_that_others_may_write_must_be_sticky(
    find: Find, root: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, _ = find()
    root.parent.chmod(0o1777)
    assert find() == (path, True)
    assert warnings(caplog) == []
    root.parent.chmod(0o777)
    assert not find()[0].is_relative_to(root)
    (said,) = warnings(caplog)
    assert f"{root.parent}: others may write to it; correct that (chmod go-w, chown) and remove {root}" in said


@KINDS
def test_a_link_within_the_cache_is_not_followed(
    find: Find, root: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, _ = find()
    path.parent.rename(tmp_path / "elsewhere")
    path.parent.symlink_to(tmp_path / "elsewhere")
    assert not find()[0].is_relative_to(root)
    assert "it is a link" in warnings(caplog)[0]
    with pytest.raises(OSError, match=r"."):
        cache.open_kept(path)


@KINDS
def test_links_to_the_cache_are_followed_where_nobody_else_can_place_them(
    find: Find, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find()
    (tmp_path / "open").mkdir()
    (tmp_path / "open" / "link").symlink_to(root)
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "open" / "link"))
    assert find()[1]
    (tmp_path / "open").chmod(0o777)
    assert find()[0].is_relative_to(tmp_path / "tmp")
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "open" / ".." / "own" / "cache"))
    assert find()[0].is_relative_to(tmp_path / "tmp")  # the same folder, through one that others may exchange


@pytest.mark.parametrize("relative", [False, True])
def test_what_a_link_leads_through_counts(tmp_path: Path, *, relative: bool) -> None:
    (tmp_path / "open" / "cache").mkdir(parents=True)
    target = tmp_path / "open" / "cache"
    (tmp_path / "link").symlink_to("../" + str(target.relative_to(tmp_path.parent)) if relative else target)
    assert ownership.fault_on_the_way(tmp_path / "link" / "missing") is None
    (tmp_path / "open").chmod(0o777)
    assert ownership.fault_on_the_way(tmp_path / "link") == (tmp_path / "open", "others may write to it")
    (tmp_path / "round").symlink_to("round")
    assert ownership.fault_on_the_way(tmp_path / "round") is None  # and opening it is an error


@KINDS
@pytest.mark.parametrize("which", ["root", "folder", "file"])
def test_what_belongs_to_another_user_is_not_used(
    find: Find, which: str, root: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    path, _ = find()
    theirs = {"root": root, "folder": path.parent, "file": path}[which].stat()
    monkeypatch.setattr(ownership, "is_ours", lambda status: not os.path.samestat(status, theirs))
    assert not find()[1]
    assert find()[1]
    assert "it belongs to another user" in warnings(caplog)[0]
    assert len(warnings(caplog)) == 1


@AS_ROOT
@KINDS
def test_a_parent_of_another_user_is_not_believed(find: Find, root: Path) -> None:
    find()
    os.chown(root.parent, NOBODY, NOBODY)
    assert not find()[0].is_relative_to(root)


@AS_ROOT
def test_a_group_of_others_counts_and_the_users_own_does_not(root: Path) -> None:
    find_field()
    root.chmod(0o770)
    assert find_field()[1]
    os.chown(root, 0, NOBODY)
    assert not find_field()[0].is_relative_to(root)


def test_what_another_user_owns_is_told_by_its_number(tmp_path: Path) -> None:
    theirs = os.stat_result((0o100600, 0, 0, 1, os.getuid() + 1, os.getgid(), 0, 0, 0, 0))
    assert ownership.fault(theirs, str(tmp_path)) == "it belongs to another user"
    assert ownership.fault(tmp_path.stat(), str(tmp_path)) == ""


def test_a_group_that_nobody_knows_counts_as_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    status = os.stat_result((0o100620, 0, 0, 1, os.getuid(), 3_000_000_000, 0, 0, 0, 0))
    assert ownership.fault(status, str(tmp_path)) == "others may write to it"
    monkeypatch.setattr(ownership, "_is_our_group", lambda _: True)
    assert ownership.fault(status, str(tmp_path)) == ""


def test_rights_given_by_name_are_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An access list shows as the group's bits."""
    monkeypatch.setattr(ownership, "_is_our_group", lambda _: True)
    monkeypatch.setattr(os, "getxattr", lambda *_: b"list", raising=False)
    status = os.stat_result((0o100620, 0, 0, 1, os.getuid(), os.getgid(), 0, 0, 0, 0))
    assert (ownership.fault(status, str(tmp_path)) != "") == (sys.platform == "linux")


def test_where_no_folder_can_be_had_at_all_nothing_is_kept(
    root: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    root.mkdir()
    root.chmod(0o777)
    monkeypatch.setattr(tempfile, "tempdir", str(root))  # others may write there as well
    assert [find_field()[1], find_field()[1]] == [False, False]
    assert len(warnings(caplog)) == 2
    assert list(root.iterdir()) == []


def test_without_a_home_nothing_is_put_into_the_working_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    import platformdirs

    monkeypatch.chdir(tmp_path / "own")
    monkeypatch.delenv("MCL_CACHE_DIR")
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda *_, **__: "~/.cache/mcl")
    assert find_field()[0].is_relative_to(tmp_path / "tmp")
    assert "set HOME" in warnings(caplog)[0]
    assert list((tmp_path / "own").iterdir()) == []


def test_folders_are_private_whatever_the_mask(root: Path) -> None:
    before = os.umask(0)
    try:
        assert [find_field()[1], find_field()[1]] == [False, True]
    finally:
        os.umask(before)
    assert root.is_dir()


def test_code_for_another_processor_is_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    path, _ = find_kernels()
    assert machine_code.read(path)
    monkeypatch.setattr(machine_code, "_processor", lambda: "another")
    assert machine_code.read(path) is None
    monkeypatch.undo()
    magic, header, payload = path.read_bytes().split(b"\n", 2)
    changed = json.loads(header) | {"processor": "another"}
    path.write_bytes(b"\n".join([magic, json.dumps(changed).encode(), payload]))
    assert machine_code.read(path) is None


def test_a_command_over_a_cache_that_everybody_may_write(root: Path, tmp_path: Path) -> None:
    """As after ``chmod -R a+rwX``: right results, one warning, nothing of it read or written, no folder left."""
    words = ("dt", OFFICE_MAP)
    environment = dict(os.environ, TMPDIR=str(tmp_path / "tmp"))
    first = ended(process(*words, env=environment))
    for place in (root, *root.rglob("*")):
        place.chmod(0o777 if place.is_dir() else 0o666)
    before = {path: path.stat().st_mtime_ns for path in root.rglob("*")}
    second = ended(process(*words, env=environment))
    assert (first.code, second.code) == (0, 0), second.err
    assert second.err.count("warning") == 1
    assert "is not used" in second.err
    assert {path: path.stat().st_mtime_ns for path in root.rglob("*")} == before
    assert list((tmp_path / "tmp").iterdir()) == []
    assert b"miss" in second.out
