"""Commands run one after the other in one process whose registries have a line more: starting one takes longest."""

from __future__ import annotations

import pickle
import sys
from typing import TYPE_CHECKING, Any, cast, final

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Sequence


def serve() -> None:
    """Answer every list of words on stdin with the result of mcl on stdout, both pickled, until there are no more."""
    from tests.cli.support import mcl

    questions, answers = sys.stdin.buffer, sys.stdout.buffer
    while True:
        try:
            words = pickle.load(questions)  # noqa: S301 - of the test
        except EOFError:
            return
        pickle.dump(mcl(*words), answers)
        answers.flush()


@final
class Served:
    """A process that runs ``serve``."""

    def __init__(self, started: subprocess.Popen[bytes]) -> None:
        self._started = started

    def ask(self, words: Sequence[str]) -> Any:
        """The result of mcl with these words."""
        questions = cast("Any", self._started.stdin)
        pickle.dump(list(words), questions)
        questions.flush()
        return pickle.load(cast("Any", self._started.stdout))  # noqa: S301 - of the test

    def end(self) -> int:
        """Let it end; its exit code."""
        self._started.communicate()
        return self._started.returncode
