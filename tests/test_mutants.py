"""The mutator: which faults it makes, that each parses and differs, and that what is explained is still there."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.mutants.__main__ import draw, explained
from tests.mutants.mutations import mutants
from tests.mutants.running import ROOT, nearest

SOURCE = '''
"""Text with a 1."""
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    X = 1 + 1
A: "int | 2" = 3
def f(x: float = 0.5, y=-1) -> "1 < 2":
    """More text, 1 < 2."""
    if x < y and not x:
        raise ValueError(f"{x + 1} is no {1 < 2}")
    x += g(x, y)
    g(x)
    return x
'''
EXPECTED = {
    'A: "int | 2" = 3': {'A: "int | 2" = (4)', 'A: "int | 2" = (2)', 'A: "int | 2" = (6)'},
    "if x < y and not x:": {
        "if (not (x < y and (not x))):",
        "if (x < y or not x):",
        "if (x <= y) and not x:",
        "if (x >= y) and not x:",
        "if x < y and (x):",
    },
    "x += g(x, y)": {"pass", "x -= g(x, y)", "x += (g(y, x))"},
    "g(x)": {"pass"},
    "return x": {"return None"},
    'def f(x: float = 0.5, y=-1) -> "1 < 2":': {
        f'def f(x: float = {x}, y={y}) -> "1 < 2":'
        for x, y in [("(1.5)", "-1"), ("(-0.5)", "-1"), ("(1.0)", "-1")] + [("0.5", y) for y in ("(1)", "-(2)", "-(0)")]
    },
}


def test_which_faults_are_made() -> None:
    changes: dict[str, set[str]] = {}
    for mutant in mutants(SOURCE):
        old, new = mutant.change(SOURCE)
        changes.setdefault(old, set()).add(new)
    assert changes == EXPECTED


@pytest.mark.parametrize("module", ["filter/kld.py", "sensors/endpoints.py", "search/evidence.py"])
def test_every_mutant_parses_and_is_another_program(module: str) -> None:
    source = (ROOT / "mclcli" / module).read_text()
    whole, found = ast.dump(ast.parse(source)), mutants(source)
    assert len(found) > 100
    assert all(ast.dump(ast.parse(mutant.apply(source))) != whole for mutant in found[::5])


def test_a_sample_is_that_of_its_seed() -> None:
    assert draw(["filter"], 20, 3) == draw(["filter"], 20, 3) != draw(["filter"], 20, 4)


def test_the_nearest_tests_come_first() -> None:
    named, own, elsewhere = nearest("filter/kld.py")
    assert named == ["tests/filter/test_kld.py"]
    assert "tests/filter/test_localizer.py" in own
    assert "tests/golden" in elsewhere
    assert all((ROOT / path).exists() for path in (*named, *own, *elsewhere))


def test_what_is_explained_can_still_be_made() -> None:
    for file in {file for file, _, _ in explained()}:
        source = Path(ROOT / "mclcli" / file).read_text()
        made = {mutant.change(source) for mutant in mutants(source)}
        assert {(old, new) for name, old, new in explained() if name == file} <= made
