"""Which blocks of mcl's code an execution reached: a mark at the start of every block, set when it runs.

Marks are written into the syntax tree when a module is imported, so that this works alike on every Python and costs
little: a store a block.
"""

from __future__ import annotations

import ast
import importlib.machinery
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import CodeType, ModuleType

MARKS = bytearray()
"""One byte for each block of the modules imported so far; 1 since it ran."""
_NAME = "__reached__"
_BODIES = ("body", "orelse", "finalbody")


def install(package: str, without: Sequence[str] = ()) -> None:
    """Mark the blocks of all modules of a package that are imported from now on, but of those whose names begin so."""
    sys.meta_path.insert(0, _Finder(package, tuple(without)))


def clear() -> None:
    """Forget what ran."""
    MARKS[:] = bytes(len(MARKS))


def reached() -> int:
    """What ran since ``clear``: a number with one byte a block."""
    return int.from_bytes(MARKS, "little")


class _Finder(importlib.machinery.PathFinder):
    """Finds modules as Python does, and lets those of one package be loaded with marks."""

    def __init__(self, package: str, without: tuple[str, ...]) -> None:
        self._inside, self._without = f"{package}.", without

    def find_spec(  # type: ignore[override]
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Spec of a module of the package, None for all others."""
        if not fullname.startswith(self._inside) or fullname.startswith(self._without):
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(fullname, spec.origin)
        return spec


class _Loader(importlib.machinery.SourceFileLoader):
    """Compiles a module with marks; nothing of that is kept on disk."""

    def get_code(self, fullname: str) -> CodeType:
        """Code of the module."""
        tree = ast.parse(Path(self.get_filename(fullname)).read_bytes())
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                for inner in ast.walk(node):
                    for statements in _blocks(inner):
                        _mark(statements)
        return compile(ast.fix_missing_locations(tree), self.path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        """Run the module, with the marks in reach."""
        vars(module)[_NAME] = MARKS
        super().exec_module(module)


def _blocks(node: ast.AST) -> Iterator[list[ast.stmt]]:
    """Blocks of statements right below a node, which run or do not."""
    if not isinstance(node, ast.stmt | ast.excepthandler | ast.match_case) or isinstance(node, ast.ClassDef):
        return
    for name in _BODIES:
        statements = getattr(node, name, None)
        if isinstance(statements, list) and statements:
            yield statements


def _mark(statements: list[ast.stmt]) -> None:
    """Put marks before the first statement (behind a docstring) and behind all that branch, unless they are there."""
    if any(_is_mark(statement) for statement in statements):
        return
    first = statements[0]
    documented = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    places = {1 if documented else 0} | {
        at + 1 for at, statement in enumerate(statements) if hasattr(statement, "body")
    }
    for at in sorted(places - {len(statements)}, reverse=True):
        (mark,) = ast.parse(f"{_NAME}[{len(MARKS)}] = 1").body
        for node in ast.walk(mark):
            ast.copy_location(node, statements[at])
        statements.insert(at, mark)
        MARKS.append(0)


def _is_mark(statement: ast.stmt) -> bool:
    target = statement.targets[0] if isinstance(statement, ast.Assign) else None
    return isinstance(target, ast.Subscript) and isinstance(target.value, ast.Name) and target.value.id == _NAME
