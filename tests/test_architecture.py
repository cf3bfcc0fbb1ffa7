"""Rules of the code: import contracts, sizes, docstrings, and which package may use which library."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mclcli"
FILES = sorted(PACKAGE.rglob("*.py"))
Function = ast.FunctionDef | ast.AsyncFunctionDef


class _RunTime(ast.NodeTransformer):
    """Leaves out what is there for type checkers alone."""

    def visit_If(self, node: ast.If) -> ast.AST | None:
        return None if ast.unparse(node.test) == "TYPE_CHECKING" else self.generic_visit(node)


def at_run_time(path: Path) -> ast.Module:
    """Syntax tree of a file as it runs."""
    tree = _RunTime().visit(ast.parse(path.read_text(encoding="utf-8")))
    assert isinstance(tree, ast.Module)
    return tree


TREES = {path.relative_to(PACKAGE).as_posix(): at_run_time(path) for path in FILES}


def imports(tree: ast.AST) -> set[str]:
    """Absolute names of all modules a file imports, wherever it does."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module)
    return names


def top_level(tree: ast.Module) -> set[str]:
    """Modules imported when a file is imported, not within functions or for type checkers alone."""
    return imports(ast.Module([node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)], []))


def importers(library: str) -> set[str]:
    """Files that import a library."""
    return {
        name
        for name, tree in TREES.items()
        if any(module == library or module.startswith(f"{library}.") for module in imports(tree))
    }


def test_the_import_contracts_hold() -> None:
    pytest.importorskip("importlinter", reason="needs import-linter, of the extra 'lint'")
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " 0 broken" in done.stdout


@pytest.mark.parametrize(
    ("library", "allowed"),
    [
        ("ruamel", ()),
        ("yaml", ("io/tables/safe_yaml.py",)),
        ("rosbags", ("io/",)),
        ("mcap", ("io/traces/mcap_writer.py", "io/logs/mcap_index.py")),
        ("zstandard", ("io/",)),
        ("lz4", ("io/",)),
        ("sqlite3", ("io/",)),
        ("PIL", ("io/", "render/")),
        ("click", ("cli/",)),
        ("rich", ("cli/",)),
        ("numba", ("kernels/", "native/backend.py")),
        ("llvmlite", ("kernels/_vectors.py", "native/backend.py", "native/machine_code.py", "native/array_gate.py")),
        ("platformdirs", ("cache.py",)),
        ("pickle", ()),
        ("evo", ()),
    ],
)
def test_a_library_is_used_in_its_package_only(library: str, allowed: tuple[str, ...]) -> None:
    assert not {name for name in importers(library) if not name.startswith(allowed)}


@pytest.mark.parametrize(
    "library", ["numba", "llvmlite", "scipy", "mcap", "rosbags", "PIL", "yaml", "rich", "mclcli.kernels"]
)
def test_what_is_slow_to_import_waits_until_it_is_needed(library: str) -> None:
    path = ("kernels/", "io/logs/", "io/", "render/", "cli/")  # packages that are themselves imported late
    early = {name for name in importers(library) if any(m.startswith(library) for m in top_level(TREES[name]))}
    assert not {name for name in early if not name.startswith(path)}


def test_starting_up_loads_no_heavy_library() -> None:
    code = "import sys, mclcli.cli.run.options; print(*sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "mclcli" in loaded.split()
    assert not {"numba", "scipy", "mcap", "rosbags", "PIL", "yaml", "rich", "numpy"} & set(loaded.split())


def test_only_who_writes_mcap_pays_for_its_library(tmp_path: Path) -> None:
    words = [
        "run",
        "samples/office.mcap",
        "--map",
        "maps/office.yaml",
        "--init",
        "0,0,0",
        "--duration",
        "1",
        "--output",
    ]
    code = (
        "import sys; from mclcli.cli import main\ntry: main(sys.argv[1:])\n"
        "finally: print(*sorted(sys.modules), file=sys.stderr)"
    )
    for name, pays in (("r.csv", False), ("r.mcap", True)):
        done = subprocess.run(
            [sys.executable, "-c", code, *words, tmp_path / name], cwd=ROOT, capture_output=True, check=False
        )
        loaded = done.stderr.decode().splitlines()[-1].split()
        assert "mclcli.replay.loop" in loaded, name
        assert ("mcap.records" in loaded) == pays


def test_scipy_stats_is_never_imported() -> None:
    assert not importers("scipy.stats")


def test_library_code_never_prints_and_never_exits() -> None:
    for name, tree in TREES.items():
        calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
        named = {call.id for call in calls if isinstance(call, ast.Name)}
        if not name.startswith("cli/"):
            assert not named & {"print", "exit", "quit", "input"}, name
        assert not named & {"eval", "exec", "hasattr", "breakpoint"}, name


def test_files_are_short() -> None:
    lengths = {path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    assert not {name: lines for name, lines in lengths.items() if lines > 350}


def body_lines(function: Function) -> int:
    """Lines of a function's body without its docstring."""
    body = function.body[ast.get_docstring(function) is not None :]
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def test_functions_are_short() -> None:
    functions = {
        f"{name}:{node.name}": body_lines(node)
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, Function)
    }
    assert not {name: lines for name, lines in functions.items() if lines > 50}


def undocumented(body: list[ast.stmt], prefix: str) -> list[str]:
    """Public classes and functions without a docstring, and public members of public classes."""
    missing = []
    for node in body:
        if isinstance(node, ast.ClassDef | Function) and not node.name.startswith("_"):
            overload = any(ast.unparse(decorator).endswith("setter") for decorator in node.decorator_list)
            if not ast.get_docstring(node) and not overload:
                missing.append(f"{prefix}{node.name}")
            if isinstance(node, ast.ClassDef):
                missing += undocumented(node.body, f"{prefix}{node.name}.")
    return missing


@pytest.mark.parametrize("name", TREES)
def test_every_public_name_says_what_it_is(name: str) -> None:
    tree = TREES[name]
    if tree.body:
        assert ast.get_docstring(tree)
    assert undocumented(tree.body, "") == []


def test_classes_do_not_inherit_from_each_other() -> None:
    allowed = {"Protocol", "IntEnum", "Enum", "StrEnum", "NamedTuple", "TypedDict"}
    parents = {
        f"{name}:{node.name}": {ast.unparse(base).rpartition(".")[2] for base in node.bases} - allowed
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    ours = {label.partition(":")[2] for label in parents}
    inherited = {label: bases & ours for label, bases in parents.items() if not label.startswith("errors.py")}
    assert not {label: bases for label, bases in inherited.items() if bases}


def test_dataclasses_are_closed() -> None:
    for name, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                decorators = [ast.unparse(decorator) for decorator in node.decorator_list]
                if any("dataclass" in decorator for decorator in decorators):
                    assert "final" in " ".join(decorators), f"{name}:{node.name}"
                    assert "slots=True" in " ".join(decorators), f"{name}:{node.name}"


def test_the_references_are_independent_of_the_library() -> None:
    for path in (ROOT / "tests" / "reference").glob("*.py"):
        known = {module.partition(".")[0] for module in imports(ast.parse(path.read_text(encoding="utf-8")))}
        assert known <= {"__future__", "heapq", "math", "typing", "collections", "tests", "itertools"}, path.name
