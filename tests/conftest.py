"""What all tests share: Hypothesis without chance, and one folder for caches away from the user's own."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from collections.abc import Iterator

settings.register_profile(
    "mcl",
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
settings.load_profile("mcl")
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # under nohup: what the tests start would ignore it, too
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(scope="session", autouse=True)
def _cache_of_this_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The compiler's output is kept for all tests of a session, subprocesses included, and for no longer.

    Workers of pytest-xdist share it, for the compiler takes longer than most tests. MCL_TEST_CACHE_DIR names a folder
    that is kept, for many short sessions on the same kernels.
    """
    before = os.environ.get("MCL_CACHE_DIR")
    temporary = tmp_path_factory.getbasetemp()
    shared = temporary.parent if "PYTEST_XDIST_WORKER" in os.environ else temporary
    os.environ["MCL_CACHE_DIR"] = os.environ.get("MCL_TEST_CACHE_DIR") or str(shared / "mcl-cache")
    yield
    if before is None:
        del os.environ["MCL_CACHE_DIR"]
    else:
        os.environ["MCL_CACHE_DIR"] = before
