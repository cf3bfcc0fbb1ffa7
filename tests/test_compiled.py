"""Caches in the user's own folder, and the choice between NumPy and compiled code."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from mclcli import cache, compiled
from mclcli.errors import AmbiguousResult, InputError, MclError, ThresholdMissed, UsageError, nearest_name


def test_the_choice_is_a_function_of_the_jobs_size() -> None:
    assert [compiled.worth_compiling(steps) for steps in (0.0, 1e6, 1e9, 1e12)] == [False, False, True, True]


def test_kernels_are_loaded_once_and_kept_where_the_cache_is() -> None:
    import numba

    kernel = compiled.load("brushfire")
    assert compiled.load("brushfire") is kernel
    assert kernel.__name__ == "mclcli.kernels.brushfire"
    folder = Path(numba.config.CACHE_DIR)  # type: ignore[attr-defined]
    assert folder.name.startswith("kernels-")
    assert list(folder.rglob("*.nbi"))


def test_the_environment_names_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MCL_CACHE_DIR", str(tmp_path / "here"))
    assert cache.cache_root() == tmp_path / "here"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="XDG is the custom of Linux")
def test_else_the_desktop_says_where_caches_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("MCL_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_root() == tmp_path / "mcl"


@pytest.mark.skipif(sys.platform == "win32", reason="modes are POSIX")
def test_a_new_folder_is_private(tmp_path: Path) -> None:
    cache.make_private(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(sys.platform == "win32", reason="owners are POSIX")
def test_a_folder_of_somebody_else_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    assert not cache.is_ours(tmp_path.stat())
    with pytest.raises(PermissionError, match="another user"):
        cache.make_private(tmp_path)


def test_exit_codes_are_a_contract() -> None:
    codes = {InputError: 1, UsageError: 2, ThresholdMissed: 4, AmbiguousResult: 5}
    assert {kind: kind.exit_code for kind in codes} == codes
    assert all(issubclass(kind, MclError) for kind in codes)


def test_only_a_name_that_is_near_is_suggested() -> None:
    assert nearest_name("sigma_hitt", ["sigma_hit", "z_hit"]) == "; did you mean 'sigma_hit'?"
    assert nearest_name("zzzzzz", ["sigma_hit", "z_hit"]) == ""
