"""What the documentation names exists: files, functions, registries, the version to cite."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mclcli.version import __version__

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
STATIONS = re.findall(
    r"([\w/]+\.py)  ([A-Za-z_.]+(?:, [A-Za-z_.]+)*)", (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_files_that_are_named_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    paths = re.findall(r"`((?:[\w.]+/)+[\w.]+\.(?:py|toml|yml|sh))`", text)
    paths += re.findall(r"(?<![\w/.<])((?:\w+/)+\w+\.py)\b", text)  # in drawings
    named = {path for path in paths if "NAME" not in path}
    below = (ROOT, ROOT / "mclcli", ROOT / "tests")
    assert [name for name in sorted(named) if not any((folder / name).exists() for folder in below)] == []


@pytest.mark.parametrize(("path", "names"), STATIONS)
def test_the_way_of_a_scan_goes_through_functions_that_exist(path: str, names: str) -> None:
    text = (ROOT / "mclcli" / path).read_text(encoding="utf-8")
    parts = re.split(r", |\.", names)
    assert [part for part in parts if not re.search(rf"^\s*(?:def|class) {part}\b", text, re.MULTILINE)] == []


def test_the_way_of_a_scan_is_drawn() -> None:
    assert len(STATIONS) >= 15


def test_registries_that_are_named_exist() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = re.findall(r"^\| [^|]+\|[^|]+\| `(\w+)` in `([\w/]+\.py)`", page, re.MULTILINE)
    named += [
        (name, path) for path, name in re.findall(r"^\| [^|]+\| `([\w/]+\.py)` \| `(\w+)`, there", page, re.MULTILINE)
    ]
    assert len(named) >= 6
    for name, path in named:
        text = (ROOT / "mclcli" / path).read_text(encoding="utf-8")
        assert re.search(rf"^(?:class )?{name}\b", text, re.MULTILINE), f"{path}: {name}"


def test_the_version_to_cite_is_this_one() -> None:
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
