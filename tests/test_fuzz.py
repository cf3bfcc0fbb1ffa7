"""A short run of the fuzzing, of fixed length and seed, and that it would notice what it looks for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tests.fuzz import blocks, engine, store
from tests.fuzz.__main__ import SHARES, all_targets
from tests.fuzz.engine import Target

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

ROOT = Path(__file__).resolve().parents[1]
EXECUTIONS = 300
PLANTED = '''
def parse(data):
    """Deep in there is a fault."""
    if data[:1] == b"m":
        if data[1:2] == b"c":
            if data[2:3] == b"l":
                if len(data) > 9:
                    raise KeyError("the fault")
    raise ValueError(data)
'''


def test_every_parser_holds_for_a_while() -> None:
    words = ["-m", "tests.fuzz", "--executions", str(EXECUTIONS), "--seed", "1"]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(" executions, 0 finds\n")


def test_every_parser_has_a_corpus(tmp_path: Path) -> None:
    names = [target.name for target in all_targets(tmp_path)]
    assert len(names) == len(set(names)) >= 20
    assert {name.replace(" ", "_") for name in names} == {path.stem for path in store.FOLDER.iterdir()}
    assert set(SHARES) <= set(names)


def test_a_corpus_reads_back(tmp_path: Path) -> None:
    inputs = [b"", b"\0\xff\n", "\u2028é".encode(), b"\\\"'"]
    store.save("a target", [*inputs, b""], tmp_path)
    assert store.load("a target", tmp_path) == sorted(inputs, key=lambda data: (len(data), data))
    assert store.load("another", tmp_path) == []


def test_new_code_leads_to_faults_that_chance_does_not_find(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "planted").mkdir()
    (tmp_path / "planted" / "__init__.py").write_text("")
    for name in ("marked", "plain"):
        (tmp_path / "planted" / f"{name}.py").write_text(PLANTED)
    monkeypatch.setattr(sys, "meta_path", sys.meta_path.copy())
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    blocks.install("planted", without=("planted.plain",))
    from planted import marked, plain  # type: ignore[import-not-found]

    found = {name: _fuzzed(module.parse) for name, module in (("marked", marked), ("plain", plain))}
    assert found["plain"] == {}
    (find,) = found["marked"].values()
    assert find.data[:3] == b"mcl"
    assert "the fault" in find.what
    assert found["marked"] == _fuzzed(marked.parse)


def _fuzzed(parse: Callable[[bytes], object]) -> dict[str, engine.Find]:
    return engine.fuzz(Target("planted", parse, (ValueError,), [b"2"], limit=20), [], 60_000, 5).finds


def test_hangs_and_warnings_are_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    import numpy as np

    monkeypatch.setattr(engine, "PROMISED_S", 0.2)

    def spin(data: bytes) -> None:
        while data == b"spin":
            pass

    def overflow(data: bytes) -> None:
        np.exp(np.array([1e9])) if data == b"spin" else None

    for run, kind in ((spin, "HangError"), (overflow, "RuntimeWarning")):
        (place,) = engine.fuzz(Target("x", run, (), [b"spin"]), [], 50, 0).finds
        assert place.startswith(kind)
