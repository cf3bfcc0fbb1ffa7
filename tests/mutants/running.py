"""Running the nearest tests on a scratch copy of the tree, once for every mutant, each in a process of its own."""

from __future__ import annotations

import compileall
import os
import py_compile
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KILLED, SURVIVED, TIMEOUT = "killed", "survived", "timeout"
_BYTES = 6 << 30
_ELSEWHERE = {  # tests beside those of the package itself
    "filter": (
        "test_parameters.py",
        "settings/robots/test_names.py",
        "golden",
        "replay/test_loop.py",
        "replay/test_recovery.py",
    ),
    "sensors": ("test_parameters.py", "settings/robots/test_names.py", "golden", "kernels/test_borders.py"),
    "search": ("test_parameters.py", "settings/robots/test_names.py", "cli/test_locate.py"),
    "geometry": ("sensors", "kernels/test_borders.py"),
    "world": ("kernels/test_borders.py", "golden"),
    "motion": ("golden",),
}


def nearest(module: str) -> list[list[str]]:
    """Tests of a module such as ``filter/kld.py``: those named after it, the package's others, and some elsewhere."""
    package, name = module.split("/", maxsplit=1)[0], Path(module).stem
    tests = ROOT / "tests"
    own = sorted((tests / package).rglob("test_*.py"))
    named = [path for path in own if path.stem.startswith(f"test_{name}")]
    elsewhere = [tests / place for place in _ELSEWHERE.get(package, ())]
    groups = named, [path for path in own if path not in named], elsewhere
    return [[str(path.relative_to(ROOT)) for path in group] for group in groups if group]


@dataclass(slots=True)
class Scratch:
    """A copy of the tree below ``folder``, with caches that are filled; ``seconds`` of processor time by tests."""

    folder: Path
    seconds: dict[tuple[str, ...], float]

    @classmethod
    def make(cls, folder: Path) -> Scratch:
        """Copy what git knows of, as it stands; pycs are checked by content, since mutants come within a second."""
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True)  # noqa: S607
        for name in listed.stdout.decode().split("\0"):
            if (ROOT / name).is_file() and name.split("/")[0] not in {"docs", "benchmarks"}:
                (folder / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, folder / "tree" / name)
        mode = py_compile.PycInvalidationMode.CHECKED_HASH
        compileall.compile_dir(folder / "tree" / "mclcli", quiet=1, invalidation_mode=mode)
        (folder / "cache").mkdir()
        return cls(folder, {})

    def warm(self, tests: list[str]) -> None:
        """Run tests without a fault: to fill the caches, and to know how long they take."""
        begin = resource.getrusage(resource.RUSAGE_CHILDREN)
        if self._run(tests, 3600.0, "cache", write=True) != 0:
            raise SystemExit(f"without a fault these fail: {' '.join(tests)}\n{(self.folder / 'output').read_text()}")
        end = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.seconds[tuple(tests)] = end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime

    def read(self, module: str) -> str:
        """Text of a module without a fault, as it was when the copy was made."""
        return (self.folder / "tree" / "mclcli" / module).read_text()

    def judge(self, module: str, faulty: str) -> str:
        """What the nearest tests make of a module's faulty text."""
        path = self.folder / "tree" / "mclcli" / module
        text = path.read_text()
        path.write_text(faulty)
        try:
            for tests in nearest(module):
                if tuple(tests) not in self.seconds:
                    path.write_text(text)
                    self.warm(tests)
                    path.write_text(faulty)
                shutil.rmtree(self.folder / "used", ignore_errors=True)
                shutil.copytree(self.folder / "cache", self.folder / "used")
                code = self._run(tests, 10.0 + 4.0 * self.seconds[tuple(tests)], "used", write=False)
                if code:
                    return TIMEOUT if code in {-signal.SIGXCPU, -signal.SIGKILL} else KILLED
        finally:
            path.write_text(text)
        return SURVIVED

    def _run(self, tests: list[str], seconds: float, cache: str, *, write: bool) -> int:
        """Exit code of pytest in a fork of this process, which has the libraries in memory; negative for signals."""
        child = os.fork()
        if not child:
            self._be_pytest(tests, seconds, self.folder / cache, write=write)
        deadline, ended = time.monotonic() + 20.0 * seconds, 0
        try:
            while not ended and time.monotonic() < deadline:
                ended, status = os.waitpid(child, os.WNOHANG)
                time.sleep(0.0 if ended else 0.01)
        finally:  # after Ctrl-C as well
            if not ended:
                os.killpg(child, signal.SIGKILL)
                _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status)

    def _be_pytest(self, tests: list[str], seconds: float, cache: Path, *, write: bool) -> None:
        code = 70
        try:
            os.setsid()
            os.chdir(self.folder / "tree")
            output = os.open(self.folder / "output", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            for stream in (1, 2):
                os.dup2(output, stream)
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
            resource.setrlimit(resource.RLIMIT_AS, (_BYTES, _BYTES))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            os.environ |= {"MCL_TEST_CACHE_DIR": str(cache), "PYTHONPATH": str(Path.cwd())}
            os.environ.setdefault("MCL_TEST_DATA", str(ROOT.parent / "shared"))
            sys.dont_write_bytecode = not write
            sys.path[:] = [str(Path.cwd()), *(p for p in sys.path if Path(p or ".").resolve() != ROOT)]
            for name in [name for name in sys.modules if name.split(".")[0] in {"tests", "mclcli"}]:
                del sys.modules[name]
            import pytest

            temporary = f"--basetemp={self.folder / 'temporary'}"
            loaded = "-Wignore::pytest.PytestAssertRewriteWarning"  # Hypothesis, before pytest began
            options = ["-x", "-q", loaded, "-p", "no:cacheprovider", "-p", "no:xdist", temporary]
            code = int(pytest.main([*options, *tests]))
        except BaseException:  # noqa: BLE001 - or this process would return and go on as its parent does
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            sys.stdout.flush()
            os._exit(code)
