"""Every sabotage still applies to the code as it is, names a test that is there, and the harness tells what it sees."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.sabotage import scratch
from tests.sabotage.__main__ import main, noticed
from tests.sabotage.patches import PATCHES
from tests.sabotage.scratch import Patch, StalePatchError

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[1]
WORDS = Patch("words are words", "words.py", "WORD = 'mcl'", "WORD = 'amcl'", "test_words.py -k word")


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.breaks)
def test_a_patch_applies_and_names_its_test(patch: Patch) -> None:
    after = scratch.applied(patch, ROOT)
    compile(after, patch.file, "exec")
    assert after != (ROOT / "mclcli" / patch.file).read_text()
    assert (ROOT / "tests" / patch.noticed_by.partition(" -k ")[0]).is_file()


def test_there_are_as_many_as_promised() -> None:
    assert len(PATCHES) >= 30
    assert max(Counter(patch.breaks for patch in PATCHES).values()) == 1


@pytest.fixture
def repository(tmp_path: Path) -> Iterator[Path]:
    """A very small one."""
    for name in ("mclcli", "tests", "samples", "maps"):
        (tmp_path / name).mkdir()
    (tmp_path / "mclcli" / "__init__.py").write_text("")
    (tmp_path / "pyproject.toml").write_text("")
    (tmp_path / "mclcli" / "words.py").write_text("WORD = 'mcl'\nOTHER = 'a'\nAGAIN = 'a'\n")
    (tmp_path / "tests" / "test_words.py").write_text(
        "from mclcli.words import WORD\n\ndef test_the_word():\n    assert WORD == 'mcl'\n"
    )
    with scratch.copy(tmp_path) as folder:
        yield folder


def test_what_a_test_sees_is_told_from_what_it_does_not(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert noticed(WORDS, repository)
    assert not noticed(WORDS._replace(new="WORD = 'mc' + 'l'"), repository)
    assert not noticed(WORDS._replace(noticed_by="test_words.py -k nothing"), repository)
    assert not noticed(WORDS._replace(old="WORD = 'lost'"), repository)
    assert not noticed(WORDS._replace(old="'a'"), repository)
    printed = capsys.readouterr()
    assert [line.count("**nobody**") for line in printed.out.splitlines()] == [0, 1, 1]
    assert "stands 0 times in mclcli/words.py" in printed.err
    assert "stands 2 times in mclcli/words.py" in printed.err
    assert (repository / "mclcli" / "words.py").read_text().startswith("WORD = 'mcl'\n")  # taken back


def test_a_stale_patch_says_so(repository: Path) -> None:
    with (
        pytest.raises(StalePatchError, match="write it for the code as it is now"),
        scratch.patched(WORDS._replace(file="gone.py"), repository),
    ):
        pass


def test_the_sabotage_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    assert "--only" in capsys.readouterr().out
